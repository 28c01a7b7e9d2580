// SPDX-License-Identifier: MIT
#include "deform_option.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "command.h"
#include "files.h"
#include "skeletex/io/pose_file.h"
#include "skeletex/io/suggestion.h"
#include "skeletex/model/error.h"
#include "skeletex/skeleton/find_bone.h"

namespace skeletex::cli {
namespace {

constexpr std::array kDeformations{Deformation::kSmooth, Deformation::kCoordinates, Deformation::kPaper,
                                   Deformation::kLinear};

}  // namespace

CLI::Option* add_pose_option(CLI::App& command, std::string& value) {
  return declare_input(command, command.add_option("--pose", value,
                                                   "pose or animation of a model: .json. A pattern such as "
                                                   "'poses/*.json' takes all of them, each with an output of its own, "
                                                   "in which {name} is the pose's name"))
      ->type_name("FILE");
}

std::optional<Skeleton> posed_skeleton(const Skeleton& bind, const std::string& pose,
                                       const std::optional<double>& time) {
  if (pose.empty()) return std::nullopt;
  const PoseAnimation animation = read_animation(pose, bind);
  const double first = animation.frames.front().time, last = animation.frames.back().time;
  if (time && animation.frames.size() > 1 && !(*time >= first && *time <= last))
    warn(fmt::format("--time {}: {} runs from {} to {}; its {} frame is shown", *time, pose, first, last,
                     *time < first ? "first" : "last"));
  return apply_pose(bind, pose_at(bind, animation, time.value_or(animation.frames.front().time)));
}

CLI::Option* add_deform_option(CLI::App& command, std::string& value) {
  CLI::Option* option = command.add_option(
      "--deform", value,
      "how a pose moves the surface: smooth blends the motions of the bones near by, coordinates "
      "keeps each point's place along "
      "and about its bone, paper moves texels by the paper's rules, linear moves them as exported rigs move in "
      "other programs (default: smooth)");
  std::vector<std::string> words;
  for (const Deformation deformation : kDeformations) words.push_back(to_string(deformation));
  take_one_of(*option, words);
  return option;
}

void add_polish_option(CLI::App& command, bool& value, CLI::Option* pose) {
  command.add_flag("--polish", value, "smooth the surface where the pose has folded it")->needs(pose);
}

void check_distance_option(bool is_distance_dropped, const std::string& word) {
  if (is_distance_dropped && deformation_of(word) != Deformation::kPaper &&
      deformation_of(word) != Deformation::kCoordinates)
    throw CLI::ValidationError(
        "--no-distance",
        fmt::format("{} poses restore no distances to the bones; add --deform paper or --deform coordinates", word));
}

int bone_by_name(const Skeleton& skeleton, const std::string& name) {
  if (const std::optional<int> bone = find_bone(skeleton, name)) return *bone;
  std::vector<std::string> names;
  for (const Bone& bone : skeleton.bones) names.push_back(bone.name);
  throw InputError(
      fmt::format("the skeleton has no bone \"{}\"; `skeletex inspect` lists them{}", name, did_you_mean(name, names)));
}

Deformation deformation_of(const std::string& word) {
  return *std::find_if(kDeformations.begin(), kDeformations.end(),
                       [&](Deformation deformation) { return word == to_string(deformation); });
}

}  // namespace skeletex::cli
