// SPDX-License-Identifier: MIT
#include "skeletex/render/scene.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "skeletex/skeleton/separation_planes.h"

namespace skeletex {
namespace {

constexpr int kBallRows = 10, kBallColumns = 16, kSpindleColumns = 12;
constexpr int kBallTriangles = 2 * kBallColumns * (kBallRows - 1), kSpindleTriangles = 4 * kSpindleColumns;

/// Closes a surface of revolution about an axis; the first and last ring are points.
void append_revolution(const Vec3& axis, const Vec3& base, const std::vector<std::array<double, 2>>& profile,
                       int columns, TriangleMesh& mesh) {
  const Vec3 any = std::abs(axis.x()) < 0.7 ? Vec3::UnitX() : Vec3::UnitY();
  const Vec3 a = any.cross(axis).normalized(), b = axis.cross(a);
  const int first = static_cast<int>(mesh.positions.size()), rings = static_cast<int>(profile.size());
  const auto vertex = [&](int ring, int j) {
    return ring == 0           ? first
           : ring == rings - 1 ? first + 1 + (rings - 2) * columns
                               : first + 1 + (ring - 1) * columns + (j + columns) % columns;
  };
  for (int ring = 0; ring < rings; ++ring)
    for (int j = 0; j < (ring == 0 || ring == rings - 1 ? 1 : columns); ++j) {
      const double angle = 2 * std::numbers::pi * j / columns;
      mesh.positions.push_back(base + profile[ring][0] * axis +
                               profile[ring][1] * (std::cos(angle) * a + std::sin(angle) * b));
    }
  for (int ring = 0; ring + 1 < rings; ++ring)
    for (int j = 0; j < columns; ++j) {
      if (ring > 0) mesh.triangles.push_back({vertex(ring, j), vertex(ring, j + 1), vertex(ring + 1, j)});
      if (ring + 2 < rings)
        mesh.triangles.push_back({vertex(ring, j + 1), vertex(ring + 1, j + 1), vertex(ring + 1, j)});
    }
}

}  // namespace

std::vector<int> triangle_bones(const Lattice& lattice, const std::vector<Triangle>& triangles) {
  std::vector<int> bones;
  bones.reserve(triangles.size());
  for (const Triangle& t : triangles) {
    // Inner vertices come first, and every triangle has one: seams and poles never join up without the row next to
    // them.
    const int vertex = *std::min_element(t.begin(), t.end());
    bones.push_back(static_cast<int>(std::upper_bound(lattice.first_inner.begin(), lattice.first_inner.end(), vertex) -
                                     lattice.first_inner.begin()) -
                    1);
  }
  return bones;
}

namespace {

/// Checker coordinates of the corners of one triangle. Poles have no v of their own: they take the mean of the others.
class CheckerTriangle {
 public:
  CheckerTriangle(const PreparedModel& model, const TriangleMesh& mesh, int bone, const Triangle& triangle)
      : model_(model), mesh_(mesh), bone_(bone), rectangle_(model.model.patches[bone].rectangle), triangle_(triangle) {
    int row = 1;
    for (const int vertex : triangle) row = std::max(row, row_of(vertex));
    const BoneEnd near_end = row <= 1 ? BoneEnd::kHead : BoneEnd::kTail;
    for (int c = 0; c < 3; ++c) place(c, near_end);
  }

  /// \param rows  of cells along the bone    \param cells  around it
  void append(double rows, int cells, std::vector<std::array<float, 2>>& coordinates) {
    const int anchor = is_pole_[0] ? 1 : 0;
    double sum = 0;
    for (int c = 0; c < 3; ++c) {
      v_[c] += std::round(v_[anchor] - v_[c]);
      sum += is_pole_[c] ? 0 : v_[c];
    }
    const double others = 3 - static_cast<double>(std::count(is_pole_.begin(), is_pole_.end(), true));
    for (int c = 0; c < 3; ++c)
      coordinates.push_back(
          {static_cast<float>(u_[c] * rows), static_cast<float>((is_pole_[c] ? sum / others : v_[c]) * cells)});
  }

 private:
  int inner_number(int vertex) const { return vertex - model_.lattice.first_inner[bone_]; }
  /// -1 for vertices of seams and poles
  int row_of(int vertex) const {
    const int inner = inner_number(vertex);
    return inner >= 0 && inner < rectangle_.width * (rectangle_.height - 2) ? 1 + inner / rectangle_.width : -1;
  }
  void place(int c, BoneEnd near_end) {
    const int vertex = triangle_[c], row = row_of(vertex);
    const auto& poles = model_.lattice.poles[bone_];
    is_pole_[c] = vertex == poles[0] || vertex == poles[1];
    if (row >= 0) {
      u_[c] = static_cast<double>(row) / (rectangle_.height - 1);
      v_[c] = static_cast<double>(inner_number(vertex) % rectangle_.width) / rectangle_.width;
      return;
    }
    u_[c] = near_end == BoneEnd::kHead ? 0 : 1;
    if (!is_pole_[c])
      v_[c] = model_.separation.turn_of(bone_,
                                        mesh_.positions[vertex] - end_position(model_.model.skeleton, bone_, near_end));
  }

  const PreparedModel& model_;
  const TriangleMesh& mesh_;
  int bone_;
  Rectangle rectangle_;
  Triangle triangle_;
  std::array<double, 3> u_{}, v_{};
  std::array<bool, 3> is_pole_{};
};

}  // namespace

std::vector<std::array<float, 2>> checker_coordinates(const PreparedModel& model, const TriangleMesh& mesh, int cells) {
  const std::vector<int> bones = triangle_bones(model.lattice, mesh.triangles);
  std::vector<double> rows_in_cells;
  for (const Patch& patch : model.model.patches)
    rows_in_cells.push_back(
        std::max(1.0, std::round(static_cast<double>(cells) * patch.rectangle.height / patch.rectangle.width)));
  std::vector<std::array<float, 2>> coordinates;
  coordinates.reserve(3 * mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    CheckerTriangle(model, mesh, bones[t], mesh.triangles[t]).append(rows_in_cells[bones[t]], cells, coordinates);
  return coordinates;
}

TriangleMesh skeleton_mesh(const Skeleton& skeleton, double radius) {
  TriangleMesh mesh;
  for (const Node& node : skeleton.nodes) {
    std::vector<std::array<double, 2>> profile;
    for (int i = 0; i <= kBallRows; ++i) {
      const double angle = std::numbers::pi * i / kBallRows;
      profile.push_back({-radius * std::cos(angle), radius * std::sin(angle)});
    }
    append_revolution(Vec3::UnitY(), node.position, profile, kBallColumns, mesh);
  }
  for (const Bone& bone : skeleton.bones) {
    const Vec3 head = skeleton.nodes[bone.head].position, along = skeleton.nodes[bone.tail].position - head;
    const double length = along.norm();
    const double belly = std::min(1.5 * radius, 0.25 * length), thickness = std::min(0.85 * radius, 0.2 * length);
    append_revolution(along / length, head,
                      {{0, 0}, {belly, thickness}, {length - 0.1 * belly, 0.25 * thickness}, {length, 0}},
                      kSpindleColumns, mesh);
  }
  return mesh;
}

std::vector<int> skeleton_mesh_bones(const Skeleton& skeleton) {
  std::vector<int> bones(skeleton.nodes.size() * kBallTriangles, -1);
  for (int bone = 0; bone < static_cast<int>(skeleton.bones.size()); ++bone)
    bones.insert(bones.end(), kSpindleTriangles, bone);
  return bones;
}

}  // namespace skeletex
