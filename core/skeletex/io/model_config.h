// SPDX-License-Identifier: MIT
#pragma once
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

namespace skeletex {

/// A named pair of mesh and skeleton, as the experiments use them.
struct ModelConfig {
  std::string name;
  std::filesystem::path mesh;  ///< relative paths in the file are resolved against the file's own folder
  std::filesystem::path skeleton;
  std::string credits;
  nlohmann::json view;  ///< how pictures show it (see render/camera.h); null when the file has none
};

/// Reads {"name", "mesh", "skeleton", "credits"} and, where it is there, "view". Whether the two files exist is not
/// checked here.
/// \throw IoError
ModelConfig read_model_config(const std::filesystem::path& path);

}  // namespace skeletex
