// SPDX-License-Identifier: MIT
#pragma once
#include <optional>
#include <string>

#include "command.h"
#include "skeletex/reconstruct/pose/pose_mesh.h"

namespace skeletex::cli {

/// --pose, a file or a pattern of files (output_names.h).
CLI::Option* add_pose_option(CLI::App& command, std::string& value);
/// The skeleton as a file poses it.
/// \param pose  empty: not at all
/// \param time  in an animation; none: that of its first frame
/// \throw IoError, InputError
std::optional<Skeleton> posed_skeleton(const Skeleton& bind, const std::string& pose,
                                       const std::optional<double>& time);
/// --deform smooth, coordinates, paper or linear.
CLI::Option* add_deform_option(CLI::App& command, std::string& value);
/// --polish.
void add_polish_option(CLI::App& command, bool& value, CLI::Option* pose);
/// Refuses --no-distance with the rules that restore no distances.
/// \throw CLI::ValidationError
void check_distance_option(bool is_distance_dropped, const std::string& word);
/// \pre one of the option's words
Deformation deformation_of(const std::string& word);

/// \throw InputError when the skeleton has no bone of that name
int bone_by_name(const Skeleton& skeleton, const std::string& name);

}  // namespace skeletex::cli
