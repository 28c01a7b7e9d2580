// SPDX-License-Identifier: MIT
#include "skeletex/edit/transfer.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <queue>

#include "skeletex/edit/blend.h"
#include "skeletex/edit/overlay.h"
#include "skeletex/model/error.h"
#include "skeletex/model/pose.h"

namespace skeletex {
namespace {

constexpr const char* kRest = "\n";  // name of the bone that stands for the rest of the body: no file's bone has it
constexpr double kFalloff = 0.3;     // from bone to bone, how much a bone counts for where the rest of the body lies

BoneEnd end_at(const Skeleton& skeleton, int bone, int node) { return skeleton.bones[bone].head == node ? BoneEnd::kHead : BoneEnd::kTail; }
BoneEnd opposite(BoneEnd end) { return end == BoneEnd::kHead ? BoneEnd::kTail : BoneEnd::kHead; }
bool is_free(const SkeletexModel& model, int bone, BoneEnd end) { return model.ends[bone][static_cast<int>(end)].arcs.empty(); }

int bone_by_name(const Skeleton& skeleton, const std::string& name, const char* which) {
  for (std::size_t i = 0; i < skeleton.bones.size(); ++i)
    if (skeleton.bones[i].name == name) return static_cast<int>(i);
  throw InputError(fmt::format("the {} has no bone \"{}\"", which, name));
}

/// Steps over bones from a node to every other; -1 where another component lies, or `without` is the only way.
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

/// The end that the rest of the body lies at: the one that is not free, else the one nearer to a root.
BoneEnd near_end(const SkeletexModel& model, int bone) {
  const bool is_head_free = is_free(model, bone, BoneEnd::kHead), is_tail_free = is_free(model, bone, BoneEnd::kTail);
  if (is_head_free != is_tail_free) return is_head_free ? BoneEnd::kTail : BoneEnd::kHead;
  for (const int root : root_nodes(model.skeleton)) {
    const std::vector<int> steps = steps_from(model.skeleton, root);
    const int head = steps[model.skeleton.bones[bone].head], tail = steps[model.skeleton.bones[bone].tail];
    if (head >= 0) return head <= tail ? BoneEnd::kHead : BoneEnd::kTail;
  }
  return BoneEnd::kHead;
}

/// The bone and all those behind its far end.
std::vector<int> limb_of(const SkeletexModel& model, int bone) {
  const Skeleton& skeleton = model.skeleton;
  const BoneEnd near = near_end(model, bone);
  const std::vector<int> steps = steps_from(skeleton, end_node(skeleton, bone, opposite(near)), bone);
  if (steps[end_node(skeleton, bone, near)] >= 0)
    throw InputError(fmt::format("bone \"{}\" is part of a cycle: no limb hangs on it; transfer its bones one by one", skeleton.bones[bone].name));
  std::vector<int> limb{bone};
  for (int other = 0; other < static_cast<int>(skeleton.bones.size()); ++other)
    if (other != bone && steps[skeleton.bones[other].head] >= 0) limb.push_back(other);
  return limb;
}

/// Some bones of a model that hang together, cut out: bone i is bones[i]. One more bone, the last, starts where they
/// leave the rest of the body and points to it. Seams are kept where all bones of a node are in the part.
struct Part {
  std::vector<int> bones;
  BoneEnd near = BoneEnd::kHead;  ///< of bones[0]
  SkeletexModel model;            ///< skeleton, patches, ends, arcs, corners; no texels
};

Part cut_out(const SkeletexModel& whole, std::vector<int> bones) {
  Part part;
  part.bones = std::move(bones);
  part.near = near_end(whole, part.bones[0]);
  const std::vector<BoneBasis> bases = bone_bases(whole.skeleton);
  const int count = static_cast<int>(part.bones.size());
  std::vector<int> part_bone(whole.skeleton.bones.size(), -1), part_node(whole.skeleton.nodes.size(), -1);
  Skeleton& skeleton = part.model.skeleton;
  for (int i = 0; i < count; ++i) {
    const int b = part.bones[i];
    part_bone[b] = i;
    Bone bone = whole.skeleton.bones[b];
    for (int* node : {&bone.head, &bone.tail}) {
      if (part_node[*node] < 0) {
        part_node[*node] = static_cast<int>(skeleton.nodes.size());
        skeleton.nodes.push_back(whole.skeleton.nodes[*node]);
      }
      *node = part_node[*node];
    }
    bone.s = bases[b].s;
    skeleton.bones.push_back(bone);
    part.model.patches.push_back(whole.patches[b]);
  }

  // Where the rest of the body lies, as seen from the near node: near bones first.
  const int near_node = end_node(whole.skeleton, part.bones[0], part.near);
  const std::vector<int> steps = steps_from(whole.skeleton, near_node);
  const Vec3& origin = whole.skeleton.nodes[near_node].position;
  Vec3 rest = Vec3::Zero();
  for (int b = 0; b < static_cast<int>(whole.skeleton.bones.size()); ++b) {
    const Bone& bone = whole.skeleton.bones[b];
    if (part_bone[b] >= 0 || steps[bone.head] < 0) continue;
    const Vec3 middle = 0.5 * (whole.skeleton.nodes[bone.head].position + whole.skeleton.nodes[bone.tail].position) - origin;
    if (middle.norm() > 0) rest += std::pow(kFalloff, std::min(steps[bone.head], steps[bone.tail])) * middle.normalized();
  }
  const double length = bone_length(whole.skeleton, part.bones[0]);
  if (!(rest.norm() > 1e-6)) rest = -direction_from(whole.skeleton, {part.bones[0], part.near});
  skeleton.nodes.push_back({kRest, origin + length * rest.normalized()});
  skeleton.bones.push_back({kRest, static_cast<int>(skeleton.nodes.size()) - 1, part_node[near_node], {}});
  part.model.patches.push_back(part.model.patches[0]);

  const auto at = bones_at_nodes(whole.skeleton);
  const auto is_inside = [&](int node) { return std::all_of(at[node].begin(), at[node].end(), [&](BoneAtNode bone) { return part_bone[bone.bone] >= 0; }); };
  std::vector<int> part_arc(whole.arcs.size(), -1), part_corner(whole.corners.size(), -1);
  for (std::size_t c = 0; c < whole.corners.size(); ++c) {
    SeamCorner corner = whole.corners[c];
    if (!is_inside(corner.node)) continue;
    for (int& bone : corner.bones) bone = part_bone[bone];
    corner.node = part_node[corner.node];
    part_corner[c] = static_cast<int>(part.model.corners.size());
    part.model.corners.push_back(corner);
  }
  for (std::size_t a = 0; a < whole.arcs.size(); ++a) {
    SeamArc arc = whole.arcs[a];
    if (!is_inside(arc.node)) continue;
    arc.node = part_node[arc.node];
    for (const int side : {0, 1}) {
      arc.bones[side] = part_bone[arc.bones[side]];
      if (arc.corners[side] >= 0) arc.corners[side] = part_corner[arc.corners[side]];
    }
    part_arc[a] = static_cast<int>(part.model.arcs.size());
    part.model.arcs.push_back(arc);
  }
  part.model.ends.resize(skeleton.bones.size());
  for (int i = 0; i < count; ++i)
    for (const int end : {0, 1})
      for (ArcUse use : whole.ends[part.bones[i]][end].arcs)
        if (part_arc[use.arc] >= 0) part.model.ends[i][end].arcs.push_back({part_arc[use.arc], use.is_reversed});
  return part;
}

/// Mean distance of an end's seam from the bone.
double girth(const SkeletexModel& model, int bone, BoneEnd end) {
  double sum = 0;
  std::size_t count = 0;
  for (const ArcUse use : model.ends[bone][static_cast<int>(end)].arcs)
    for (const SeamSample& sample : model.arcs[use.arc].samples) sum += sample.distance, ++count;
  return sum / static_cast<double>(std::max<std::size_t>(1, count));
}

double faded(double rows_from_seam, double width, TransferBlend blend) {
  if (rows_from_seam <= 0) return 0;
  if (blend == TransferBlend::kNone || rows_from_seam >= width) return 1;
  const double share = rows_from_seam / width;
  return blend == TransferBlend::kLinear ? share : (1 - std::cos(std::numbers::pi * share)) / 2;
}

/// The row, between rows, at which a patch has this u.
double row_of_u(const Patch& patch, double u) {
  const auto after = std::upper_bound(patch.row_u.begin() + 1, patch.row_u.end() - 1, u);
  const auto below = after - 1;
  return static_cast<double>(below - patch.row_u.begin()) + std::clamp((u - *below) / (*after - *below), 0.0, 1.0);
}

/// One part of the source on one part of the target.
class PartTransfer {
 public:
  PartTransfer(const SkeletexModel& source, const SkeletexModel& target, Part from, Part to, const TransferOptions& options)
      : source_(source), target_(target), from_(std::move(from)), to_(std::move(to)), options_(options),
        overlay_(from_.model, to_.model.skeleton,
                 find_correspondence(to_.model.skeleton, from_.model.skeleton, {.given = {{kRest, kRest}, {bone_name(to_), bone_name(from_)}}})) {
    const Walls walls(to_.model.skeleton);
    SeamNetwork network{to_.model.arcs, to_.model.corners, {}, to_.model.ends};
    for (const SeamCorner& corner : network.corners)
      network.directions.push_back((walls.seam_point(corner.bones[0], end_at(to_.model.skeleton, corner.bones[0], corner.node), corner.sample.turn, 1) -
                                    to_.model.skeleton.nodes[corner.node].position)
                                       .normalized());
    overlay_.set_seams(walls, network);
    for (int i = 0; i < count(); ++i)
      for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail})
        if (is_free(target_, to_.bones[i], end) != is_free(source_, source_bone(i), overlay_.model_end(i, end)))
          throw InputError(fmt::format("of the bones \"{}\" and \"{}\" only one ends freely; choose bones that branch alike",
                                       source_.skeleton.bones[source_bone(i)].name, target_.skeleton.bones[to_.bones[i]].name));
    scale_ = scale_at(0, to_.near);
  }

  int count() const { return static_cast<int>(to_.bones.size()); }
  int target_bone(int i) const { return to_.bones[i]; }
  int source_bone(int i) const { return from_.bones[overlay_.model_bone(i)]; }
  const Overlay& overlay() const { return overlay_; }

  /// Rows of the result's patch: the source's.
  void set_rows(int i, Patch& patch) const {
    const Patch& from = source_.patches[source_bone(i)];
    const bool is_reversed = overlay_.is_reversed(i);
    for (int r = 1; r + 1 < patch.rectangle.height; ++r) {
      const double u = u_at_row(from, row_at_same_share(r, patch.rectangle.height, from.rectangle.height, is_reversed));
      patch.row_u[r] = is_reversed ? 1 - u : u;
    }
    if (from.method == Method::kVsm) patch.method = Method::kVsm;
  }

  /// Share of the source's texels in a row, and what they are scaled by.
  std::array<double, 2> share_and_scale(int i, int row) const {
    const int last = target_.patches[to_.bones[i]].rectangle.height - 1;
    const double width = options_.width_in_texels > 0 ? options_.width_in_texels : options_.width * last;
    double share = 1;
    if (is_boundary(i, BoneEnd::kHead)) share *= faded(row, width, options_.blend);
    if (is_boundary(i, BoneEnd::kTail)) share *= faded(last - row, width, options_.blend);
    const double along = static_cast<double>(row) / last;
    return {share, (1 - along) * scale_at(i, BoneEnd::kHead) + along * scale_at(i, BoneEnd::kTail)};
  }

  /// The seams inside of the part become the source's.
  void set_seams(SkeletexModel& result) const {
    std::vector<int> part_bone(target_.skeleton.bones.size(), -1);
    for (int i = 0; i < count(); ++i) part_bone[to_.bones[i]] = i;
    const auto is_inside = [&](int bone, int node) { return part_bone[bone] >= 0 && !is_boundary(part_bone[bone], end_at(target_.skeleton, bone, node)); };
    const Walls walls(target_.skeleton);
    const auto distance_at = [&](int bone, int node, const Vec3& direction) {
      return scale_ * overlay_.seam_at(part_bone[bone], end_at(target_.skeleton, bone, node), walls.turn_of(bone, direction)).distance;
    };
    const auto read = [&](int node, const std::vector<int>& bones, SeamSample& sample) {
      const Vec3 direction =
          walls.seam_point(bones[0], end_at(target_.skeleton, bones[0], node), sample.turn, 1) - target_.skeleton.nodes[node].position;
      sample.distance = 0;
      for (const int bone : bones) sample.distance += distance_at(bone, node, direction) / static_cast<double>(bones.size());
    };
    for (SeamArc& arc : result.arcs)
      if (is_inside(arc.bones[0], arc.node))
        for (SeamSample& sample : arc.samples) read(arc.node, {arc.bones[0], arc.bones[1]}, sample);
    for (SeamCorner& corner : result.corners)
      if (is_inside(corner.bones[0], corner.node)) read(corner.node, corner.bones, corner.sample);
  }

 private:
  static std::string bone_name(const Part& part) { return part.model.skeleton.bones[0].name; }
  bool is_boundary(int i, BoneEnd end) const {
    return !is_free(target_, to_.bones[i], end) && to_.model.ends[i][static_cast<int>(end)].arcs.empty();
  }
  double scale_at(int i, BoneEnd end) const {
    if (is_boundary(i, end)) return girth(target_, to_.bones[i], end) / girth(source_, source_bone(i), overlay_.model_end(i, end));
    return scale_ > 0 ? scale_ : bone_length(target_.skeleton, to_.bones[0]) / bone_length(source_.skeleton, source_bone(0));
  }

  const SkeletexModel &source_, &target_;
  Part from_, to_;
  TransferOptions options_;
  Overlay overlay_;
  double scale_ = 0;
};

}  // namespace

SkeletexModel transfer(ClContext& context, const SkeletexModel& source, const SkeletexModel& target,
                       const std::vector<std::pair<std::string, std::string>>& bones, const TransferOptions& options) {
  if (bones.empty()) throw InputError("there are no bones to transfer");
  if (!(options.width >= 0) || !(options.width_in_texels >= 0)) throw InputError("the width of a blend is 0 or more");
  std::vector<std::unique_ptr<PartTransfer>> parts;
  std::vector<std::pair<const PartTransfer*, int>> part_of(target.patches.size(), {nullptr, 0});
  for (const auto& [from, to] : bones) {
    const int a = bone_by_name(source.skeleton, from, "source"), b = bone_by_name(target.skeleton, to, "target");
    const auto chosen = [&](const SkeletexModel& model, int bone) { return options.has_limbs ? limb_of(model, bone) : std::vector<int>{bone}; };
    parts.push_back(std::make_unique<PartTransfer>(source, target, cut_out(source, chosen(source, a)), cut_out(target, chosen(target, b)), options));
    for (int i = 0; i < parts.back()->count(); ++i) {
      auto& [part, index] = part_of[parts.back()->target_bone(i)];
      if (part) throw InputError(fmt::format("bone \"{}\" of the target is replaced twice", target.skeleton.bones[parts.back()->target_bone(i)].name));
      part = parts.back().get();
      index = i;
    }
  }

  SkeletexModel result = target;
  for (const auto& part : parts) part->set_seams(result);
  for (std::size_t b = 0; b < part_of.size(); ++b)
    if (part_of[b].first) part_of[b].first->set_rows(part_of[b].second, result.patches[b]);

  // Two sources: the target itself, then the source.
  BlendTables tables;
  tables.source_count = 2;
  std::vector<LatticeRow> rows = lattice_rows(target.patches, RowChoice::kAll);
  std::erase_if(rows, [&](const LatticeRow& row) { return !part_of[row[0]].first; });
  for (const Patch& patch : target.patches) {
    const auto [x, y, width, height] = patch.rectangle;
    tables.sources.push_back({y * target.texture.width + x, target.texture.width, width, height, static_cast<int>(tables.head_columns.size()), 1.0f});
    for (int j = 0; j < width; ++j) tables.head_columns.push_back(static_cast<float>(j));
  }
  tables.tail_columns = tables.head_columns;
  const int source_begin = static_cast<int>(target.texture.out.size());
  for (std::size_t b = 0; b < part_of.size(); ++b) {
    const auto [part, i] = part_of[b];
    if (!part) {
      tables.sources.push_back({});
      continue;
    }
    const auto [x, y, width, height] = source.patches[part->source_bone(i)].rectangle;
    tables.sources.push_back({source_begin + y * source.texture.width + x, source.texture.width, width, height,
                              static_cast<int>(tables.head_columns.size()), part->overlay().is_reversed(i) ? -1.0f : 1.0f});
    append_columns(part->overlay(), i, target.patches[b].rectangle.width, tables);
  }
  for (const LatticeRow& row : rows) {
    const auto [part, i] = part_of[row[0]];
    tables.rows.push_back({static_cast<float>(row_of_u(target.patches[row[0]], result.patches[row[0]].row_u[row[1]])),
                           static_cast<float>(1 - part->share_and_scale(i, row[1])[0])});
  }
  for (const LatticeRow& row : rows) {
    const auto [part, i] = part_of[row[0]];
    const auto [share, scale] = part->share_and_scale(i, row[1]);
    const double at = row_at_same_share(row[1], target.patches[row[0]].rectangle.height, source.patches[part->source_bone(i)].rectangle.height,
                                        part->overlay().is_reversed(i));
    tables.rows.push_back({static_cast<float>(at), static_cast<float>(share * scale)});
  }

  const auto upload_both = [&](const std::vector<float>& first, const std::vector<float>& second) {
    std::vector<float> both = first;
    both.insert(both.end(), second.begin(), second.end());
    return context.upload(both);
  };
  const DisplacementTexture &t = target.texture, &s = source.texture;
  const DevicePlanes texels{upload_both(t.along, s.along), upload_both(t.around, s.around), upload_both(t.out, s.out)};
  DevicePlanes blended{context.upload(t.along), context.upload(t.around), context.upload(t.out)};
  const Walls walls(result.skeleton);
  blend_texels(context, tables, rows, frame_tables(result.skeleton, walls, result.patches, result.origin), t.width, texels, blended);
  result.texture.along = context.download(blended.x);
  result.texture.around = context.download(blended.y);
  result.texture.out = context.download(blended.z);
  return result;
}

}  // namespace skeletex
