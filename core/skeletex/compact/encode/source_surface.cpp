// SPDX-License-Identifier: MIT
#include "skeletex/compact/encode/source_surface.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "skeletex/geometry/loop_turns.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex {

GridCell cell_at(int rows, int columns, const Place& place) {
  const double row = std::clamp(place[0], 0.0, rows - 1.0),
               column = place[1] - columns * std::floor(place[1] / columns);
  const int r = std::min(static_cast<int>(row), rows - 2), c = std::min(static_cast<int>(column), columns - 1);
  return {r, c, c + 1 < columns ? c + 1 : 0, row - r, column - c};
}

Vec3 SourcePatch::at(const Place& place) const {
  const auto [r, c, next, s, t] = cell_at(rows, columns, place);
  const Vec3* upper = points.data() + static_cast<std::size_t>(r) * columns;
  const Vec3* lower = upper + columns;
  return (1 - s) * ((1 - t) * upper[c] + t * upper[next]) + s * ((1 - t) * lower[c] + t * lower[next]);
}

SourceSurface source_surface(ClContext& context, const PreparedModel& prepared) {
  const SkeletexModel& model = prepared.model;
  const Lattice& lattice = prepared.lattice;
  const std::vector<Vec3> positions = lattice_positions(context, prepared);
  SourceSurface source;
  for (BoneIndex bone = 0; bone < static_cast<int>(model.patches.size()); ++bone) {
    const Rectangle& r = model.patches[bone].rectangle;
    SourcePatch& patch = source.patches.emplace_back();
    patch.rows = r.height;
    patch.columns = r.width;
    patch.row_u = model.patches[bone].row_u;
    const auto add_end = [&](BoneEnd end) {
      const int pole = lattice.poles[bone][static_cast<int>(end)];
      if (pole >= 0) {
        patch.points.insert(patch.points.end(), r.width, positions[pole]);
        return;
      }
      const EndSeam seam = end_seam(model, prepared.separation, lattice, positions, bone, end);
      std::vector<Vec3> points;
      for (const VertexIndex vertex : seam.ring.vertices) points.push_back(positions[vertex]);
      const std::vector<Vec3> row = points_at_columns(points, seam.turns, r.width);
      patch.points.insert(patch.points.end(), row.begin(), row.end());
    };
    add_end(BoneEnd::kHead);
    const auto first = positions.begin() + lattice.first_inner[bone];
    patch.points.insert(patch.points.end(), first, first + static_cast<std::ptrdiff_t>(r.width) * (r.height - 2));
    add_end(BoneEnd::kTail);
  }
  for (std::size_t i = 0; i < model.corners.size(); ++i) source.corners.push_back(positions[lattice.first_corner + i]);
  for (std::size_t i = 0; i < model.arcs.size(); ++i) {
    const SeamArc& arc = model.arcs[i];
    const auto first = positions.begin() + lattice.first_sample[i];
    std::vector<Vec3>& points =
        source.arcs.emplace_back(first, first + static_cast<std::ptrdiff_t>(arc.samples.size()));
    if (arc.is_closed()) continue;
    points.insert(points.begin(), source.corners[arc.corners[0]]);
    points.push_back(source.corners[arc.corners[1]]);
  }
  return source;
}

std::optional<Meeting> meet_line(const SourcePatch& patch, const Place& start, const Place& reach, const Vec3& origin,
                                 const Vec3& direction, double tolerance) {
  constexpr int kSteps = 10;
  // Differences over a part of the reach see past the creases between texels.
  Place width = (0.25 * reach).cwiseMax(0.25);
  Place place = start;
  for (int step = 0; step < kSteps; ++step) {
    const Vec3 offset = patch.at(place) - origin;
    const double distance = offset.dot(direction);
    const Vec3 miss = offset - distance * direction;
    if (miss.norm() <= tolerance) return Meeting{place, distance};
    const double above = std::min(place[0] + width[0], patch.rows - 1.0), below = std::max(place[0] - width[0], 0.0);
    const Vec3 by_row = (patch.at({above, place[1]}) - patch.at({below, place[1]})) / (above - below);
    const Vec3 by_column =
        (patch.at({place[0], place[1] + width[1]}) - patch.at({place[0], place[1] - width[1]})) / (2 * width[1]);
    Eigen::Matrix3d jacobian;
    jacobian << by_row, by_column, -direction;
    const double determinant = jacobian.determinant();
    if (!(std::abs(determinant) > 1e-3 * by_row.norm() * by_column.norm())) return {};
    const Vec3 move = jacobian.inverse() * -miss;
    place += Place(move[0], move[1]);
    place = place.cwiseMax(start - reach).cwiseMin(start + reach);
    place[0] = std::clamp(place[0], 0.0, patch.rows - 1.0);
    width = (0.5 * width).cwiseMax(0.25);
  }
  return {};
}

Place nearest_place(const SourcePatch& patch, const Place& start, const Place& reach, const Vec3& point) {
  constexpr int kRounds = 4, kSide = 3;  // squares of 7 x 7 places, each around the best of the one before
  Place best = start;
  double least = (patch.at(start) - point).squaredNorm(), share = 1;
  for (int round = 0; round < kRounds; ++round, share *= 0.3) {
    const Place centre = best;
    for (int i = -kSide; i <= kSide; ++i)
      for (int k = -kSide; k <= kSide; ++k) {
        const Place place = centre + share / kSide * Place(i * reach[0], k * reach[1]);
        const double distance = (patch.at(place) - point).squaredNorm();
        if (distance >= least) continue;
        least = distance;
        best = place;
      }
  }
  return best;
}

}  // namespace skeletex
