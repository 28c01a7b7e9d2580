// SPDX-License-Identifier: MIT
#include "skeletex/edit/transfer/join_surface.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "skeletex/edit/morph/orientation.h"
#include "skeletex/edit/morph/seam_map.h"
#include "skeletex/geometry/best_rotation.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/skeleton/separation_planes.h"

namespace skeletex {
namespace {

constexpr double kTolerance = 1e-5;
constexpr int kPasses = 3;          // rotations depend on the surface that they move
constexpr double kLeast = 1e-6;     // of a value that falls by a factor of e over a third of the distance
constexpr double kSeamRange = 0.5;  // share of a bone over which its rotation becomes that of a seam

/// A place around a bone's end, and an offset there.
struct Gap {
  double turn;
  Vec3 gap;
};
/// Per bone and end, by growing turn.
using EndGaps = std::vector<std::array<std::vector<Gap>, 2>>;

/// The offset at an angle, linear between the nearest two.
Vec3 gap_at(const std::vector<Gap>& gaps, double turn) {
  const auto after =
      std::upper_bound(gaps.begin(), gaps.end(), turn, [](double t, const Gap& gap) { return t < gap.turn; });
  const Gap &next = after == gaps.end() ? gaps.front() : *after,
            &last = after == gaps.begin() ? gaps.back() : *(after - 1);
  const double step = next.turn - last.turn + (next.turn > last.turn ? 0 : 1),
               way = turn - last.turn + (turn >= last.turn ? 0 : 1);
  const double share = step > 0 ? way / step : 0;
  return (1 - share) * last.gap + share * next.gap;
}

/// The rotation from the source's surface to the placed one, as a whole.
Eigen::Quaterniond rotation_of(const PlacedPatch& patch) {
  const auto centred = [](const std::vector<Vec3>& points) {
    Vec3 sum = Vec3::Zero();
    for (const Vec3& p : points) sum += p / static_cast<double>(points.size());
    std::vector<Vec3> result;
    for (const Vec3& p : points) result.push_back(p - sum);
    return result;
  };
  return best_rotation(centred(patch.source), centred(patch.placed));
}

/// The normalized mean of two rotations.
Eigen::Quaterniond mix(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b, double share) {
  return Eigen::Quaterniond(Eigen::Vector4d((1 - share) * a.coeffs() + (a.dot(b) < 0 ? -share : share) * b.coeffs()))
      .normalized();
}

class Joining {
 public:
  Joining(ClContext& context, const SkeletexModel& target, const SkeletexModel& model,
          std::span<const PlacedPatch> patches, double distance)
      : context_(context),
        target_(target),
        model_(model),
        patches_(patches),
        distance_(distance),
        surface_(upload_surface(context, target)),
        laplace_(make_surface_operator(context, surface_.neighbours, surface_.points)),
        positions_(lattice_positions(context, model)),
        is_free_(positions_.size(), 0),
        is_in_part_(model.patches.size(), false),
        patch_of_(model.patches.size(), nullptr) {
    for (const PlacedPatch& patch : patches) patch_of_[patch.bone] = &patch, is_in_part_[patch.bone] = true;
    for_each_texel([&](const PlacedPatch& patch, VertexIndex vertex, int row, int j) {
      is_free_[vertex] = row >= patch.rows[j][0] && row <= patch.rows[j][1];
    });
    mark_ends(model, surface_.lattice, is_in_part_, is_free_);
  }

  SkeletexModel run() {
    close_gaps();
    const std::vector<OrientationSource> sources = orientation_sources();
    const std::vector<float> shares = shares_without_tips(model_, surface_.lattice);
    const auto free = context_.upload(is_free_);
    // The operator stays the target's, as a part may have triangles of any shape.
    std::vector<Vec3> moves(positions_.size(), Vec3::Zero());
    for (int pass = 0; pass < kPasses; ++pass) {
      for (std::size_t i = 0; i < moves.size(); ++i) positions_[i] += moves[i];
      surface_.positions = positions_;
      surface_.points = upload_points(context_, positions_, model_.origin, model_.diagonal);
      const OrientationPull pull = pull_orientations(context_, surface_, laplace_, sources, shares, distance_);
      moves = download_vectors(
          context_,
          solve_diffusion(context_, laplace_, static_cast<float>(distance_ * distance_), free, pull.b, kTolerance).x);
      for (Vec3& move : moves) move *= model_.diagonal;
    }
    return move_surface(context_, model_, surface_, laplace_, moves).model;
  }

 private:
  template <class Bones>
  bool is_inside(const Bones& bones) const {
    return std::all_of(bones.begin(), bones.end(), [&](BoneIndex bone) { return is_in_part_[bone]; });
  }
  /// Visits all inner texels of the part.
  template <class Visit>
  void for_each_texel(const Visit& visit) const {
    for (const PlacedPatch& patch : patches_) {
      const auto [x, y, width, height] = model_.patches[patch.bone].rectangle;
      for (int row = 1; row + 1 < height; ++row)
        for (int j = 0; j < width; ++j)
          visit(patch, surface_.lattice.first_inner[patch.bone] + (row - 1) * width + j, row, j);
    }
  }

  /// Sets the part's poles to the first and the last of its patches' points.
  void set_poles(std::vector<Vec3> PlacedPatch::*points, std::vector<Vec3>& positions) const {
    for (const PlacedPatch& patch : patches_)
      for (const int end : {0, 1})
        if (const int pole = surface_.lattice.poles[patch.bone][end]; pole >= 0)
          positions[pole] = end == 0 ? (patch.*points).front() : (patch.*points).back();
  }

  /// The value at an angle in the first or the last row of a patch.
  /// \param values  row by row, or of one row
  Vec3 end_value(const std::vector<Vec3>& values, BoneIndex bone, BoneEnd end, double turn) const {
    const std::size_t width = model_.patches[bone].rectangle.width,
                      first = end == BoneEnd::kHead ? 0 : values.size() - width;
    const double column = (turn - std::floor(turn)) * static_cast<double>(width), share = column - std::floor(column);
    const std::size_t left = static_cast<std::size_t>(column) % width;
    return (1 - share) * values[first + left] + share * values[first + (left + 1) % width];
  }

  /// Moves a seam vertex between bones of the part to the mean of their ends there, and appends each bone's gap to it.
  void place_seam_vertex(VertexIndex vertex, NodeIndex node, std::span<const BoneIndex> bones,
                         const SeparationPlanes& separation, EndGaps& gaps) {
    const Vec3 offset = positions_[vertex] - model_.skeleton.nodes[node].position;
    Vec3 mean = Vec3::Zero();
    std::vector<Vec3> ends;
    for (const BoneIndex bone : bones) {
      ends.push_back(end_value(patch_of_[bone]->placed, bone, end_at(model_.skeleton, bone, node),
                               separation.turn_of(bone, offset)));
      mean += ends.back() / static_cast<double>(bones.size());
    }
    for (std::size_t i = 0; i < bones.size(); ++i) {
      const double turn = separation.turn_of(bones[i], offset);
      gaps[bones[i]][static_cast<int>(end_at(model_.skeleton, bones[i], node))].push_back(
          {turn - std::floor(turn), mean - ends[i]});
    }
    positions_[vertex] = mean;
  }

  /// Places the seam vertices between bones of the part.
  /// \return the gaps of the bones to them
  EndGaps place_inner_seams(const SeparationPlanes& separation) {
    const Lattice& lattice = surface_.lattice;
    EndGaps gaps(model_.patches.size());
    for (std::size_t a = 0; a < model_.arcs.size(); ++a)
      if (const SeamArc& arc = model_.arcs[a]; is_inside(arc.bones))
        for (int i = 0; i < static_cast<int>(arc.samples.size()); ++i)
          place_seam_vertex(lattice.first_sample[a] + i, arc.node, arc.bones, separation, gaps);
    for (std::size_t c = 0; c < model_.corners.size(); ++c)
      if (const SeamCorner& corner = model_.corners[c]; is_inside(corner.bones))
        place_seam_vertex(lattice.first_corner + static_cast<int>(c), corner.node, corner.bones, separation, gaps);
    for (auto& ends : gaps)
      for (std::vector<Gap>& end : ends)
        std::sort(end.begin(), end.end(), [](const Gap& p, const Gap& q) { return p.turn < q.turn; });
    return gaps;
  }

  /// Gaps of the vertices where the part ends, 0 elsewhere; and where gaps are to be interpolated between them.
  struct VertexGaps {
    std::vector<Vec3> gaps;
    std::vector<float> is_between;
  };
  /// Moves the part's vertices to their places, and finds the gaps to the target and between the part's bones.
  VertexGaps place_part() {
    const SeparationPlanes separation(model_.skeleton);
    const EndGaps inner = place_inner_seams(separation);
    VertexGaps result{std::vector<Vec3>(positions_.size(), Vec3::Zero()), is_free_};
    set_poles(&PlacedPatch::placed, positions_);
    for_each_texel([&](const PlacedPatch& patch, VertexIndex vertex, int row, int j) {
      const int width = model_.patches[patch.bone].rectangle.width;
      if (is_free_[vertex] != 0) positions_[vertex] = patch.placed[static_cast<std::size_t>(row) * width + j];
      for (const int end : {0, 1}) {
        if (const std::vector<Gap>& own = inner[patch.bone][end]; !own.empty() && row == patch.rows[j][end])
          result.gaps[vertex] = gap_at(own, static_cast<double>(j) / width), result.is_between[vertex] = 0;
        else if (!patch.gaps[end].empty() && row == patch.rows[j][end] + (end == 0 ? -1 : 1))
          result.gaps[vertex] = patch.gaps[end][j];
      }
    });
    for (const PlacedPatch& patch : patches_)
      for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) {
        const std::vector<Vec3>& given = patch.gaps[static_cast<int>(end)];
        if (given.empty()) continue;
        for (const VertexIndex vertex : end_loop(model_, surface_.lattice, patch.bone, end))
          result.gaps[vertex] = end_value(
              given, patch.bone, BoneEnd::kHead,
              separation.turn_of(patch.bone, positions_[vertex] - end_position(model_.skeleton, patch.bone, end)));
      }
    return result;
  }

  /// Places the part, and moves it to the target and its bones to each other: the gaps are spread over the part.
  void close_gaps() {
    const auto [gaps, is_between] = place_part();
    const double range = distance_ / 2;
    const std::vector<Vec3> spread =
        download_vectors(context_, interpolate_field(context_, laplace_, range * range, is_between,
                                                     upload_points(context_, gaps, Vec3::Zero(), -model_.diagonal))
                                       .x);
    for (int i = 0; i < surface_.first_seam(); ++i)
      if (is_free_[i] != 0) positions_[i] += is_between[i] != 0 ? Vec3(model_.diagonal * spread[i]) : gaps[i];
  }

  /// The weights of the source's orientation: they grow with the distance over the surface from where the part begins,
  /// which follows from a screened Poisson equation (Varadhan 1967).
  std::vector<float> source_weights() const {
    std::vector<float> outside(positions_.size());
    for (std::size_t i = 0; i < outside.size(); ++i) outside[i] = is_free_[i] - 1;
    const double range = distance_ / 3;
    const std::vector<float> near = context_.download(
        interpolate_field(context_, laplace_, range * range, is_free_, {1, context_.upload(outside)}).x.values);
    std::vector<float> weights(positions_.size(), 0);
    for (std::size_t i = 0; i < weights.size(); ++i)
      if (is_free_[i] != 0)
        weights[i] = static_cast<float>(
            smooth_step(-range * std::log(std::clamp(static_cast<double>(near[i]), kLeast, 1.0)) / distance_));
    return weights;
  }

  /// The rotation from the source to the placed surface, per inner row of all patches.
  std::vector<Eigen::Quaternionf> row_rotations() const {
    std::vector<Eigen::Quaterniond> of_bones(model_.patches.size(), Eigen::Quaterniond::Identity());
    for (const PlacedPatch& patch : patches_) of_bones[patch.bone] = rotation_of(patch);
    const auto at_node = bones_at_nodes(model_.skeleton);
    const auto at_end = [&](BoneIndex bone, BoneEnd end) {
      const NodeIndex node = end_node(model_.skeleton, bone, end);
      Eigen::Vector4d sum = Eigen::Vector4d::Zero();
      for (const BoneAtNode other : at_node[node])
        if (patch_of_[other.bone])
          sum += (of_bones[bone].dot(of_bones[other.bone]) < 0 ? -1 : 1) * of_bones[other.bone].coeffs();
      return Eigen::Quaterniond(Eigen::Vector4d(sum.normalized()));
    };
    std::vector<Eigen::Quaternionf> rotations;
    for (BoneIndex bone = 0; bone < static_cast<int>(model_.patches.size()); ++bone) {
      const Patch& patch = model_.patches[bone];
      const std::array ends{at_end(bone, BoneEnd::kHead), at_end(bone, BoneEnd::kTail)};
      for (int row = 1; row + 1 < patch.rectangle.height; ++row) {
        const double u = patch.row_u[row];
        const Eigen::Quaterniond& nearer = u < 0.5 ? ends[0] : ends[1];
        rotations.push_back(
            mix(of_bones[bone], nearer, smooth_step(1 - std::min(u, 1 - u) / kSeamRange)).cast<float>());
      }
    }
    return rotations;
  }

  /// The places of the target's vertices on the source, where they are in the part.
  std::vector<Vec3> source_positions() const {
    const Lattice& lattice = surface_.lattice;
    std::vector<Vec3> points = surface_.positions;
    for_each_texel([&](const PlacedPatch& patch, VertexIndex vertex, int row, int j) {
      points[vertex] = patch.source[static_cast<std::size_t>(row) * model_.patches[patch.bone].rectangle.width + j];
    });
    set_poles(&PlacedPatch::source, points);
    const auto seam_point = [&](BoneIndex bone, NodeIndex node, double turn) {
      return end_value(patch_of_[bone]->source, bone, end_at(model_.skeleton, bone, node), turn);
    };
    for (std::size_t a = 0; a < model_.arcs.size(); ++a)
      if (const SeamArc& arc = model_.arcs[a]; is_inside(arc.bones))
        for (std::size_t i = 0; i < arc.samples.size(); ++i)
          points[lattice.first_sample[a] + i] = seam_point(arc.bones[0], arc.node, arc.samples[i].turn);
    for (std::size_t c = 0; c < model_.corners.size(); ++c)
      if (const SeamCorner& corner = model_.corners[c]; is_inside(corner.bones))
        points[lattice.first_corner + c] = seam_point(corner.bones[0], corner.node, corner.sample.turn);
    return points;
  }

  std::vector<OrientationSource> orientation_sources() const {
    std::vector<float> weights = source_weights(), rest;
    for (const float weight : weights) rest.push_back(1 - weight);
    const Vec3& centre = patches_[0].source[0];
    std::vector<OrientationSource> sources;
    sources.push_back({upload_points(context_, surface_.positions, target_.origin, target_.diagonal), std::move(rest),
                       std::vector<Eigen::Quaternionf>(surface_.neighbours.rows.size, Eigen::Quaternionf::Identity())});
    sources.push_back(
        {upload_points(context_, source_positions(), centre, target_.diagonal), std::move(weights), row_rotations()});
    return sources;
  }

  ClContext& context_;
  const SkeletexModel &target_, &model_;
  std::span<const PlacedPatch> patches_;
  double distance_;
  ModelSurface surface_;     ///< the target's, then the part's while it moves
  SurfaceOperator laplace_;  ///< of the target's surface
  std::vector<Vec3> positions_;
  std::vector<float> is_free_;    ///< per vertex: 1 in the part
  std::vector<bool> is_in_part_;  ///< per bone
  std::vector<const PlacedPatch*> patch_of_;
};

}  // namespace

SkeletexModel join_surface(ClContext& context, const SkeletexModel& target, const SkeletexModel& model,
                           std::span<const PlacedPatch> patches, double distance) {
  return Joining(context, target, model, patches, distance).run();
}

}  // namespace skeletex
