// SPDX-License-Identifier: MIT
#include "skeletex/edit/transfer/part_pair.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "skeletex/edit/morph/blend.h"
#include "skeletex/geometry/best_rotation.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

constexpr double kJoinRadii = 1.0;  // the least distance over which a part joins, in radii of where it begins

Correspondence match_parts(const Part& to, const Part& from) {
  const auto name = [](const Part& part) { return part.model.skeleton.bones[0].name; };
  return find_correspondence(to.model.skeleton, from.model.skeleton,
                             {.given = {{kRestOfBody, kRestOfBody}, {name(to), name(from)}}});
}

/// Directions, from where the two parts begin, that shall agree: of the first bone, and of all other nodes where the
/// whole skeletons correspond, else of the bones nearby and of the body's centre. The first part's, then the second's.
std::array<std::vector<Vec3>, 2> equal_directions(const SkeletexModel& source, const SkeletexModel& target,
                                                  const Part& from, const Part& to) {
  std::array<std::vector<Vec3>, 2> result{std::vector{direction_from(from.model.skeleton, {0, from.near})},
                                          std::vector{direction_from(to.model.skeleton, {0, to.near})}};
  try {
    const Correspondence whole = find_correspondence(
        target.skeleton, source.skeleton,
        {.given = {{target.skeleton.bones[to.bones[0]].name, source.skeleton.bones[from.bones[0]].name}}});
    const Vec3 origin = end_position(from.model.skeleton, 0, from.near),
               target_origin = end_position(to.model.skeleton, 0, to.near);
    for (std::size_t n = 0; n < whole.nodes.size(); ++n) {
      const Vec3 d = source.skeleton.nodes[whole.nodes[n]].position - origin,
                 e = target.skeleton.nodes[n].position - target_origin;
      if (d.norm() > 0 && e.norm() > 0) result[0].push_back(d.normalized()), result[1].push_back(e.normalized());
    }
  } catch (const InputError&) {
    result[0].insert(result[0].end(), from.rest.begin(), from.rest.end());
    result[1].insert(result[1].end(), to.rest.begin(), to.rest.end());
  }
  return result;
}

/// The source's part rotated about the node where it begins, so that its first bone and the rest of the body point as
/// the target's, as well as they can. Then the rest of the body is rotated so that posing the one part as the other
/// rolls nothing about the bone. Angles about bones stay.
Part aligned(const SkeletexModel& source, const SkeletexModel& target, Part from, const Part& to) {
  const Vec3 origin = end_position(from.model.skeleton, 0, from.near);
  const auto [own, wanted] = equal_directions(source, target, from, to);
  const Vec3 direction = own[0], target_direction = wanted[0];
  const Eigen::Quaterniond turn = best_rotation(own, wanted);
  for (Node& node : from.model.skeleton.nodes) node.position = origin + turn * (node.position - origin);
  for (Bone& bone : from.model.skeleton.bones)
    if (bone.s) bone.s = turn * *bone.s;
  const Eigen::Quaterniond bend = Eigen::Quaterniond::FromTwoVectors(target_direction, turn * direction);
  const Vec3 rest = to.model.skeleton.nodes.back().position - end_position(to.model.skeleton, 0, to.near);
  from.model.skeleton.nodes.back().position = origin + bone_length(from.model.skeleton, 0) * (bend * rest.normalized());
  return from;
}

/// The seams of a part as a network.
SeamNetwork network_of(const SkeletexModel& part, const SeparationPlanes& separation) {
  SeamNetwork network{part.arcs, part.corners, {}, part.ends};
  for (const SeamCorner& corner : network.corners)
    network.directions.push_back(
        (separation.seam_point(corner.bones[0], end_at(part.skeleton, corner.bones[0], corner.node), corner.sample.turn,
                               1) -
         part.skeleton.nodes[corner.node].position)
            .normalized());
  return network;
}

}  // namespace

PartPair::PartPair(const SkeletexModel& source, const SkeletexModel& target, Part from, Part to,
                   const TransferOptions& options)
    : source_(source),
      target_(target),
      from_(aligned(source, target, std::move(from), to)),
      to_(std::move(to)),
      options_(options),
      map_(from_.model, to_.model.skeleton, match_parts(to_, from_)) {
  const SeparationPlanes separation(to_.model.skeleton);
  map_.set_network(separation, network_of(to_.model, separation));
  for (int i = 0; i < count(); ++i)
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail})
      if (is_free_end(target_, target_bone(i), end) != is_free_end(source_, source_bone(i), map_.model_end(i, end)))
        throw InputError(
            fmt::format("of the bones \"{}\" and \"{}\" only one ends freely; choose bones that branch alike",
                        source_.skeleton.bones[source_bone(i)].name, target_.skeleton.bones[target_bone(i)].name));
}

bool PartPair::is_scaled_by_girth() const {
  return options_.scale == TransferScale::kGirth || (options_.scale == TransferScale::kAuto && is_between());
}

double PartPair::width_in_rows(int i) const {
  if (options_.width_in_texels > 0) return options_.width_in_texels;
  const double share = options_.width >= 0 ? options_.width : is_between() ? 0.5 : 0.25;
  return share * (target_patch(i).rectangle.height - 1);
}

double PartPair::join_distance() const {
  const double width = width_in_rows(0) / (target_patch(0).rectangle.height - 1) * target_length(0);
  if (options_.width >= 0 || options_.width_in_texels > 0) return width;
  return std::max(width, kJoinRadii * std::max(cut(BoneEnd::kHead).radius, cut(BoneEnd::kTail).radius));
}

double PartPair::length_ratio() const {
  double to = 0, from = 0;
  for (int i = 0; i < count(); ++i) to += target_length(i), from += source_length(i);
  return to / from;
}

double PartPair::length_scale(int i) const {
  double to = target_length(i), from = source_length(i);
  for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail})
    if (i == 0 && !is_free_end(target_, target_bone(i), opposite(end))) to -= cut(end).kept, from -= cut(end).skipped;
  return to / from;
}

double PartPair::length_offset(int i) const {
  if (i > 0) return 0;
  const double scale = length_scale(i);
  if (!is_free_end(target_, target_bone(i), BoneEnd::kHead))
    return cut(BoneEnd::kHead).kept - scale * cut(BoneEnd::kHead).skipped;
  const double to = target_length(i) - cut(BoneEnd::kTail).kept;
  return to - scale * (source_length(i) - cut(BoneEnd::kTail).skipped);
}

void PartPair::set_rows(int i, Patch& patch) const {
  if (is_height_field(patch.method)) patch.method = Method::kVsm;  // texels of two models lie on no common rays
  for (const PartCut& cut : cuts_)
    for (const double kept : cut.kept_rows)
      if (i == 0 && kept > 0) return;
  for (int r = 1; r + 1 < patch.rectangle.height; ++r)
    patch.row_u[r] = u_at_same_share(source_patch(i), r, patch.rectangle.height, map_.is_reversed(i));
}

void PartPair::set_seams(SkeletexModel& result, const SeparationPlanes& separation) const {
  const auto set = [&](NodeIndex node, const std::vector<BoneIndex>& bones, SeamSample& sample) {
    const Vec3 direction = separation.seam_point(bones[0], end_at(target_.skeleton, bones[0], node), sample.turn, 1) -
                           target_.skeleton.nodes[node].position;
    sample.distance = seam_distance(separation, node, bones, direction);
  };
  for (SeamArc& arc : result.arcs)
    if (is_inside(arc.bones[0], arc.node))
      for (SeamSample& sample : arc.samples) set(arc.node, {arc.bones[0], arc.bones[1]}, sample);
  for (SeamCorner& corner : result.corners)
    if (is_inside(corner.bones[0], corner.node)) set(corner.node, corner.bones, corner.sample);
}

double PartPair::shear(const SeparationPlanes& source_separation, const SeparationPlanes& separation, int i,
                       BoneEnd end, double turn) const {
  const double source_slope =
      source_separation.slope(source_bone(i), map_.model_end(i, end), map_.model_turn(i, end, turn));
  return cut(end).scale * separation.slope(target_bone(i), end, turn) -
         length_scale(i) * source_slope * (map_.is_reversed(i) ? -1 : 1);
}

Vec3 PartPair::seam_offset(const SeparationPlanes& source_separation, const SeparationPlanes& separation, int i,
                           BoneEnd end, double turn) const {
  const BoneIndex bone = target_bone(i);
  const double slope = separation.slope(bone, end, turn);
  const double source_slope =
      source_separation.slope(source_bone(i), map_.model_end(i, end), map_.model_turn(i, end, turn)) *
      (map_.is_reversed(i) ? -1 : 1);
  const auto across = [&](double k, double distance) {
    return (end == BoneEnd::kHead ? k > 0 : k < 0) ? distance : distance / std::hypot(1, k);
  };
  const double placed = cut(end).scale * across(source_slope, map_.seam_at(i, end, turn).distance);
  const Vec3 direction = separation.radial(bone, turn) + slope * separation.bases()[bone].o;
  const double wanted = across(slope, seam_distance(separation, end_node(target_.skeleton, bone, end),
                                                    {bone, separation.neighbour(bone, end, turn)}, direction));
  return {wanted - placed, 0, (wanted - placed) * slope};
}

int PartPair::index_of(BoneIndex target_bone) const {
  const auto found = std::find(to_.bones.begin(), to_.bones.end(), target_bone);
  return found == to_.bones.end() ? -1 : static_cast<int>(found - to_.bones.begin());
}

bool PartPair::is_inside(BoneIndex target_bone, NodeIndex node) const {
  const int i = index_of(target_bone);
  return i >= 0 && is_inner_seam(i, end_at(target_.skeleton, target_bone, node));
}

/// The scaled distance of the source's seam in a direction: the mean of what the bones that meet there read.
double PartPair::seam_distance(const SeparationPlanes& separation, NodeIndex node, const std::vector<BoneIndex>& bones,
                               const Vec3& direction) const {
  double sum = 0;
  for (const BoneIndex bone : bones)
    sum += map_.seam_at(index_of(bone), end_at(target_.skeleton, bone, node), separation.turn_of(bone, direction))
               .distance;
  // A part with such a seam has the same scale at both ends.
  return cut(BoneEnd::kHead).scale * sum / static_cast<double>(bones.size());
}

}  // namespace skeletex
