// SPDX-License-Identifier: MIT
#pragma once
#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace skeletex::cli {

/// out.skx.exr -> out_007.skx.exr
std::string numbered(const std::string& path, std::size_t number);

/// A pose file, and what is written of it.
struct PoseOutput {
  std::string pose, output;
};
/// What --pose and --output name: one pose, or all that a pattern such as poses/*.json matches, in the order of their
/// names. {name} in the output is the pose's, poses/walk.json -> walk.
/// \param pose  empty: none, and the output as it is
/// \throw CLI::ValidationError when an output would be an input or another output, or has no {name} for several poses;
///        InputError when nothing matches
std::vector<PoseOutput> pose_outputs(const CLI::App& command, const std::string& pose, const std::string& output);
/// Whether it stands for all files that it matches.
bool is_pattern(const std::string& path);

}  // namespace skeletex::cli
