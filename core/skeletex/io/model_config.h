// SPDX-License-Identifier: MIT
#pragma once
#include <filesystem>
#include <string>

namespace skeletex {

/// A named pair of mesh and skeleton, as the experiments use them.
struct ModelConfig {
  std::string name;
  std::filesystem::path mesh;      ///< relative paths in the file are resolved against the file's own folder
  std::filesystem::path skeleton;
  std::string credits;
};

/// Reads {"name", "mesh", "skeleton", "credits"}. Whether the two files exist is not checked here.
/// \throw IoError
ModelConfig read_model_config(const std::filesystem::path& path);

}  // namespace skeletex
