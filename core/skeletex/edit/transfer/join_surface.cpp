// SPDX-License-Identifier: MIT
#include "skeletex/edit/transfer/join_surface.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "skeletex/edit/morph/orientation.h"
#include "skeletex/edit/transfer/part.h"
#include "skeletex/geometry/best_rotation.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/skeleton/separation_planes.h"

namespace skeletex {
namespace {

constexpr double kTolerance = 1e-5, kFillTolerance = 1e-3;
constexpr int kPasses = 3;          // rotations are found on a surface that is still to move
constexpr double kLeast = 1e-6;     // of a value that falls by e over a third of the distance
constexpr double kSeamReach = 0.5;  // share of a bone over which its rotation goes over into that of a seam

double smooth_step(double x) {
  x = std::clamp(x, 0.0, 1.0);
  return x * x * (3 - 2 * x);
}

/// Solves (M + time L) x = 0 where is_free is 1, with x given elsewhere.
/// \param negated  -x where it is given, 0 where it is free   \return x where it is free, 0 elsewhere
DeviceField fill_in(ClContext& context, const SurfaceOperator& laplace, double time, const std::vector<float>& is_free,
                    const DeviceField& negated) {
  const auto device_free = context.upload(is_free);
  const SolveResult solved = solve_diffusion(
      context, laplace, static_cast<float>(time), device_free,
      apply_operator(context, laplace, 1, static_cast<float>(time), device_free, negated), kFillTolerance);
  return solved.x;
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
        home_(upload_surface(context, target)),
        home_laplace_(make_surface_operator(context, home_.neighbours, home_.points)),
        positions_(lattice_positions(context, model)),
        is_free_(positions_.size(), 0),
        patch_of_(model.patches.size(), nullptr) {
    for (const PlacedPatch& patch : patches) patch_of_[patch.bone] = &patch;
    for_each_texel([&](const PlacedPatch& patch, int vertex, int row, int j) {
      is_free_[vertex] = row >= patch.rows[j][0] && row <= patch.rows[j][1];
    });
    const Lattice& lattice = home_.lattice;
    for (const PlacedPatch& patch : patches)
      for (const int pole : lattice.poles[patch.bone])
        if (pole >= 0) is_free_[pole] = 1;
    for (std::size_t a = 0; a < model.arcs.size(); ++a)
      if (is_inside(model.arcs[a].bones))
        std::fill_n(is_free_.begin() + lattice.first_sample[a], model.arcs[a].samples.size(), 1.f);
    for (std::size_t c = 0; c < model.corners.size(); ++c)
      if (is_inside(model.corners[c].bones)) is_free_[lattice.first_corner + c] = 1;
  }

  SkeletexModel run() {
    close_gaps();
    const std::vector<OrientationSource> sources = orientation_sources();
    const std::vector<float> shares = shares_without_tips(model_, home_.lattice);
    const auto free = context_.upload(is_free_);
    ModelSurface& surface =
        home_;  // elsewhere: weights of the edges stay the target's, for parts may come with triangles of any shape
    std::vector<Vec3> moves(positions_.size(), Vec3::Zero());
    for (int pass = 0; pass < kPasses; ++pass) {
      for (std::size_t i = 0; i < moves.size(); ++i) positions_[i] += moves[i];
      surface.positions = positions_;
      surface.points = upload_points(context_, positions_, model_.origin, model_.diagonal);
      const OrientationPull pull = pull_orientations(context_, surface, home_laplace_, sources, shares, distance_);
      moves = download_vectors(
          context_,
          solve_diffusion(context_, home_laplace_, static_cast<float>(distance_ * distance_), free, pull.b, kTolerance)
              .x);
      for (Vec3& move : moves) move *= model_.diagonal;
    }
    return move_surface(context_, model_, surface, home_laplace_, moves).model;
  }

 private:
  template <class Bones>
  bool is_inside(const Bones& bones) const {
    return std::all_of(bones.begin(), bones.end(), [&](int bone) { return patch_of_[bone] != nullptr; });
  }
  template <class Visit>
  void for_each_texel(const Visit& visit) const {
    for (const PlacedPatch& patch : patches_) {
      const auto [x, y, width, height] = model_.patches[patch.bone].rectangle;
      for (int row = 1; row + 1 < height; ++row)
        for (int j = 0; j < width; ++j)
          visit(patch, home_.lattice.first_inner[patch.bone] + (row - 1) * width + j, row, j);
    }
  }

  /// A point of a bone's placed surface or of its source where it ends.
  Vec3 end_point(const std::vector<Vec3>& points, int bone, BoneEnd end, double turn) const {
    const std::size_t width = model_.patches[bone].rectangle.width,
                      first = end == BoneEnd::kHead ? 0 : points.size() - width;
    const double column = (turn - std::floor(turn)) * static_cast<double>(width), share = column - std::floor(column);
    const std::size_t left = static_cast<std::size_t>(column) % width;
    return (1 - share) * points[first + left] + share * points[first + (left + 1) % width];
  }

  struct Gap {
    double turn;
    Vec3 gap;
  };
  using EndGaps = std::vector<std::array<std::vector<Gap>, 2>>;

  /// Puts a seam vertex between bones of the part at the mean of where they end, and notes what each of them misses.
  void place_seam_vertex(int vertex, int node, std::span<const int> bones, const SeparationPlanes& separation,
                         EndGaps& gaps) {
    const Vec3 offset = positions_[vertex] - model_.skeleton.nodes[node].position;
    Vec3 mean = Vec3::Zero();
    std::vector<Vec3> ends;
    for (const int bone : bones) {
      ends.push_back(end_point(patch_of_[bone]->placed, bone, end_at(model_.skeleton, bone, node),
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

  static Vec3 gap_at(const std::vector<Gap>& gaps, double turn) {
    const auto after =
        std::upper_bound(gaps.begin(), gaps.end(), turn, [](double t, const Gap& gap) { return t < gap.turn; });
    const Gap &next = after == gaps.end() ? gaps.front() : *after,
              &last = after == gaps.begin() ? gaps.back() : *(after - 1);
    const double step = next.turn - last.turn + (next.turn > last.turn ? 0 : 1),
                 way = turn - last.turn + (turn >= last.turn ? 0 : 1);
    const double share = step > 0 ? way / step : 0;
    return (1 - share) * last.gap + share * next.gap;
  }

  /// The part as it is placed, moved over to the target and its own seams together.
  void close_gaps() {
    const SeparationPlanes separation(model_.skeleton);
    const Lattice& lattice = home_.lattice;
    EndGaps inner(model_.patches.size());
    for (std::size_t a = 0; a < model_.arcs.size(); ++a)
      if (const SeamArc& arc = model_.arcs[a]; is_inside(arc.bones))
        for (int i = 0; i < static_cast<int>(arc.samples.size()); ++i)
          place_seam_vertex(lattice.first_sample[a] + i, arc.node, arc.bones, separation, inner);
    for (std::size_t c = 0; c < model_.corners.size(); ++c)
      if (const SeamCorner& corner = model_.corners[c]; is_inside(corner.bones))
        place_seam_vertex(lattice.first_corner + static_cast<int>(c), corner.node, corner.bones, separation, inner);
    for (auto& ends : inner)
      for (std::vector<Gap>& gaps : ends)
        std::sort(gaps.begin(), gaps.end(), [](const Gap& p, const Gap& q) { return p.turn < q.turn; });

    std::vector<float> is_between = is_free_;
    std::vector<Vec3> gaps(positions_.size(), Vec3::Zero());
    for_each_texel([&](const PlacedPatch& patch, int vertex, int row, int j) {
      const int width = model_.patches[patch.bone].rectangle.width;
      if (is_free_[vertex] != 0) positions_[vertex] = patch.placed[static_cast<std::size_t>(row) * width + j];
      for (const int end : {0, 1}) {
        if (const std::vector<Gap>& own = inner[patch.bone][end]; !own.empty() && row == patch.rows[j][end])
          gaps[vertex] = gap_at(own, static_cast<double>(j) / width), is_between[vertex] = 0;
        else if (!patch.gaps[end].empty() && row == patch.rows[j][end] + (end == 0 ? -1 : 1))
          gaps[vertex] = patch.gaps[end][j];
      }
    });
    for (const PlacedPatch& patch : patches_)
      for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) {
        const std::vector<Vec3>& given = patch.gaps[static_cast<int>(end)];
        if (given.empty()) continue;
        for (const int vertex : end_loop(model_, lattice, patch.bone, end))
          gaps[vertex] = end_point(
              given, patch.bone, BoneEnd::kHead,
              separation.turn_of(patch.bone, positions_[vertex] - end_position(model_.skeleton, patch.bone, end)));
      }
    for (const PlacedPatch& patch : patches_)
      for (const int end : {0, 1})
        if (const int pole = lattice.poles[patch.bone][end]; pole >= 0)
          positions_[pole] = end == 0 ? patch.placed.front() : patch.placed.back();
    const double reach = distance_ / 2;
    const std::vector<Vec3> spread =
        download_vectors(context_, fill_in(context_, home_laplace_, reach * reach, is_between,
                                           upload_points(context_, gaps, Vec3::Zero(), -model_.diagonal)));
    const int first_seam =
        home_.lattice.first_sample.empty() ? home_.lattice.vertex_count : home_.lattice.first_sample[0];
    for (int i = 0; i < first_seam; ++i)
      if (is_free_[i] != 0) positions_[i] += is_between[i] != 0 ? Vec3(model_.diagonal * spread[i]) : gaps[i];
  }

  /// How much of the source's orientation counts: by the distance over the surface from where the part begins, which a
  /// screened Poisson equation tells (Varadhan).
  std::vector<float> source_weights() const {
    std::vector<float> outside(positions_.size());
    for (std::size_t i = 0; i < outside.size(); ++i) outside[i] = is_free_[i] - 1;
    const double reach = distance_ / 3;
    const std::vector<float> near = context_.download(
        fill_in(context_, home_laplace_, reach * reach, is_free_, {1, context_.upload(outside)}).values);
    std::vector<float> weights(positions_.size(), 0);
    for (std::size_t i = 0; i < weights.size(); ++i)
      if (is_free_[i] != 0)
        weights[i] = static_cast<float>(
            smooth_step(-reach * std::log(std::clamp(static_cast<double>(near[i]), kLeast, 1.0)) / distance_));
    return weights;
  }

  /// From the source's surface to the placed one, as a whole.
  Eigen::Quaterniond rotation_of(const PlacedPatch& patch) const {
    const auto centred = [](const std::vector<Vec3>& points) {
      Vec3 sum = Vec3::Zero();
      for (const Vec3& p : points) sum += p / static_cast<double>(points.size());
      std::vector<Vec3> result;
      for (const Vec3& p : points) result.push_back(p - sum);
      return result;
    };
    return best_rotation(centred(patch.source), centred(patch.placed));
  }

  /// Per inner row of all patches.
  std::vector<Eigen::Quaternionf> row_rotations() const {
    std::vector<Eigen::Quaterniond> of_bones(model_.patches.size(), Eigen::Quaterniond::Identity());
    for (const PlacedPatch& patch : patches_) of_bones[patch.bone] = rotation_of(patch);
    const auto at_node = bones_at_nodes(model_.skeleton);
    const auto mixed = [](const Eigen::Quaterniond& a, const Eigen::Quaterniond& b, double share) {
      return Eigen::Quaterniond(
                 Eigen::Vector4d((1 - share) * a.coeffs() + (a.dot(b) < 0 ? -share : share) * b.coeffs()))
          .normalized();
    };
    const auto at_end = [&](int bone, BoneEnd end) {
      const int node = end_node(model_.skeleton, bone, end);
      Eigen::Vector4d sum = Eigen::Vector4d::Zero();
      for (const BoneAtNode other : at_node[node])
        if (patch_of_[other.bone])
          sum += (of_bones[bone].dot(of_bones[other.bone]) < 0 ? -1 : 1) * of_bones[other.bone].coeffs();
      return Eigen::Quaterniond(Eigen::Vector4d(sum.normalized()));
    };
    std::vector<Eigen::Quaternionf> rotations;
    for (int bone = 0; bone < static_cast<int>(model_.patches.size()); ++bone) {
      const Patch& patch = model_.patches[bone];
      const std::array ends{at_end(bone, BoneEnd::kHead), at_end(bone, BoneEnd::kTail)};
      for (int row = 1; row + 1 < patch.rectangle.height; ++row) {
        const double u = patch.row_u[row];
        const Eigen::Quaterniond& nearer = u < 0.5 ? ends[0] : ends[1];
        rotations.push_back(
            mixed(of_bones[bone], nearer, smooth_step(1 - std::min(u, 1 - u) / kSeamReach)).cast<float>());
      }
    }
    return rotations;
  }

  std::vector<OrientationSource> orientation_sources() const {
    const Lattice& lattice = home_.lattice;
    std::vector<float> weights = source_weights(), rest;
    for (const float weight : weights) rest.push_back(1 - weight);

    std::vector<Vec3> points = home_.positions;
    const auto width_of = [&](int bone) { return model_.patches[bone].rectangle.width; };
    for_each_texel([&](const PlacedPatch& patch, int vertex, int row, int j) {
      points[vertex] = patch.source[static_cast<std::size_t>(row) * width_of(patch.bone) + j];
    });
    for (const PlacedPatch& patch : patches_)
      for (const int end : {0, 1})
        if (const int pole = lattice.poles[patch.bone][end]; pole >= 0)
          points[pole] = end == 0 ? patch.source.front() : patch.source.back();
    const auto seam_point = [&](int bone, int node, double turn) {
      return end_point(patch_of_[bone]->source, bone, end_at(model_.skeleton, bone, node), turn);
    };
    for (std::size_t a = 0; a < model_.arcs.size(); ++a)
      if (const SeamArc& arc = model_.arcs[a]; is_inside(arc.bones))
        for (std::size_t i = 0; i < arc.samples.size(); ++i)
          points[lattice.first_sample[a] + i] = seam_point(arc.bones[0], arc.node, arc.samples[i].turn);
    for (std::size_t c = 0; c < model_.corners.size(); ++c)
      if (const SeamCorner& corner = model_.corners[c]; is_inside(corner.bones))
        points[lattice.first_corner + c] = seam_point(corner.bones[0], corner.node, corner.sample.turn);

    const Vec3& centre = patches_[0].source[0];
    std::vector<OrientationSource> sources;
    sources.push_back({upload_points(context_, home_.positions, target_.origin, target_.diagonal), std::move(rest),
                       std::vector<Eigen::Quaternionf>(home_.neighbours.rows.size, Eigen::Quaternionf::Identity())});
    sources.push_back({upload_points(context_, points, centre, target_.diagonal), std::move(weights), row_rotations()});
    return sources;
  }

  ClContext& context_;
  const SkeletexModel &target_, &model_;
  std::span<const PlacedPatch> patches_;
  double distance_;
  ModelSurface home_;
  SurfaceOperator home_laplace_;
  std::vector<Vec3> positions_;
  std::vector<float> is_free_;
  std::vector<const PlacedPatch*> patch_of_;
};

}  // namespace

SkeletexModel join_surface(ClContext& context, const SkeletexModel& target, const SkeletexModel& model,
                           std::span<const PlacedPatch> patches, double distance) {
  return Joining(context, target, model, patches, distance).run();
}

}  // namespace skeletex
