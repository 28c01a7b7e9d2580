// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>

#include "skeletex/edit/transfer/limb_root.h"
#include "skeletex/edit/transfer/placement.h"

namespace skeletex {
namespace {

constexpr double kSame = 0.01;  // of the girth

/// The profiles of the first bones, per column of the target's patch.
struct Profiles {
  std::vector<BoneProfile> target, source;
};

Profiles find_profiles(const TransferInput& input, const PartPair& pair, BoneEnd end) {
  const PatchPoints &target = input.target_patches[pair.target_bone(0)],
                    &source = input.source_patches[pair.source_bone(0)];
  const BoneEnd source_end = pair.map().model_end(0, end);
  Profiles profiles;
  for (int j = 0; j < target.width; ++j) {
    profiles.target.push_back(bone_profile(target, j, end, pair.target_length(0)));
    const double turn = pair.map().model_turn(0, end, static_cast<double>(j) / target.width);
    const int column = static_cast<int>(std::lround((turn - std::floor(turn)) * source.width)) % source.width;
    profiles.source.push_back(bone_profile(source, column, source_end, pair.source_length(0)));
  }
  return profiles;
}

/// Whether source and target have the same surface at the target's cut.
bool are_same(const PartPair& pair, const PartCut& cut, const Profiles& profiles, double source_step) {
  double gap = 0, size = 0;
  for (std::size_t j = 0; j < profiles.target.size(); ++j) {
    const Vec3 p = at_row(profiles.target[j], cut.kept_rows[j]),
               q = at_row(profiles.source[j], source_step * cut.kept_rows[j]);
    gap += (p - Vec3(cut.scale * q.x(), cut.scale * q.y(), pair.length_ratio() * q.z())).norm();
    size += p.head<2>().norm();
  }
  return gap < kSame * size;
}

/// Sets the rows that the target keeps and that the source leaves out.
void choose_rows(const TransferInput& input, const PartPair& pair, const Profiles& profiles, PartCut& cut) {
  const TransferOptions& options = input.options;
  const int width = static_cast<int>(profiles.target.size());
  const auto choose = [&](const std::vector<BoneProfile>& columns, double given,
                          const std::vector<Eigen::Vector2d>& wanted) {
    if (given >= 0 || options.blend == TransferBlend::kNone || pair.is_between())
      return std::vector<double>(width, std::max(0.0, given) * static_cast<double>(columns[0].size() - 1));
    return limb_root(columns, wanted);
  };
  cut.kept_rows = choose(profiles.target, options.keep, {});
  std::vector<Eigen::Vector2d> wanted;
  if (!pair.is_scaled_by_girth())
    for (int j = 0; j < width; ++j)
      wanted.push_back(at_row(profiles.target[j], cut.kept_rows[j]).head<2>() / cut.scale);
  cut.skipped_rows = choose(profiles.source, options.skip, wanted);
  const double source_step =
      static_cast<double>(profiles.source[0].size() - 1) / static_cast<double>(profiles.target[0].size() - 1);
  if (options.skip < 0 && options.keep < 0 && are_same(pair, cut, profiles, source_step))
    for (int j = 0; j < width; ++j) cut.skipped_rows[j] = source_step * cut.kept_rows[j];
}

/// Sets the lengths that are left out, the radius and the scale.
void measure_cut(const PartPair& pair, TransferScale scale, const Profiles& profiles, PartCut& cut) {
  const int width = static_cast<int>(profiles.target.size()), height = static_cast<int>(profiles.target[0].size()),
            source_height = static_cast<int>(profiles.source[0].size());
  const double fade = pair.width_in_rows(0), source_step = static_cast<double>(source_height - 1) / (height - 1);
  double girth = 0, source_girth = 0;
  for (int j = 0; j < width; ++j) {
    const BoneProfile &target = profiles.target[j], &source = profiles.source[j];
    const double kept = cut.kept_rows[j], skipped = cut.skipped_rows[j];
    // A part that leaves nothing out goes from node to node.
    if (kept > 0 || skipped > 0) {
      cut.kept += at_row(target, kept).z() / width;
      cut.skipped += at_row(source, skipped).z() / width;
    }
    cut.radius += at_row(target, kept).head<2>().norm() / width;
    girth += at_row(target, std::min(kept + fade, 0.9 * height)).head<2>().norm();
    source_girth += at_row(source, std::min(skipped + fade * source_step, 0.9 * source_height)).head<2>().norm();
  }
  if (pair.is_scaled_by_girth())
    cut.scale = girth / source_girth;
  else if (scale == TransferScale::kAuto)
    cut.scale = std::sqrt(cut.scale * girth / source_girth);
}

}  // namespace

void find_cuts(const TransferInput& input, PartPair& pair) {
  const TransferScale scale = input.options.scale;
  for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail})
    pair.cut(end).scale = scale == TransferScale::kFactor ? input.options.factor : pair.length_ratio();
  for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) {
    if (!pair.is_boundary(0, end)) continue;
    const Profiles profiles = find_profiles(input, pair, end);
    choose_rows(input, pair, profiles, pair.cut(end));
    measure_cut(pair, scale, profiles, pair.cut(end));
  }
  if (pair.is_between()) return;
  const BoneEnd end = pair.is_boundary(0, BoneEnd::kTail) ? BoneEnd::kTail : BoneEnd::kHead;
  pair.cut(opposite(end)).scale = pair.cut(end).scale;
}

}  // namespace skeletex
