// SPDX-License-Identifier: MIT
#include "skeletex/render/scene.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "skeletex/reconstruct/texture/corner_coordinates.h"

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

std::vector<std::array<float, 2>> checker_coordinates(const PreparedModel& model, const TriangleMesh& mesh, int cells) {
  std::vector<double> rows_in_cells;
  for (const Patch& patch : model.model.patches)
    rows_in_cells.push_back(
        std::max(1.0, std::round(static_cast<double>(cells) * patch.rectangle.height / patch.rectangle.width)));
  const std::vector<int> bones = triangle_bones(model.lattice, mesh.triangles);
  std::vector<std::array<float, 2>> coordinates;
  coordinates.reserve(3 * mesh.triangles.size());
  std::size_t i = 0;
  for (const auto& [u, v] : corner_coordinates(model, mesh)) {
    coordinates.push_back({static_cast<float>(u * rows_in_cells[bones[i / 3]]), static_cast<float>(v * cells)});
    ++i;
  }
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
  for (BoneIndex bone = 0; bone < static_cast<int>(skeleton.bones.size()); ++bone)
    bones.insert(bones.end(), kSpindleTriangles, bone);
  return bones;
}

void draw_skeleton(GlContext& gl, const Skeleton& skeleton, double diagonal, const Camera& camera,
                   const DrawOptions& options, Image& image) {
  std::vector<VertexColour> colours;
  for (const BoneIndex bone : skeleton_mesh_bones(skeleton))
    colours.push_back(bone < 0 ? VertexColour{38, 40, 46} : VertexColour{214, 92, 38});
  SurfacePaint paint;
  paint.paint = Paint::kFace;
  paint.colours = upload_colours(colours);
  DrawOptions plain = options;
  plain.wire_pixels = 0;
  plain.lighting = 0.8;
  blend_over(image, draw(gl, upload_surface(gl, skeleton_mesh(skeleton, 0.009 * diagonal)), paint, camera, plain),
             0.85);
}

}  // namespace skeletex
