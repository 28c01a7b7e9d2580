// SPDX-License-Identifier: MIT
#include "skeletex/edit/transfer/part.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <queue>

#include "skeletex/edit/morph/seam_map.h"
#include "skeletex/model/error.h"
#include "skeletex/skeleton/pose.h"

namespace skeletex {

const char* const kRestOfBody = "\n";

namespace {

constexpr double kFalloff = 0.3;  // of a bone's weight in the direction of the rest of the body, from bone to bone

/// Numbers of bones between a node and every other; -1 where no path leads, or only over the bone `without`.
std::vector<int> steps_from(const Skeleton& skeleton, int start, int without = -1) {
  const auto at = bones_at_nodes(skeleton);
  std::vector<int> steps(skeleton.nodes.size(), -1);
  std::queue<int> queue({start});
  steps[start] = 0;
  for (; !queue.empty(); queue.pop())
    for (const BoneAtNode bone : at[queue.front()]) {
      const int far = end_node(skeleton, bone.bone, opposite(bone.end));
      if (bone.bone == without || steps[far] >= 0) continue;
      steps[far] = steps[queue.front()] + 1;
      queue.push(far);
    }
  return steps;
}

/// The numbers of a model's parts in an extracted part; -1 where they are not in it.
struct PartIndex {
  std::vector<BoneIndex> bones;
  std::vector<NodeIndex> nodes;
};

/// Copies the bones, their nodes and patches.
PartIndex copy_bones(const SkeletexModel& whole, Part& part) {
  const std::vector<BoneBasis> bases = bone_bases(whole.skeleton);
  PartIndex index{std::vector<BoneIndex>(whole.skeleton.bones.size()),
                  std::vector<NodeIndex>(whole.skeleton.nodes.size())};
  Skeleton& skeleton = part.model.skeleton;
  for (const int b : part.bones) {
    index.bones[b] = static_cast<int>(skeleton.bones.size());
    Bone bone = whole.skeleton.bones[b];
    for (NodeIndex* node : {&bone.head, &bone.tail}) {
      if (index.nodes[*node] < 0) {
        index.nodes[*node] = static_cast<int>(skeleton.nodes.size());
        skeleton.nodes.push_back(whole.skeleton.nodes[*node]);
      }
      *node = index.nodes[*node];
    }
    bone.s = bases[b].s;
    skeleton.bones.push_back(bone);
    part.model.patches.push_back(whole.patches[b]);
  }
  return index;
}

/// Appends the bone that stands for the rest of the body, and sets the directions to it.
void append_rest(const SkeletexModel& whole, const PartIndex& index, Part& part) {
  const Skeleton& skeleton = whole.skeleton;
  const NodeIndex near_node = end_node(skeleton, part.bones[0], part.near);
  const std::vector<int> steps = steps_from(skeleton, near_node);
  const Vec3& origin = skeleton.nodes[near_node].position;
  Vec3 near_rest = Vec3::Zero(), centre = Vec3::Zero();
  for (int b = 0; b < static_cast<int>(skeleton.bones.size()); ++b) {
    const Bone& bone = skeleton.bones[b];
    if (index.bones[b] >= 0 || steps[bone.head] < 0) continue;
    const Vec3 middle = 0.5 * (skeleton.nodes[bone.head].position + skeleton.nodes[bone.tail].position) - origin;
    if (middle.norm() > 0)
      near_rest += std::pow(kFalloff, std::min(steps[bone.head], steps[bone.tail])) * middle.normalized();
    centre += bone_length(skeleton, b) * middle;
  }
  const double length = bone_length(skeleton, part.bones[0]);
  const Vec3 away = -direction_from(skeleton, {part.bones[0], part.near});
  const auto unit_or_away = [&](const Vec3& v) { return v.norm() > 1e-6 * length ? Vec3(v.normalized()) : away; };
  part.rest = {unit_or_away(near_rest), unit_or_away(centre)};
  const Vec3 rest = unit_or_away(part.rest[0] + part.rest[1]);
  Skeleton& own = part.model.skeleton;
  own.nodes.push_back({kRestOfBody, origin + length * rest});
  own.bones.push_back({kRestOfBody, static_cast<int>(own.nodes.size()) - 1, index.nodes[near_node], {}});
  part.model.patches.push_back(part.model.patches[0]);
}

/// Copies the corners, arcs and ends of the nodes all of whose bones are in the part.
void copy_seams(const SkeletexModel& whole, const PartIndex& index, Part& part) {
  const auto at = bones_at_nodes(whole.skeleton);
  const auto is_inside = [&](NodeIndex node) {
    return std::all_of(at[node].begin(), at[node].end(), [&](BoneAtNode bone) { return index.bones[bone.bone] >= 0; });
  };
  std::vector<int> part_arc(whole.arcs.size(), -1), part_corner(whole.corners.size(), -1);
  for (std::size_t c = 0; c < whole.corners.size(); ++c) {
    SeamCorner corner = whole.corners[c];
    if (!is_inside(corner.node)) continue;
    for (BoneIndex& bone : corner.bones) bone = index.bones[bone];
    corner.node = index.nodes[corner.node];
    part_corner[c] = static_cast<int>(part.model.corners.size());
    part.model.corners.push_back(corner);
  }
  for (std::size_t a = 0; a < whole.arcs.size(); ++a) {
    SeamArc arc = whole.arcs[a];
    if (!is_inside(arc.node)) continue;
    arc.node = index.nodes[arc.node];
    for (const int side : {0, 1}) {
      arc.bones[side] = index.bones[arc.bones[side]];
      if (arc.corners[side] >= 0) arc.corners[side] = part_corner[arc.corners[side]];
    }
    part_arc[a] = static_cast<int>(part.model.arcs.size());
    part.model.arcs.push_back(arc);
  }
  part.model.ends.resize(part.model.skeleton.bones.size());
  for (std::size_t i = 0; i < part.bones.size(); ++i)
    for (const int end : {0, 1})
      for (const ArcUse use : whole.ends[part.bones[i]][end].arcs)
        if (part_arc[use.arc] >= 0) part.model.ends[i][end].arcs.push_back({part_arc[use.arc], use.is_reversed});
}

}  // namespace

bool is_free_end(const SkeletexModel& model, BoneIndex bone, BoneEnd end) {
  return model.ends[bone][static_cast<int>(end)].arcs.empty();
}

BoneEnd near_end(const SkeletexModel& model, BoneIndex bone) {
  const bool is_head_free = is_free_end(model, bone, BoneEnd::kHead),
             is_tail_free = is_free_end(model, bone, BoneEnd::kTail);
  if (is_head_free != is_tail_free) return is_head_free ? BoneEnd::kTail : BoneEnd::kHead;
  for (const int root : root_nodes(model.skeleton)) {
    const std::vector<int> steps = steps_from(model.skeleton, root);
    const int head = steps[model.skeleton.bones[bone].head], tail = steps[model.skeleton.bones[bone].tail];
    if (head >= 0) return head <= tail ? BoneEnd::kHead : BoneEnd::kTail;
  }
  return BoneEnd::kHead;
}

std::vector<BoneIndex> limb_of(const SkeletexModel& model, BoneIndex bone) {
  const Skeleton& skeleton = model.skeleton;
  const BoneEnd near = near_end(model, bone);
  const std::vector<int> steps = steps_from(skeleton, end_node(skeleton, bone, opposite(near)), bone);
  if (steps[end_node(skeleton, bone, near)] >= 0)
    throw InputError(fmt::format("bone \"{}\" is part of a cycle: no limb hangs on it; transfer its bones one by one",
                                 skeleton.bones[bone].name));
  std::vector<BoneIndex> limb{bone};
  for (int other = 0; other < static_cast<int>(skeleton.bones.size()); ++other)
    if (other != bone && steps[skeleton.bones[other].head] >= 0) limb.push_back(other);
  return limb;
}

Part extract_part(const SkeletexModel& whole, std::vector<BoneIndex> bones) {
  Part part;
  part.bones = std::move(bones);
  part.near = near_end(whole, part.bones[0]);
  const PartIndex index = copy_bones(whole, part);
  append_rest(whole, index, part);
  copy_seams(whole, index, part);
  return part;
}

}  // namespace skeletex
