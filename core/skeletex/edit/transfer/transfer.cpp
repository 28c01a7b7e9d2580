// SPDX-License-Identifier: MIT
#include "skeletex/edit/transfer/transfer.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>

#include "skeletex/analysis/folds.h"
#include "skeletex/edit/morph/overlay.h"
#include "skeletex/edit/regular_grid.h"
#include "skeletex/edit/transfer/blend.h"
#include "skeletex/edit/transfer/join_surface.h"
#include "skeletex/edit/transfer/lay_part.h"
#include "skeletex/edit/transfer/part.h"
#include "skeletex/geometry/best_rotation.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex {
namespace {

constexpr std::array<BoneEnd, 2> kEnds{BoneEnd::kHead, BoneEnd::kTail};
constexpr double kMostLean = 0.5;    // a part leans by at most half of its length
constexpr double kSame = 0.01;       // of the girth
constexpr double kRootShare = 0.05;  // of a patch's rows that the target keeps where its limb has a root there
constexpr double kMostFolds = 2, kMoreFolds = 2e-3;  // times those without the join, and share of the part's points
constexpr double kJoinRadii = 1.0;    // of where a part begins: over so much of the surface it joins the body at least
constexpr double kMostRunBack = 0.5;  // share of the rows behind its cut that a column may leave out, too
constexpr double kMostCut = 0.85;     // share of a patch's rows that a cut may leave out
constexpr double kReach = 0.12;       // share of the rows before and behind that a turn is measured over
// What a cut costs in turns of the surface, in radians, and what it costs to run along the bone as far as around it.
constexpr double kCutCost = 0.15, kBend = 0.02;
// What a cut of the source costs that lies off the target's by the target's girth, and how far off counts.
constexpr double kMisfitCost = 0.15, kMostMisfit = 4;

int bone_by_name(const Skeleton& skeleton, const std::string& name, const char* which) {
  for (std::size_t i = 0; i < skeleton.bones.size(); ++i)
    if (skeleton.bones[i].name == name) return static_cast<int>(i);
  throw InputError(fmt::format("the {} has no bone \"{}\"", which, name));
}

/// A periodic row of values without its waves shorter than about an eighth of a turn.
void smooth_around(std::vector<double>& values) {
  const int count = static_cast<int>(values.size()), reach = std::max(1, count / 10);
  for (int pass = 0; pass < 2; ++pass) {
    std::vector<double> smooth(count);
    double sum = 0;
    for (int i = -reach; i <= reach; ++i) sum += values[(i + count) % count];
    for (int i = 0; i < count; ++i) {
      smooth[i] = sum / (2 * reach + 1);
      sum += values[(i + reach + 1) % count] - values[(i - reach + count) % count];
    }
    values = std::move(smooth);
  }
}

/// Points of a lattice's rows in the axes of their bones, on the host.
struct HostPoints {
  std::array<std::vector<float>, 3> planes;
  HostPoints(ClContext& context, const DevicePlanes& points) : planes(download_planes(context, points)) {}
  Vec3 at(std::size_t i) const { return {planes[0][i], planes[1][i], planes[2][i]}; }
};

/// Vertex of row 0, column 0 of every patch in the planes of points_in_bone_axes.
std::vector<std::size_t> first_points(const std::vector<Patch>& patches) {
  std::vector<std::size_t> first;
  std::size_t count = 0;
  for (const Patch& patch : patches) {
    first.push_back(count);
    count += static_cast<std::size_t>(patch.rectangle.width) * patch.rectangle.height;
  }
  return first;
}

/// One part of the source on one part of the target.
class PartTransfer {
 public:
  PartTransfer(const SkeletexModel& source, const SkeletexModel& target, Part from, Part to,
               const TransferOptions& options)
      : source_(source),
        target_(target),
        from_(faced_alike(source, target, std::move(from), to)),
        to_(std::move(to)),
        options_(options),
        overlay_(from_.model, to_.model.skeleton, matched(to_, from_)) {
    const SeparationPlanes separation(to_.model.skeleton);
    SeamNetwork network{to_.model.arcs, to_.model.corners, {}, to_.model.ends};
    for (const SeamCorner& corner : network.corners)
      network.directions.push_back(
          (separation.seam_point(corner.bones[0], end_at(to_.model.skeleton, corner.bones[0], corner.node),
                                 corner.sample.turn, 1) -
           to_.model.skeleton.nodes[corner.node].position)
              .normalized());
    overlay_.set_seams(separation, network);
    for (int i = 0; i < count(); ++i)
      for (const BoneEnd end : kEnds)
        if (is_free_end(target_, to_.bones[i], end) != is_free_end(source_, source_bone(i), overlay_.model_end(i, end)))
          throw InputError(
              fmt::format("of the bones \"{}\" and \"{}\" only one ends freely; choose bones that branch alike",
                          source_.skeleton.bones[source_bone(i)].name, target_.skeleton.bones[to_.bones[i]].name));
  }

  int count() const { return static_cast<int>(to_.bones.size()); }
  int target_bone(int i) const { return to_.bones[i]; }
  int source_bone(int i) const { return from_.bones[overlay_.model_bone(i)]; }
  const Overlay& overlay() const { return overlay_; }
  BoneEnd near() const { return to_.near; }

  /// Is there a seam that the target keeps?
  bool is_boundary(int i, BoneEnd end) const {
    return !is_free_end(target_, to_.bones[i], end) && to_.model.ends[i][static_cast<int>(end)].arcs.empty();
  }
  bool is_inner_seam(int i, BoneEnd end) const { return !to_.model.ends[i][static_cast<int>(end)].arcs.empty(); }

  double width_in_rows(int i) const {
    if (options_.width_in_texels > 0) return options_.width_in_texels;
    return (options_.width >= 0 ? options_.width
            : is_between()      ? 0.5
                                : 0.25) *
           (target_.patches[to_.bones[i]].rectangle.height - 1);
  }
  /// World units over the surface.
  double join_distance() const {
    const Rectangle& rectangle = target_.patches[to_.bones[0]].rectangle;
    const double width = width_in_rows(0) / (rectangle.height - 1) * bone_length(target_.skeleton, to_.bones[0]);
    const bool is_default = options_.width < 0 && !(options_.width_in_texels > 0);
    return is_default ? std::max(width, kJoinRadii * std::max(cut(BoneEnd::kHead).radius, cut(BoneEnd::kTail).radius))
                      : width;
  }
  bool is_between() const { return count() == 1 && is_boundary(0, BoneEnd::kHead) && is_boundary(0, BoneEnd::kTail); }
  bool is_scaled_by_girth() const {
    return options_.scale == TransferScale::kGirth || (options_.scale == TransferScale::kAuto && is_between());
  }

  /// Length of all bones of the part over the same in the source.
  double length_ratio() const {
    double here = 0, there = 0;
    for (int i = 0; i < count(); ++i) {
      here += bone_length(target_.skeleton, to_.bones[i]);
      there += bone_length(source_.skeleton, source_bone(i));
    }
    return here / there;
  }

  /// Where the part begins at an end of its first bone, by column of the target's patch.
  struct Cut {
    std::vector<double> kept_rows, skipped_rows;  ///< of the target's patch, of the source's; from that end
    double kept = 0, skipped = 0;                 ///< mean lengths along the bones
    double scale = 1;                             ///< of places across the bone
    double radius = 0;                            ///< of the target, there
  };
  Cut& cut(BoneEnd end) { return cuts_[static_cast<int>(end)]; }
  const Cut& cut(BoneEnd end) const { return cuts_[static_cast<int>(end)]; }
  double scale_at(BoneEnd end) const { return cut(end).scale; }
  /// Of places along a bone. A bone that ends freely goes as far as it does.
  double length_scale(int i) const {
    double here = bone_length(target_.skeleton, to_.bones[i]), there = bone_length(source_.skeleton, source_bone(i));
    for (const BoneEnd end : kEnds)
      if (i == 0 && !is_free_end(target_, to_.bones[i], opposite(end)))
        here -= cut(end).kept, there -= cut(end).skipped;
    return here / there;
  }
  /// Where the source's bone begins on the target's.
  double length_offset(int i) const {
    if (i > 0) return 0;
    const double scale = length_scale(i);
    if (!is_free_end(target_, to_.bones[i], BoneEnd::kHead))
      return cut(BoneEnd::kHead).kept - scale * cut(BoneEnd::kHead).skipped;
    const double here = bone_length(target_.skeleton, to_.bones[i]) - cut(BoneEnd::kTail).kept;
    return here - scale * (bone_length(source_.skeleton, source_bone(i)) - cut(BoneEnd::kTail).skipped);
  }

  /// Rows of the result's patch: the source's, unless the target keeps some of its own.
  void set_rows(int i, Patch& patch) const {
    if (is_height_field(patch.method)) patch.method = Method::kVsm;  // texels of two models lie on no common rays
    for (const BoneEnd end : kEnds)
      for (const double kept : cut(end).kept_rows)
        if (i == 0 && kept > 0) return;
    const Patch& from = source_.patches[source_bone(i)];
    const bool is_reversed = overlay_.is_reversed(i);
    for (int r = 1; r + 1 < patch.rectangle.height; ++r) {
      const double u = u_at_row(from, row_at_same_share(r, patch.rectangle.height, from.rectangle.height, is_reversed));
      patch.row_u[r] = is_reversed ? 1 - u : u;
    }
  }

  /// The seams inside of the part become the source's.
  void set_seams(SkeletexModel& result, const SeparationPlanes& separation) const {
    const auto read = [&](int node, const std::vector<int>& bones, SeamSample& sample) {
      const Vec3 direction = separation.seam_point(bones[0], end_at(target_.skeleton, bones[0], node), sample.turn, 1) -
                             target_.skeleton.nodes[node].position;
      sample.distance = seam_distance(separation, node, bones, direction);
    };
    for (SeamArc& arc : result.arcs)
      if (is_inside(arc.bones[0], arc.node))
        for (SeamSample& sample : arc.samples) read(arc.node, {arc.bones[0], arc.bones[1]}, sample);
    for (SeamCorner& corner : result.corners)
      if (is_inside(corner.bones[0], corner.node)) read(corner.node, corner.bones, corner.sample);
  }

  /// A separation plane inside of the part as the source has it and as the target does, per turn of the result. Shear:
  /// what a point at a distance of 1 (in the source's units) moves along the bone. Offset: from where the laid part has
  /// the seam to where the result has it, across the bone and along it.
  struct SeparationPlaneChange {
    double shear;
    double across, along;
  };
  double shear(const SeparationPlanes& source_separation, const SeparationPlanes& separation, int i, BoneEnd end,
               double turn) const {
    const double source_slope =
        source_separation.slope(source_bone(i), overlay_.model_end(i, end), overlay_.model_turn(i, end, turn));
    return scale_at(end) * separation.slope(to_.bones[i], end, turn) -
           length_scale(i) * source_slope * (overlay_.is_reversed(i) ? -1 : 1);
  }
  SeparationPlaneChange plane_change(const SeparationPlanes& source_separation, const SeparationPlanes& separation,
                                     int i, BoneEnd end, double turn) const {
    const int bone = to_.bones[i];
    const BoneEnd source_end = overlay_.model_end(i, end);
    const double source_turn = overlay_.model_turn(i, end, turn);
    const double own_slope = separation.slope(bone, end, turn);
    const double source_slope =
        source_separation.slope(source_bone(i), source_end, source_turn) * (overlay_.is_reversed(i) ? -1 : 1);
    const double scale = scale_at(end);
    const auto across = [&](double slope, double distance) {
      return (end == BoneEnd::kHead ? slope > 0 : slope < 0) ? distance : distance / std::hypot(1, slope);
    };
    const double laid = scale * across(source_slope, overlay_.seam_at(i, end, turn).distance);
    const Vec3 direction = separation.radial(bone, turn) + own_slope * separation.bases()[bone].o;
    const double wanted = across(own_slope, seam_distance(separation, end_node(target_.skeleton, bone, end),
                                                          {bone, separation.neighbour(bone, end, turn)}, direction));
    return {shear(source_separation, separation, i, end, turn), wanted - laid, (wanted - laid) * own_slope};
  }

 private:
  static Correspondence matched(const Part& to, const Part& from) {
    const auto name = [](const Part& part) { return part.model.skeleton.bones[0].name; };
    return find_correspondence(to.model.skeleton, from.model.skeleton,
                               {.given = {{kRestOfBody, kRestOfBody}, {name(to), name(from)}}});
  }
  /// Directions from where the two parts begin that shall agree: of the first bone, and of all nodes outside, where the
  /// whole skeletons correspond, else of what lies nearby and of the body's centre.
  static std::array<std::vector<Vec3>, 2> directions(const SkeletexModel& source, const SkeletexModel& target,
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
  /// Turned about the node where it begins so that its first bone and the rest of the body point as those of the other,
  /// as well as they can; then the rest so that posing the one as the other turns nothing about the bone. Angles about
  /// bones stay.
  static Part faced_alike(const SkeletexModel& source, const SkeletexModel& target, Part from, const Part& to) {
    const Vec3 origin = end_position(from.model.skeleton, 0, from.near);
    const auto [own, wanted] = directions(source, target, from, to);
    const Vec3 direction = own[0], target_direction = wanted[0];
    const Eigen::Quaterniond turn = best_rotation(own, wanted);
    for (Node& node : from.model.skeleton.nodes) node.position = origin + turn * (node.position - origin);
    for (Bone& bone : from.model.skeleton.bones)
      if (bone.s) bone.s = turn * *bone.s;
    const Eigen::Quaterniond bend = Eigen::Quaterniond::FromTwoVectors(target_direction, turn * direction);
    const Vec3 rest = to.model.skeleton.nodes.back().position - end_position(to.model.skeleton, 0, to.near);
    from.model.skeleton.nodes.back().position =
        origin + bone_length(from.model.skeleton, 0) * (bend * rest.normalized());
    return from;
  }
  int index_of(int target_bone) const {
    const auto found = std::find(to_.bones.begin(), to_.bones.end(), target_bone);
    return found == to_.bones.end() ? -1 : static_cast<int>(found - to_.bones.begin());
  }
  bool is_inside(int target_bone, int node) const {
    const int i = index_of(target_bone);
    return i >= 0 && is_inner_seam(i, end_at(target_.skeleton, target_bone, node));
  }
  /// The mean of what the bones that meet see.
  double seam_distance(const SeparationPlanes& separation, int node, const std::vector<int>& bones,
                       const Vec3& direction) const {
    double sum = 0;
    for (const int bone : bones)
      sum += overlay_.seam_at(index_of(bone), end_at(target_.skeleton, bone, node), separation.turn_of(bone, direction))
                 .distance;
    return scale_at(BoneEnd::kHead) * sum /
           static_cast<double>(bones.size());  // the same at both ends where there is such a seam
  }

  const SkeletexModel &source_, &target_;
  Part from_, to_;
  TransferOptions options_;
  Overlay overlay_;
  std::array<Cut, 2> cuts_;
};

/// All parts at once: one launch serves them.
class Laying {
 public:
  Laying(ClContext& context, const SkeletexModel& source, const SkeletexModel& target, const TransferOptions& options)
      : context_(context),
        source_(source),
        target_(target),
        options_(options),
        separation_(target.skeleton),
        source_separation_(source.skeleton),
        even_source_(regular_grid(context, source)),
        even_target_(regular_grid(context, target)),
        source_points_(points_in_bone_axes(context, even_source_)),
        target_points_(points_in_bone_axes(context, even_target_)),
        source_host_(context, source_points_),
        target_host_(context, target_points_),
        source_first_(first_points(source.patches)),
        target_first_(first_points(target.patches)),
        part_of_(target.patches.size(), {nullptr, 0}),
        gaps_(target.patches.size()) {}

  void add(PartTransfer& part) {
    for (int i = 0; i < part.count(); ++i) {
      auto& [owner, index] = part_of_[part.target_bone(i)];
      if (owner)
        throw InputError(fmt::format("bone \"{}\" of the target is replaced twice",
                                     target_.skeleton.bones[part.target_bone(i)].name));
      owner = &part;
      index = i;
    }
    for (const BoneEnd end : kEnds)
      part.cut(end).scale = options_.scale == TransferScale::kFactor ? options_.factor : part.length_ratio();
    for (const BoneEnd end : kEnds)
      if (part.is_boundary(0, end)) find_cut(part, end);
    if (!part.is_between()) {
      const BoneEnd end = part.is_boundary(0, BoneEnd::kTail) ? BoneEnd::kTail : BoneEnd::kHead;
      part.cut(opposite(end)).scale = part.cut(end).scale;
    }
  }

  SkeletexModel run(std::span<const std::unique_ptr<PartTransfer>> parts) {
    SkeletexModel result = target_;
    result.bone_weights.clear();  // they belong to the surface that is replaced in part
    for (const auto& part : parts) part->set_seams(result, separation_);
    for (std::size_t b = 0; b < part_of_.size(); ++b)
      if (part_of_[b].first) part_of_[b].first->set_rows(part_of_[b].second, result.patches[b]);
    frames_ = frame_tables(result.skeleton, separation_, result.patches, result.origin);
    fill_tables();
    skip_what_runs_back(lay());
    find_lean(lay());
    const HostPoints laid = lay();
    find_corrections(laid);
    const DevicePlanes points = lay_part(context_, tables_, frames_, source_points_, target_points_, point_count_);

    const DisplacementTexture& t = target_.texture;
    const DevicePlanes target = upload_texels(context_, t);
    DevicePlanes texels = upload_texels(context_, t);
    enter_tangent_space(context_, upload_tables(context_, frames_), context_.upload(tables_.rows), t.width, points,
                        texels);
    keep_target(context_, tables_, frames_, t.width, target, texels);
    download_texels(context_, texels, result.texture);
    if (options_.blend != TransferBlend::kCosine || !options_.is_smooth) return result;
    if (std::none_of(parts.begin(), parts.end(), [&](const auto& part) { return needs_join(*part); })) return result;
    const HostPoints read(context_, read_part(context_, tables_, frames_,
                                              row_points(context_, even_source_, RowChoice::kAll), point_count_));
    for (const auto& part : parts) {
      if (!needs_join(*part)) continue;
      SkeletexModel joined = join_surface(context_, even_target_, result, placed_patches(*part, laid, read),
                                          part->join_distance() / target_.diagonal);
      // Parts that bring a good deal of their body along may be too far from where they shall be to be bent there.
      if (folded_edges(joined) <= kMostFolds * folded_edges(result) + kMoreFolds * static_cast<double>(point_count_))
        result = std::move(joined);
    }
    return result;
  }

  TransferredPart report(const PartTransfer& part) const {
    const PartTransfer::Cut& cut = part.cut(part.near());
    const auto share = [](const std::vector<double>& rows, const Patch& patch) {
      double sum = 0;
      for (const double r : rows) sum += r / static_cast<double>(rows.size()) / (patch.rectangle.height - 1);
      return sum;
    };
    return {part.scale_at(part.near()), part.length_scale(0),
            share(cut.skipped_rows, source_.patches[part.source_bone(0)]),
            share(cut.kept_rows, target_.patches[part.target_bone(0)])};
  }

 private:
  double folded_edges(const SkeletexModel& model) const {
    return static_cast<double>(measure_folds(reconstruct_mesh(context_, model)).folded_edges);
  }
  /// Where a root lies in the first patch, the rows behind it are enough for the correction.
  bool needs_join(const PartTransfer& part) const { return !part.is_between() && report(part).kept <= kRootShare; }

  std::vector<PlacedPatch> placed_patches(const PartTransfer& part, const HostPoints& laid,
                                          const HostPoints& read) const {
    std::vector<PlacedPatch> patches(part.count());
    for (int i = 0; i < part.count(); ++i) {
      PlacedPatch& patch = patches[i];
      patch.bone = part.target_bone(i);
      const auto [x, y, width, height] = target_.patches[patch.bone].rectangle;
      const BoneBasis& basis = separation_.bases()[patch.bone];
      const auto in_world = [&](const Vec3& p) { return Vec3(p.x() * basis.s + p.y() * basis.b + p.z() * basis.o); };
      const Vec3 head = end_position(target_.skeleton, patch.bone, BoneEnd::kHead);
      for (std::size_t k = 0; k < static_cast<std::size_t>(width) * height; ++k) {
        patch.placed.push_back(head + in_world(laid.at(result_first_[patch.bone] + k)));
        patch.source.push_back(read.at(result_first_[patch.bone] + k));
      }
      for (int j = 0; j < width; ++j) {
        const LaidColumn& column = tables_.columns[tables_.patches[patch.bone].column_begin + j];
        patch.rows.push_back({std::max(1, static_cast<int>(std::floor(column.first_row)) + 1),
                              std::min(height - 2, static_cast<int>(std::ceil(column.last_row)) - 1)});
      }
      for (const BoneEnd end : kEnds)
        for (const Vec3& gap : gaps_[patch.bone][static_cast<int>(end)])
          patch.gaps[static_cast<int>(end)].push_back(in_world(gap));
    }
    return patches;
  }

  HostPoints lay() {
    return HostPoints(context_, lay_part(context_, tables_, frames_, source_points_, target_points_, point_count_));
  }
  /// A point at a column, as its parts along s', o x s' and o.
  static Vec3 about_bone(const Vec3& point, int column, int width) {
    const double angle = 2 * std::numbers::pi * column / width, c = std::cos(angle), s = std::sin(angle);
    return {c * point.x() + s * point.y(), c * point.y() - s * point.x(), point.z()};
  }

  template <class Visit>
  void for_each_bone(const Visit& visit) {
    for (int bone = 0; bone < static_cast<int>(part_of_.size()); ++bone)
      if (part_of_[bone].first) visit(bone, *part_of_[bone].first, part_of_[bone].second);
  }

  /// A column of a patch from one end on: by row, its points as parts along s', o x s' and o (from that end's node).
  static std::vector<Vec3> profile(const HostPoints& points, std::size_t first, const Rectangle& rectangle, int column,
                                   BoneEnd end, double length) {
    std::vector<Vec3> result;
    for (int r = 0; r < rectangle.height; ++r) {
      const int row = end == BoneEnd::kHead ? r : rectangle.height - 1 - r;
      Vec3 p = about_bone(points.at(first + static_cast<std::size_t>(row) * rectangle.width + column), column,
                          rectangle.width);
      if (end == BoneEnd::kTail) p.z() = length - p.z();
      result.push_back(p);
    }
    return result;
  }

  /// Where a patch leaves the body and becomes the limb, by column: along the deepest valley around it (the minima
  /// rule, by which people part shapes). The closed curve of rows with the most concave turn, least length and least
  /// left out. \param wanted  places that the curve should be near to, across the bone; none if empty
  static std::vector<double> root_rows(const std::vector<std::vector<Vec3>>& columns,
                                       const std::vector<Eigen::Vector2d>& wanted) {
    const int width = static_cast<int>(columns.size()), last = static_cast<int>(columns[0].size()) - 1;
    const int column_step = std::max(1, width / 64), around = width / column_step;
    const double row_step = std::max(1.0, last / 64.0), reach = std::max(1.5, kReach * last);
    const int levels = static_cast<int>(kMostCut * last / row_step);
    std::vector<double> costs(static_cast<std::size_t>(around) * levels, 0);
    double girth2 = 0;
    for (const Eigen::Vector2d& place : wanted) girth2 += place.squaredNorm() / static_cast<double>(wanted.size());
    for (int k = 0; k < around; ++k)
      for (int level = 0; level < levels; ++level) {
        const std::vector<Vec3>& column = columns[k * column_step];
        const double row = level * row_step;
        double& cost = costs[static_cast<std::size_t>(k) * levels + level];
        if (girth2 > 0)
          cost +=
              kMisfitCost *
              std::min(kMostMisfit, (at_row(column, row).head<2>() - wanted[k * column_step]).squaredNorm() / girth2);
        if (level == 0) continue;
        const Vec3 before = at_row(column, row) - at_row(column, std::max(0.0, row - reach)),
                   after = at_row(column, row + reach) - at_row(column, row);
        const double turn = std::atan2(after.z() * -before.x() + after.x() * before.z(),
                                       before.x() * after.x() + before.z() * after.z());
        const double share = std::min(1.0, row / reach);  // near the end there is not much to see
        cost += kCutCost * (1 + row / last) - share * turn;
      }
    // Three times round; the middle one knows no beginning.
    const int steps = 3 * around;
    std::vector<double> best(costs.begin(), costs.begin() + levels);
    std::vector<int> from(static_cast<std::size_t>(steps) * levels, 0);
    for (int k = 1; k < steps; ++k) {
      std::vector<double> next(levels);
      for (int to = 0; to < levels; ++to) {
        double least = std::numeric_limits<double>::infinity();
        for (int level = 0; level < levels; ++level) {
          const double cost = best[level] + kBend * (to - level) * (to - level);
          if (cost < least) least = cost, from[static_cast<std::size_t>(k) * levels + to] = level;
        }
        next[to] = least + costs[static_cast<std::size_t>(k % around) * levels + to];
      }
      best = std::move(next);
    }
    int level = static_cast<int>(std::min_element(best.begin(), best.end()) - best.begin());
    std::vector<double> sampled(around);
    for (int k = steps - 1; k >= around; --k) {
      if (k < 2 * around) sampled[k - around] = level * row_step;
      level = from[static_cast<std::size_t>(k) * levels + level];
    }
    std::vector<double> rows(width);
    for (int j = 0; j < width; ++j) {
      const double at = static_cast<double>(j) / width * around;
      const int k = static_cast<int>(at);
      rows[j] = (1 - (at - k)) * sampled[k % around] + (at - k) * sampled[(k + 1) % around];
    }
    smooth_around(rows);
    return rows;
  }

  static Vec3 at_row(const std::vector<Vec3>& column, double row) {
    const int below = std::clamp(static_cast<int>(row), 0, static_cast<int>(column.size()) - 2);
    const double share = std::clamp(row - below, 0.0, 1.0);
    return (1 - share) * column[below] + share * column[below + 1];
  }

  /// Where the part leaves the body, on both sides, and what it is scaled by.
  void find_cut(PartTransfer& part, BoneEnd end) {
    const int bone = part.target_bone(0), from = part.source_bone(0);
    const Rectangle &here = target_.patches[bone].rectangle, &there = source_.patches[from].rectangle;
    const BoneEnd source_end = part.overlay().model_end(0, end);
    const double length = bone_length(target_.skeleton, bone), source_length = bone_length(source_.skeleton, from);
    std::vector<std::vector<Vec3>> columns, source_columns;
    for (int j = 0; j < here.width; ++j) {
      columns.push_back(profile(target_host_, target_first_[bone], here, j, end, length));
      const double turn = part.overlay().model_turn(0, end, static_cast<double>(j) / here.width);
      const int column = static_cast<int>(std::lround((turn - std::floor(turn)) * there.width)) % there.width;
      source_columns.push_back(profile(source_host_, source_first_[from], there, column, source_end, source_length));
    }
    PartTransfer::Cut& cut = part.cut(end);
    const auto rows = [&](const std::vector<std::vector<Vec3>>& all, double given, int height,
                          const std::vector<Eigen::Vector2d>& wanted) {
      std::vector<double> result(here.width, std::max(0.0, given) * (height - 1));
      if (given >= 0 || options_.blend == TransferBlend::kNone || part.is_between()) return result;
      return root_rows(all, wanted);
    };
    cut.kept_rows = rows(columns, options_.keep, here.height, {});
    std::vector<Eigen::Vector2d> wanted;
    if (!part.is_scaled_by_girth())
      for (int j = 0; j < here.width; ++j) wanted.push_back(at_row(columns[j], cut.kept_rows[j]).head<2>() / cut.scale);
    cut.skipped_rows = rows(source_columns, options_.skip, there.height, wanted);
    // Where the two are the same already, so is the cut.
    const double source_step = static_cast<double>(there.height - 1) / (here.height - 1);
    if (options_.skip < 0 && options_.keep < 0) {
      double gap = 0, size = 0;
      for (int j = 0; j < here.width; ++j) {
        const Vec3 p = at_row(columns[j], cut.kept_rows[j]),
                   q = at_row(source_columns[j], source_step * cut.kept_rows[j]);
        gap += (p - Vec3(cut.scale * q.x(), cut.scale * q.y(), part.length_ratio() * q.z())).norm();
        size += p.head<2>().norm();
      }
      if (gap < kSame * size)
        for (int j = 0; j < here.width; ++j) cut.skipped_rows[j] = source_step * cut.kept_rows[j];
    }
    const double width = part.width_in_rows(0), source_rows = static_cast<double>(there.height - 1) / (here.height - 1);
    double girth = 0, source_girth = 0;
    for (int j = 0; j < here.width; ++j) {
      // Where nothing is left out, a part goes from node to node.
      if (cut.kept_rows[j] > 0 || cut.skipped_rows[j] > 0) {
        cut.kept += at_row(columns[j], cut.kept_rows[j]).z() / here.width;
        cut.skipped += at_row(source_columns[j], cut.skipped_rows[j]).z() / here.width;
      }
      cut.radius += at_row(columns[j], cut.kept_rows[j]).head<2>().norm() / here.width;
      girth += at_row(columns[j], std::min(cut.kept_rows[j] + width, 0.9 * here.height)).head<2>().norm();
      source_girth += at_row(source_columns[j], std::min(cut.skipped_rows[j] + width * source_rows, 0.9 * there.height))
                          .head<2>()
                          .norm();
    }
    if (part.is_scaled_by_girth())
      cut.scale = girth / source_girth;
    else if (options_.scale == TransferScale::kAuto)
      cut.scale = std::sqrt(cut.scale * girth / source_girth);
  }

  void fill_tables() {
    tables_.patches.resize(part_of_.size());
    result_first_.resize(part_of_.size());
    for_each_bone([&](int bone, const PartTransfer& part, int i) {
      const Rectangle& from = source_.patches[part.source_bone(i)].rectangle;
      const auto [x, y, width, height] = target_.patches[bone].rectangle;
      LaidPatch& patch = tables_.patches[bone];
      patch = {
          static_cast<int>(source_first_[part.source_bone(i)]),
          from.width,
          from.height,
          static_cast<int>(tables_.columns.size()),
          part.overlay().is_reversed(i) ? -1.0f : 1.0f,
          static_cast<float>(bone_length(source_.skeleton, part.source_bone(i))),
          static_cast<float>(part.length_scale(i)),
          static_cast<float>(part.length_offset(i)),
          0,
          0,
          0,
          0,
          0,
          options_.blend == TransferBlend::kLinear,
          part.is_between() && options_.blend != TransferBlend::kNone ? static_cast<int>(target_first_[bone]) : -1};
      const auto fade_width = [&](BoneEnd end) {
        if (part.is_inner_seam(i, end)) return 0.5 * (height - 1);
        return options_.blend == TransferBlend::kNone || !part.is_boundary(i, end) ? 0.0 : part.width_in_rows(i);
      };
      patch.head_width = static_cast<float>(fade_width(BoneEnd::kHead));
      patch.tail_width = static_cast<float>(fade_width(BoneEnd::kTail));
      std::vector<float> head_columns, tail_columns;
      append_columns(part.overlay(), i, width, head_columns, tail_columns);
      for (int j = 0; j < width; ++j) {
        const auto shear = [&](BoneEnd end) {
          // Between two seams that are kept a part follows their separation planes, too.
          if (!part.is_inner_seam(i, end) && !part.is_between()) return 0.0f;
          return static_cast<float>(
              part.shear(source_separation_, separation_, i, end, static_cast<double>(j) / width));
        };
        tables_.columns.push_back(
            {head_columns[j], tail_columns[j], shear(BoneEnd::kHead), shear(BoneEnd::kTail), 0, 0, 0, 0});
        set_rows(part, i, bone, j);
      }
      result_first_[bone] = point_count_;
      for (int row = 0; row < height; ++row) {
        tables_.rows.push_back({bone, row, static_cast<int>(point_count_), 0});
        point_count_ += width;
        const double share = static_cast<double>(row) / (height - 1);
        tables_.laid_rows.push_back(
            {frames_.rows[frames_.patches[bone].row_begin + row].axial,
             static_cast<float>((1 - share) * part.scale_at(BoneEnd::kHead) + share * part.scale_at(BoneEnd::kTail))});
      }
    });
    tables_.corrections.assign(tables_.correction_size(), 0);
  }

  /// Rows of one column: the source's from cut to cut.
  void set_rows(const PartTransfer& part, int i, int bone, int j) {
    LaidColumn& column = tables_.columns[tables_.patches[bone].column_begin + j];
    double first = 0, last = target_.patches[bone].rectangle.height - 1, source_first = 0,
           source_last = tables_.patches[bone].height - 1;
    if (part.is_boundary(i, BoneEnd::kHead))
      first += part.cut(BoneEnd::kHead).kept_rows[j], source_first += part.cut(BoneEnd::kHead).skipped_rows[j];
    if (part.is_boundary(i, BoneEnd::kTail))
      last -= part.cut(BoneEnd::kTail).kept_rows[j], source_last -= part.cut(BoneEnd::kTail).skipped_rows[j];
    const double step = (source_last - source_first) / (last - first);
    column.row_begin = static_cast<float>(source_first - step * first);
    column.row_step = static_cast<float>(step);
    column.first_row = static_cast<float>(part.is_boundary(i, BoneEnd::kHead) ? first : -1);
    column.last_row = static_cast<float>(part.is_boundary(i, BoneEnd::kTail) ? last : last + 1);
  }

  /// Where the target's edge lies further along the bone than the part's, a surface that begins there would have to run
  /// back. There the part begins later.
  void skip_what_runs_back(const HostPoints& laid) {
    if (options_.blend == TransferBlend::kNone || options_.skip >= 0) return;
    for_each_bone([&](int bone, PartTransfer& part, int i) {
      const Rectangle& rectangle = target_.patches[bone].rectangle;
      const double length = bone_length(target_.skeleton, bone);
      for (const BoneEnd end : kEnds) {
        if (!part.is_boundary(i, end) || part.is_between()) continue;
        PartTransfer::Cut& cut = part.cut(end);
        std::vector<double> more(rectangle.width);
        for (int j = 0; j < rectangle.width; ++j) {
          const std::vector<Vec3> column = profile(laid, result_first_[bone], rectangle, j, end, length);
          const double limit =
              at_row(profile(target_host_, target_first_[bone], rectangle, j, end, length), cut.kept_rows[j]).z() -
              1e-5 * target_.diagonal;
          const double most = cut.kept_rows[j] + kMostRunBack * (rectangle.height - 1 - cut.kept_rows[j]);
          double row = cut.kept_rows[j];
          while (row < most && at_row(column, row).z() < limit) row += 0.5;
          more[j] =
              std::abs(tables_.columns[tables_.patches[bone].column_begin + j].row_step) * (row - cut.kept_rows[j]);
        }
        smooth_around(more);
        for (int j = 0; j < rectangle.width; ++j) cut.skipped_rows[j] += more[j];
      }
      for (int j = 0; j < rectangle.width; ++j) set_rows(part, i, bone, j);
    });
  }

  /// Where a part's edge lies beside the target's as a whole, the part leans, so that its far end stays.
  void find_lean(const HostPoints& laid) {
    if (options_.blend == TransferBlend::kNone) return;
    for_each_bone([&](int bone, const PartTransfer& part, int i) {
      if (part.is_boundary(i, BoneEnd::kHead) == part.is_boundary(i, BoneEnd::kTail)) return;
      const BoneEnd end = part.is_boundary(i, BoneEnd::kHead) ? BoneEnd::kHead : BoneEnd::kTail;
      const Rectangle& rectangle = target_.patches[bone].rectangle;
      Vec3 edge = Vec3::Zero(), target_edge = Vec3::Zero(), far = Vec3::Zero();
      for (int j = 0; j < rectangle.width; ++j) {
        const double row = part.cut(end).kept_rows[j];
        const auto add = [&](Vec3& sum, const HostPoints& points, std::size_t first, double at) {
          sum += about_bone(at_row(profile(points, first, rectangle, j, end, 0), at), -j, rectangle.width) /
                 rectangle.width;
        };
        add(edge, laid, result_first_[bone], row);
        add(target_edge, target_host_, target_first_[bone], row);
        add(far, laid, result_first_[bone], rectangle.height - 1);
      }
      const double sign = end == BoneEnd::kHead ? 1 : -1;
      LaidPatch& patch = tables_.patches[bone];
      patch.lean_end = static_cast<float>(sign * far.z());
      const Vec3 lean = (target_edge - edge) / (sign * std::max(std::abs(far.z() - edge.z()), 1e-3 * target_.diagonal));
      const double share = std::min(1.0, kMostLean / std::max(lean.head<2>().norm(), 1e-30));
      patch.lean_s = static_cast<float>(share * lean.x());
      patch.lean_b = static_cast<float>(share * lean.y());
    });
  }

  void find_corrections(const HostPoints& laid) {
    for_each_bone([&](int bone, const PartTransfer& part, int i) {
      const Rectangle& rectangle = target_.patches[bone].rectangle;
      const int width = rectangle.width;
      for (const BoneEnd end : kEnds) {
        std::array<std::vector<double>, 3> offsets, slopes;
        for (int axis = 0; axis < 3; ++axis) offsets[axis].assign(width, 0), slopes[axis].assign(width, 0);
        for (int j = 0; j < width; ++j) {
          if (part.is_boundary(i, end)) {
            const std::vector<Vec3> to = profile(target_host_, target_first_[bone], rectangle, j, end, 0),
                                    from = profile(laid, result_first_[bone], rectangle, j, end, 0);
            const double kept = part.cut(end).kept_rows[j], reach = std::max(1.0, part.width_in_rows(i) / 6),
                         back = std::min(kept, reach / 2);
            const auto change = [&](double row) {
              Vec3 d = at_row(to, row) - at_row(from, row);
              if (end == BoneEnd::kTail) d.z() = -d.z();
              return d;
            };
            const Vec3 offset = change(kept), slope = (change(kept + reach - back) - change(kept - back)) / reach;
            for (int axis = 0; axis < 3; ++axis) offsets[axis][j] = offset[axis], slopes[axis][j] = slope[axis];
          } else if (part.is_inner_seam(i, end)) {
            const PartTransfer::SeparationPlaneChange change =
                part.plane_change(source_separation_, separation_, i, end, static_cast<double>(j) / width);
            offsets[0][j] = change.across;
            offsets[2][j] = change.along;
          }
        }
        if (part.is_boundary(i, end))
          for (int j = 0; j < width; ++j)
            gaps_[bone][static_cast<int>(end)].push_back(
                about_bone({offsets[0][j], offsets[1][j], offsets[2][j]}, -j, width));
        store_corrections(bone, end, offsets, false);
        store_corrections(bone, end, slopes, true);
      }
    });
  }

  void store_corrections(int bone, BoneEnd end, const std::array<std::vector<double>, 3>& values, bool is_slope) {
    const int width = static_cast<int>(values[0].size());
    const std::array bands{wave_bands(values[0]), wave_bands(values[1]), wave_bands(values[2])};
    for (int band = 0; band < SKELETEX_TRANSFER_BANDS; ++band)
      for (int j = 0; j < width; ++j) {
        const Vec3 back = about_bone({bands[0][band][j], bands[1][band][j], bands[2][band][j]}, -j, width);
        for (int axis = 0; axis < 3; ++axis)
          tables_.correction(end, band, is_slope, axis,
                             static_cast<std::size_t>(tables_.patches[bone].column_begin + j)) =
              static_cast<float>(back[axis]);
      }
  }

  ClContext& context_;
  const SkeletexModel &source_, &target_;
  TransferOptions options_;
  SeparationPlanes separation_, source_separation_;
  SkeletexModel even_source_, even_target_;  ///< what is mixed: see even_lattice
  DevicePlanes source_points_, target_points_;
  HostPoints source_host_, target_host_;
  std::vector<std::size_t> source_first_, target_first_, result_first_;
  std::vector<std::pair<PartTransfer*, int>>
      part_of_;  ///< per bone of the target: who replaces it, and which of its bones it is
  std::vector<std::array<std::vector<Vec3>, 2>>
      gaps_;  ///< per bone of the target and end, by column: what its part misses there, in bone axes
  FrameTables frames_;
  LaidTables tables_;
  std::size_t point_count_ = 0;
};

}  // namespace

SkeletexModel transfer(ClContext& context, const SkeletexModel& source, const SkeletexModel& target,
                       const std::vector<std::pair<std::string, std::string>>& bones, const TransferOptions& options,
                       std::vector<TransferredPart>* report) {
  if (bones.empty()) throw InputError("there are no bones to transfer");
  if (!std::isfinite(options.width) || !(options.width_in_texels >= 0))
    throw InputError("the width of a blend is 0 or more");
  if (options.scale == TransferScale::kFactor && !(options.factor > 0)) throw InputError("a scale is above 0");
  if (options.keep > 0.9 || options.skip > 0.9)
    throw InputError("the shares of rows that are kept and skipped are 0.9 at most");
  std::vector<std::unique_ptr<PartTransfer>> parts;
  Laying laying(context, source, target, options);
  for (const auto& [from, to] : bones) {
    const int a = bone_by_name(source.skeleton, from, "source"), b = bone_by_name(target.skeleton, to, "target");
    const auto chosen = [&](const SkeletexModel& model, int bone) {
      return options.has_limbs ? limb_of(model, bone) : std::vector<int>{bone};
    };
    parts.push_back(std::make_unique<PartTransfer>(source, target, cut_out(source, chosen(source, a)),
                                                   cut_out(target, chosen(target, b)), options));
    laying.add(*parts.back());
  }
  SkeletexModel result = laying.run(parts);
  if (report) {
    report->clear();
    for (const auto& part : parts) report->push_back(laying.report(*part));
  }
  return result;
}

}  // namespace skeletex
