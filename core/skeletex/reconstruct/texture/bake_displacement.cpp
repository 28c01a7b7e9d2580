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
#include "skeletex/reconstruct/texture/vertex_tangents.h"

namespace skeletex {
namespace {

/// The points of a model's surface at its texels, patch by patch.
class SurfacePoints {
 public:
  SurfacePoints(const PreparedModel& model, std::vector<Vec3> positions)
      : model_(model), positions_(std::move(positions)) {
    for (BoneIndex bone = 0; bone < static_cast<int>(model.model.patches.size()); ++bone)
      for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) ends_.push_back(end_points(bone, end));
  }

  /// \param row, column  beyond the patch: the nearest row, and around
  Vec3 at(BoneIndex bone, int row, double column) const {
    const Rectangle& r = model_.model.patches[bone].rectangle;
    const double below = std::floor(column);
    const auto on_row = [&](double c) {
      const int wrapped = static_cast<int>(c) % r.width;
      return texel(bone, std::clamp(row, 0, r.height - 1), wrapped < 0 ? wrapped + r.width : wrapped);
    };
    return on_row(below) + (column - below) * (on_row(below + 1) - on_row(below));
  }

 private:
  const Vec3& texel(BoneIndex bone, int row, int column) const {
    const Rectangle& r = model_.model.patches[bone].rectangle;
    if (row == 0) return ends_[2 * bone][column];
    if (row == r.height - 1) return ends_[2 * bone + 1][column];
    return positions_[model_.lattice.first_inner[bone] + (row - 1) * r.width + column];
  }

  /// A pole, or the points of the seam at the columns' angles.
  std::vector<Vec3> end_points(BoneIndex bone, BoneEnd end) const {
    const int columns = model_.model.patches[bone].rectangle.width;
    const int pole = model_.lattice.poles[bone][static_cast<int>(end)];
    if (pole >= 0) return std::vector<Vec3>(columns, positions_[pole]);
    const EndSeam seam = end_seam(model_.model, model_.separation, model_.lattice, positions_, bone, end);
    std::vector<Vec3> points;
    for (const VertexIndex vertex : seam.ring.vertices) points.push_back(positions_[vertex]);
    return points_at_columns(std::move(points), seam.turns, columns);
  }

  const PreparedModel& model_;
  std::vector<Vec3> positions_;
  std::vector<std::vector<Vec3>> ends_;  ///< per bone: head, tail
};

/// Calls `visit(column, row, share)` for the pixels of a patch that lie in a triangle of its coarse mesh or near by.
/// \param corners  pixels, from row 0 and column 0 of the patch
/// \param margin   how far outside, pixels
/// \param visit    share: of the corners in the pixel; outside the triangle some are below 0
template <typename Visit>
void for_each_pixel(const std::array<Eigen::Vector2d, 3>& corners, double margin, const Visit& visit) {
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
      visit(column, row, share);
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

/// The coarse mesh with the tangent frames of its corners, where those are wanted.
class BaseSurface {
 public:
  BaseSurface(TriangleMesh mesh, const CornerValues<Eigen::Vector2f>& coordinates, DisplacementSpace space)
      : mesh_(std::move(mesh)) {
    if (space == DisplacementSpace::kObject) return;
    MeshAttributes attributes;
    attributes.normals.values = vertex_normals(mesh_);
    attributes.texture_coordinates = coordinates;
    SplitMesh split = split_vertices(mesh_, attributes);
    tangents_.values =
        vertex_tangents(split.mesh, split.attributes.normals.values, split.attributes.texture_coordinates.values);
    tangents_.corners = std::move(split.mesh.triangles);
    normals_ = std::move(attributes.normals.values);
  }

  /// \param share   of the corners of triangle t in a point
  /// \param target  where the point is to go
  /// \return the vector from the point to there, in the space of the picture
  Vec3 displacement(std::size_t t, const Vec3& share, const Vec3& target) const {
    Vec3 point = Vec3::Zero(), normal = Vec3::Zero();
    Eigen::Vector4d tangent = Eigen::Vector4d::Zero();
    for (int k = 0; k < 3; ++k) {
      point += share[k] * mesh_.positions[mesh_.triangles[t][k]];
      if (tangents_.empty()) continue;
      normal += share[k] * normals_[mesh_.triangles[t][k]];
      tangent += share[k] * tangents_.values[tangents_.corners[t][k]];
    }
    Vec3 displacement = target - point;
    if (tangents_.empty()) return displacement;
    const ShadingFrame frame = tangent_frame(normal, tangent);
    return {displacement.dot(frame.tangent), displacement.dot(frame.normal), displacement.dot(frame.bitangent)};
  }

  const TriangleMesh& mesh() const { return mesh_; }
  CornerValues<Eigen::Vector4d>& tangents() { return tangents_; }

 private:
  TriangleMesh mesh_;
  std::vector<Vec3> normals_;
  CornerValues<Eigen::Vector4d> tangents_;
};

}  // namespace

DisplacementPicture bake_displacement(ClContext& context, const PreparedModel& detail, const PreparedModel& base,
                                      DisplacementSpace space) {
  const PictureLayout layout = lay_out_picture(detail.model, base);
  const SurfacePoints surface(detail, reconstruct_bind_mesh(context, detail).mesh.positions);
  TriangleMesh base_mesh = reconstruct_bind_mesh(context, base).mesh;
  const std::size_t pixels = static_cast<std::size_t>(layout.width) * static_cast<std::size_t>(layout.height);
  DisplacementPicture picture{layout.width,
                              layout.height,
                              std::vector<Eigen::Vector3f>(pixels, Eigen::Vector3f::Zero()),
                              picture_coordinates(layout, detail.model, base, base_mesh),
                              {}};
  BaseSurface from(std::move(base_mesh), picture.coordinates, space);
  const TriangleMesh& mesh = from.mesh();
  std::vector<char> is_covered(pixels, 0);
  const std::vector<int> bones = triangle_bones(base.lattice, mesh.triangles);
  const double scale = detail.model.skeleton.frame.scale;
  // Linear filters also read pixels just outside a triangle. Where no other triangle covers them, its plane goes on.
  for (const double margin : {1e-6, 1.5})
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      const int x = layout.places[bones[t]][0], y = layout.places[bones[t]][1];
      std::array<Eigen::Vector2d, 3> corners;
      int apex = -1;
      for (int k = 0; k < 3; ++k) {
        if (const auto& poles = base.lattice.poles[bones[t]];
            mesh.triangles[t][k] == poles[0] || mesh.triangles[t][k] == poles[1])
          apex = k;
        const Eigen::Vector2d uv = picture.coordinates.values[picture.coordinates.corners[t][k]].cast<double>();
        corners[k] = {uv.x() * layout.width - 0.5 - x, (1 - uv.y()) * layout.height - 0.5 - y};
      }
      for_each_pixel(corners, margin, [&](int column, int row, const Vec3& share) {
        const Rectangle& r = detail.model.patches[bones[t]].rectangle;
        const bool is_own = column >= -kGutter && column < r.width + layout.repeated + kGutter && row >= -kGutter &&
                            row < r.height + kGutter;
        if (!is_own) return;
        const std::size_t pixel = static_cast<std::size_t>(y + row) * static_cast<std::size_t>(layout.width) +
                                  static_cast<std::size_t>(x + column);
        if (is_covered[pixel]) return;
        const Vec3 target = surface.at(bones[t], row, column_of(corners, apex, column, row));
        picture.values[pixel] = (scale * from.displacement(t, share, target)).cast<float>();
        is_covered[pixel] = 1;
      });
    }
  fill_up(picture, is_covered);
  picture.tangents = std::move(from.tangents());
  return picture;
}

}  // namespace skeletex
