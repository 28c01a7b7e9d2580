// SPDX-License-Identifier: MIT
#include "skeletex/edit/morph/orientation.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "skeletex/geometry/best_rotation.h"

namespace skeletex {
namespace {

constexpr const char* kFile = "orientation.cl";
constexpr double kScale = 0.1;
constexpr int kRotationPasses = 2;
constexpr double kTolerance = 1e-6;  // so small that a morph hardly depends on the order of the models
// Shares of the bone, from the nearest seam, where rotations begin to fade and have faded.
constexpr double kFadeBegin = 0.4, kFadeEnd = 0.9;

}  // namespace

double smooth_step(double x) {
  x = std::clamp(x, 0.0, 1.0);
  return x * x * (3 - 2 * x);
}

std::vector<float> shares_without_tips(const SkeletexModel& model, const Lattice& lattice) {
  std::vector<float> shares;
  for (std::size_t bone = 0; bone < model.patches.size(); ++bone) {
    const Patch& patch = model.patches[bone];
    for (int row = 1; row + 1 < patch.rectangle.height; ++row) {
      double from_seam = 1;
      if (lattice.poles[bone][0] < 0) from_seam = std::min(from_seam, patch.row_u[row]);
      if (lattice.poles[bone][1] < 0) from_seam = std::min(from_seam, 1 - patch.row_u[row]);
      shares.push_back(static_cast<float>(smooth_step((kFadeEnd - from_seam) / (kFadeEnd - kFadeBegin))));
    }
  }
  return shares;
}

OrientationSource whole_source(ClContext& context, const SkeletexModel& model, const ModelSurface& surface,
                               const SurfaceOperator& laplace, const std::vector<Vec3>& source, double weight) {
  const std::vector<float> masses = context.download(laplace.mass);
  const std::vector<Vec3>& points = surface.positions;
  Vec3 centre = Vec3::Zero(), source_centre = Vec3::Zero();
  double area = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto mass = static_cast<double>(masses[i]);
    area += mass;
    centre += mass * points[i];
    source_centre += mass * source[i];
  }
  centre /= area;
  source_centre /= area;
  std::vector<Vec3> from, to;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double root = std::sqrt(static_cast<double>(masses[i]));
    from.push_back(root * (source[i] - source_centre));
    to.push_back(root * (points[i] - centre));
  }
  const Eigen::Quaternionf rotation = best_rotation(from, to).cast<float>();
  return {upload_points(context, source, source_centre, model.diagonal),
          std::vector<float>(points.size(), static_cast<float>(weight)),
          std::vector<Eigen::Quaternionf>(surface.neighbours.rows.size, rotation)};
}

OrientationPull pull_orientations(ClContext& context, const ModelSurface& surface, const SurfaceOperator& laplace,
                                  std::span<const OrientationSource> sources, const std::vector<float>& row_shares,
                                  double scale) {
  const DeviceNeighbours& n = surface.neighbours;
  const std::size_t count = surface.positions.size();
  const ClRange rows = rows_range(context, n), fans = fans_range(context, n);
  const auto parameters = [&](int components) {
    SurfaceParameters result = n.parameters(components);
    result.first_seam = surface.first_seam();
    result.time = static_cast<float>(scale * scale);
    return result;
  };

  const auto field = [&](int components) {
    return DeviceField{components, context.allocate<float>(components * count)};
  };
  const auto zeros = [&](std::size_t size) { return context.upload(std::vector<float>(size, 0.f)); };
  const auto mean_at_ends = [&](const DeviceField& of) {
    context.launch({kFile, "mean_at_ends"}, fans, parameters(of.components), n.fan_vertices, n.fans, of.values);
  };
  const auto row_normals = [&](const DeviceField& points) {
    DeviceField normals = field(3);
    context.launch({kFile, "row_normals"}, rows, parameters(3), n.rows, points.values, normals.values);
    return normals;
  };

  OrientationPull pull{{4, zeros(4 * count)}, row_normals(surface.points), field(3)};
  const auto slopes = zeros(2 * n.fans.size);
  for (const OrientationSource& source : sources) {
    const DeviceField normals = row_normals(source.points);
    mean_at_ends(normals);
    std::vector<std::array<float, 4>> facing;
    for (const Eigen::Quaternionf& q : source.rotations) facing.push_back({q.w(), q.x(), q.y(), q.z()});
    const auto weights = context.upload(source.weights);
    context.launch({kFile, "add_rotations"}, rows, parameters(4), n.rows, context.upload(facing), weights,
                   surface.points.values, source.points.values, pull.rotations.values);
    context.launch({kFile, "add_slopes"}, fans, parameters(3), n.fan_vertices, n.fans, weights, source.points.values,
                   normals.values, slopes);
  }
  context.launch({kFile, "settle_rotations"}, rows, parameters(4), n.rows, context.upload(row_shares),
                 pull.rotations.values);
  DeviceField smoothed{4, zeros(4 * count)};
  for (int pass = 0; pass < kRotationPasses; ++pass) {
    context.launch({kFile, "smooth_rotations"}, rows, parameters(4), n.rows, pull.rotations.values, smoothed.values);
    std::swap(pull.rotations, smoothed);
  }
  context.launch({kFile, "rotate_normals"}, rows, parameters(3), n.rows, pull.rotations.values, pull.normals.values);
  mean_at_ends(pull.rotations);
  mean_at_ends(pull.normals);
  context.launch({kFile, "pull_rows"}, rows, parameters(3), n.rows, laplace.weights, pull.rotations.values,
                 surface.points.values, pull.b.values);
  context.launch({kFile, "pull_fans"}, fans, parameters(3), n.fan_vertices, n.fans, laplace.fan_weights, slopes,
                 pull.rotations.values, pull.normals.values, surface.points.values, pull.b.values);
  return pull;
}

MovedModel blend_orientations(ClContext& context, const SkeletexModel& model,
                              std::span<const std::vector<Vec3>> sources, std::span<const double> weights) {
  if (std::find(weights.begin(), weights.end(), 1.0) != weights.end()) return {model, {}};
  const ModelSurface surface = upload_surface(context, model);
  const SurfaceOperator laplace = make_surface_operator(context, surface.neighbours, surface.points);
  std::vector<OrientationSource> oriented;
  for (std::size_t m = 0; m < sources.size(); ++m)
    if (weights[m] != 0) oriented.push_back(whole_source(context, model, surface, laplace, sources[m], weights[m]));
  const OrientationPull pull =
      pull_orientations(context, surface, laplace, oriented, shares_without_tips(model, surface.lattice), kScale);
  const auto everywhere = context.upload(std::vector<float>(surface.positions.size(), 1.f));
  const SolveResult solved =
      solve_diffusion(context, laplace, static_cast<float>(kScale * kScale), everywhere, pull.b, kTolerance);
  std::vector<Vec3> moves = download_vectors(context, solved.x);
  for (Vec3& move : moves) move *= model.diagonal;
  MovedModel moved = move_surface(context, model, surface, laplace, moves);
  add_solve(solved.report, moved.report.solver);
  return moved;
}

}  // namespace skeletex
