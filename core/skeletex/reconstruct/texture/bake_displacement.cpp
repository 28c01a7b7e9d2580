// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/texture/bake_displacement.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <queue>
#include <utility>

#include "skeletex/geometry/loop_turns.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/reconstruct/texture/corner_coordinates.h"
#include "skeletex/reconstruct/texture/picture_layout.h"

namespace skeletex {
namespace {

/// The points of a model's surface at its texels, patch by patch.
class SurfacePoints {
 public:
  SurfacePoints(const PreparedModel& model, std::vector<Vec3> positions)
      : model_(model), positions_(std::move(positions)) {
    for (int bone = 0; bone < static_cast<int>(model.model.patches.size()); ++bone)
      for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) ends_.push_back(end_points(bone, end));
  }

  /// \param row, column  beyond the patch: the nearest row, and around
  Vec3 at(int bone, int row, double column) const {
    const Rectangle& r = model_.model.patches[bone].rectangle;
    const double below = std::floor(column);
    const auto on_row = [&](double c) {
      const int wrapped = static_cast<int>(c) % r.width;
      return texel(bone, std::clamp(row, 0, r.height - 1), wrapped < 0 ? wrapped + r.width : wrapped);
    };
    return on_row(below) + (column - below) * (on_row(below + 1) - on_row(below));
  }

 private:
  const Vec3& texel(int bone, int row, int column) const {
    const Rectangle& r = model_.model.patches[bone].rectangle;
    if (row == 0) return ends_[2 * bone][column];
    if (row == r.height - 1) return ends_[2 * bone + 1][column];
    return positions_[model_.lattice.first_inner[bone] + (row - 1) * r.width + column];
  }

  /// A pole, or the points of the seam at the columns' angles.
  std::vector<Vec3> end_points(int bone, BoneEnd end) const {
    const int columns = model_.model.patches[bone].rectangle.width;
    const int pole = model_.lattice.poles[bone][static_cast<int>(end)];
    if (pole >= 0) return std::vector<Vec3>(columns, positions_[pole]);
    const EndSeam seam = end_seam(model_.model, model_.separation, model_.lattice, positions_, bone, end);
    std::vector<Vec3> points;
    for (const int vertex : seam.ring.vertices) points.push_back(positions_[vertex]);
    return points_at_columns(std::move(points), seam.turns, columns);
  }

  const PreparedModel& model_;
  std::vector<Vec3> positions_;
  std::vector<std::vector<Vec3>> ends_;  ///< per bone: head, tail
};

/// Calls `visit(column, row, point)` for the pixels of a patch that lie in a triangle of its coarse mesh or near by.
/// \param corners  pixels, from row 0 and column 0 of the patch
/// \param points   there; the triangle's plane goes on beyond it
/// \param margin   how far outside, pixels
template <typename Visit>
void for_each_pixel(const std::array<Eigen::Vector2d, 3>& corners, const std::array<Vec3, 3>& points, double margin,
                    const Visit& visit) {
  Eigen::Matrix2d edges;
  edges << corners[1] - corners[0], corners[2] - corners[0];
  const double area = std::abs(edges.determinant());
  if (area < 1e-12) return;
  const Eigen::Matrix2d inverse = edges.inverse();
  Vec3 least_share;
  for (int k = 0; k < 3; ++k) least_share[k] = -margin * (corners[(k + 2) % 3] - corners[(k + 1) % 3]).norm() / area;
  const Eigen::Vector2d least = corners[0].cwiseMin(corners[1]).cwiseMin(corners[2]).array() - margin,
                        most = corners[0].cwiseMax(corners[1]).cwiseMax(corners[2]).array() + margin;
  for (int row = static_cast<int>(std::ceil(least.y())); row <= most.y(); ++row)
    for (int column = static_cast<int>(std::ceil(least.x())); column <= most.x(); ++column) {
      const Eigen::Vector2d other = inverse * (Eigen::Vector2d(column, row) - corners[0]);
      const Vec3 share(1 - other.sum(), other[0], other[1]);
      if ((share.array() < least_share.array()).any()) continue;
      visit(column, row, Vec3(share[0] * points[0] + share[1] * points[1] + share[2] * points[2]));
    }
}

/// The column of the surface that belongs to a pixel of a triangle. At a pole, neighbouring triangles have different
/// texture coordinates for the pole, and so for the edge between them. Each row of such a triangle is therefore
/// stretched to the columns of its other two corners: then both triangles give the edge the same points.
/// \param corners  pixels
/// \param apex     which corner the pole is; -1: the pixel's own column
double column_of(const std::array<Eigen::Vector2d, 3>& corners, int apex, int column, int row) {
  if (apex < 0) return column;
  const Eigen::Vector2d &pole = corners[apex], &a = corners[(apex + 1) % 3], &b = corners[(apex + 2) % 3];
  const double share = (row - pole.y()) / (a.y() - pole.y()), reach = std::abs(a.x() - b.x());
  return share > 1e-9 ? pole.x() + std::clamp((column - pole.x()) / share, -reach, reach) : pole.x();
}

/// Gives pixels that no triangle covers the value of the nearest one that is covered, for filters that read across the
/// border of a patch.
void fill_up(DisplacementPicture& picture, std::vector<char>& is_covered) {
  std::queue<int> open;
  for (int i = 0; i < static_cast<int>(is_covered.size()); ++i)
    if (is_covered[i]) open.push(i);
  for (; !open.empty(); open.pop()) {
    const int x = open.front() % picture.width, y = open.front() / picture.width;
    for (const auto& [dx, dy] : {std::pair(-1, 0), std::pair(1, 0), std::pair(0, -1), std::pair(0, 1)}) {
      if (x + dx < 0 || x + dx >= picture.width || y + dy < 0 || y + dy >= picture.height) continue;
      const int next = (y + dy) * picture.width + x + dx;
      if (is_covered[next]) continue;
      is_covered[next] = 1;
      picture.values[next] = picture.values[open.front()];
      open.push(next);
    }
  }
}

}  // namespace

DisplacementPicture bake_displacement(ClContext& context, const PreparedModel& detail, const PreparedModel& base) {
  const PictureLayout layout = lay_out_picture(detail.model, base);
  const SurfacePoints surface(detail, reconstruct_bind_mesh(context, detail).mesh.positions);
  const TriangleMesh mesh = reconstruct_bind_mesh(context, base).mesh;
  const std::size_t pixels = static_cast<std::size_t>(layout.width) * static_cast<std::size_t>(layout.height);
  DisplacementPicture picture{layout.width, layout.height,
                              std::vector<Eigen::Vector3f>(pixels, Eigen::Vector3f::Zero()),
                              picture_coordinates(layout, detail.model, base, mesh)};
  std::vector<char> is_covered(pixels, 0);
  const std::vector<int> bones = triangle_bones(base.lattice, mesh.triangles);
  const double scale = detail.model.skeleton.frame.scale;
  // Linear filters also read pixels just outside a triangle. Where no other triangle covers them, its plane goes on.
  for (const double margin : {1e-6, 1.5})
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      const int x = layout.places[bones[t]][0], y = layout.places[bones[t]][1];
      std::array<Eigen::Vector2d, 3> corners;
      std::array<Vec3, 3> points;
      int apex = -1;
      for (int k = 0; k < 3; ++k) {
        if (const auto& poles = base.lattice.poles[bones[t]];
            mesh.triangles[t][k] == poles[0] || mesh.triangles[t][k] == poles[1])
          apex = k;
        const Eigen::Vector2d uv = picture.coordinates.values[picture.coordinates.corners[t][k]].cast<double>();
        corners[k] = {uv.x() * layout.width - 0.5 - x, (1 - uv.y()) * layout.height - 0.5 - y};
        points[k] = mesh.positions[mesh.triangles[t][k]];
      }
      for_each_pixel(corners, points, margin, [&](int column, int row, const Vec3& point) {
        const Rectangle& r = detail.model.patches[bones[t]].rectangle;
        const bool is_own = column >= -kGutter && column < r.width + layout.repeated + kGutter && row >= -kGutter &&
                            row < r.height + kGutter;
        if (!is_own) return;
        const std::size_t pixel = static_cast<std::size_t>(y + row) * static_cast<std::size_t>(layout.width) +
                                  static_cast<std::size_t>(x + column);
        if (is_covered[pixel]) return;
        const Vec3 target = surface.at(bones[t], row, column_of(corners, apex, column, row));
        picture.values[pixel] = (scale * (target - point)).cast<float>();
        is_covered[pixel] = 1;
      });
    }
  fill_up(picture, is_covered);
  return picture;
}

}  // namespace skeletex
