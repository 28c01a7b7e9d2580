// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/reconstruct_mesh.h"

#include <algorithm>

#include "skeletex/model/frame.h"
#include "skeletex/reconstruct/displace.h"
#include "skeletex/reconstruct/lattice.h"
#include "skeletex/reconstruct/seam_strip.h"

namespace skeletex {
namespace {

/// The end of a bone that lies at a node.
BoneEnd end_at(const Skeleton& skeleton, int bone, int node) { return skeleton.bones[bone].head == node ? BoneEnd::kHead : BoneEnd::kTail; }

Vec3 sample_point(const Skeleton& skeleton, const Walls& walls, int node, int bone, const SeamSample& sample) {
  return walls.seam_point(bone, end_at(skeleton, bone, node), sample.turn, sample.distance);
}

/// Seam samples and corners: few, and shared by several patches, so they are made on the host in double.
void place_seams(const SkeletexModel& model, const Walls& walls, const Lattice& lattice, std::vector<Vec3>& positions) {
  for (std::size_t a = 0; a < model.arcs.size(); ++a)
    for (std::size_t i = 0; i < model.arcs[a].samples.size(); ++i)
      positions[lattice.first_sample[a] + i] = sample_point(model.skeleton, walls, model.arcs[a].node, model.arcs[a].bones[0], model.arcs[a].samples[i]);
  for (std::size_t i = 0; i < model.corners.size(); ++i)
    positions[lattice.first_corner + i] = sample_point(model.skeleton, walls, model.corners[i].node, model.corners[i].bones[0], model.corners[i].sample);
}

/// Calls place(vertex, bone, end, texel) for every pole.
template <class Place>
void for_each_pole(const SkeletexModel& model, const Lattice& lattice, const Place& place) {
  for (int bone = 0; bone < static_cast<int>(model.patches.size()); ++bone)
    for (int end = 0; end < 2; ++end) {
      if (lattice.poles[bone][end] < 0) continue;
      const Rectangle& r = model.patches[bone].rectangle;
      place(lattice.poles[bone][end], bone, end, static_cast<std::size_t>(r.y + (end == 0 ? 0 : r.height - 1)) * model.texture.width + r.x);
    }
}

void place_shared_vertices(const SkeletexModel& model, const Walls& walls, const Lattice& lattice, std::vector<Vec3>& positions) {
  const DisplacementTexture& texture = model.texture;
  for_each_pole(model, lattice, [&](int vertex, int bone, int end, std::size_t texel) {
    positions[vertex] = decode_texel(tangent_frame(model.skeleton, walls, bone, end, 0), Vec3(texture.along[texel], texture.around[texel], texture.out[texel]),
                                     end_position(model.skeleton, bone, BoneEnd::kHead), end_position(model.skeleton, bone, BoneEnd::kTail));
  });
  place_seams(model, walls, lattice, positions);
}

DevicePlanes displace_inner(ClContext& context, const SkeletexModel& model, const Walls& walls, const Lattice& lattice) {
  DevicePlanes points = allocate_planes(context, lattice.inner_count);
  displace(context, upload_lattice(context, frame_tables(model.skeleton, walls, model.patches, model.origin), model.patches, model.texture, RowChoice::kInner),
           points);
  return points;
}

std::vector<Vec3> place_vertices(ClContext& context, const SkeletexModel& model, const Walls& walls, const Lattice& lattice, const DevicePlanes& inner) {
  std::vector<Vec3> positions(lattice.vertex_count);
  place_shared_vertices(model, walls, lattice, positions);
  for (int axis = 0; axis < 3; ++axis) {
    const std::vector<float> plane = context.download(axis == 0 ? inner.x : axis == 1 ? inner.y : inner.z);
    for (int i = 0; i < lattice.inner_count; ++i) positions[i][axis] = model.origin[axis] + static_cast<double>(plane[i]);
  }
  return positions;
}

void append_end_triangles(const SkeletexModel& model, const Lattice& lattice, const std::vector<Vec3>& positions, std::vector<Triangle>& triangles) {
  const Walls walls(model.skeleton);
  for (int bone = 0; bone < static_cast<int>(model.patches.size()); ++bone)
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) {
      if (lattice.poles[bone][static_cast<int>(end)] >= 0) {
        append_pole_fan(model, lattice, bone, end, triangles);
        continue;
      }
      Ring seam{end_loop(model, lattice, bone, end), {}}, row{end_row(model, lattice, bone, end), {}};
      for (const int vertex : seam.vertices) seam.turns.push_back(walls.turn_of(bone, positions[vertex] - end_position(model.skeleton, bone, end)));
      for (std::size_t j = 0; j < row.vertices.size(); ++j) row.turns.push_back(static_cast<double>(j) / static_cast<double>(row.vertices.size()));
      append_seam_strip(positions, seam, row, end, triangles);
    }
}

}  // namespace

std::vector<Vec3> lattice_positions(ClContext& context, const SkeletexModel& model) {
  const Lattice lattice = number_lattice(model);
  const Walls walls(model.skeleton);
  return place_vertices(context, model, walls, lattice, displace_inner(context, model, walls, lattice));
}

std::vector<Triangle> end_triangles(const SkeletexModel& model, const Lattice& lattice, const std::vector<Vec3>& positions) {
  std::vector<Triangle> triangles;
  append_end_triangles(model, lattice, positions, triangles);
  return triangles;
}

namespace {

std::vector<Triangle> triangulate(ClContext& context, const SkeletexModel& model, DiagonalRule rule, const Walls& walls, const Lattice& lattice,
                                  const DevicePlanes& inner, const std::vector<Vec3>& positions) {
  std::vector<LatticeRow> rows = lattice_rows(model.patches, RowChoice::kInner);
  std::erase_if(rows, [&](const LatticeRow& row) { return row[1] == model.patches[row[0]].rectangle.height - 2; });
  const auto patches = context.upload(frame_tables(model.skeleton, walls, model.patches, model.origin).patches);
  // Room for the strips and fans at the end, so that the host's copy need not grow.
  const auto device_triangles = context.allocate<Triangle>(lattice.triangle_count);
  context.launch({"reconstruct.cl", rule == DiagonalRule::kSmooth ? "triangulate_smoothly" : "triangulate_quads"}, row_range(context, rows.size()),
                 static_cast<int>(rows.size()), context.upload(rows), patches, inner.x, inner.y, inner.z, device_triangles);
  std::vector<Triangle> triangles = context.download(device_triangles);
  triangles.resize(2 * static_cast<std::size_t>(lattice.quad_count));
  append_end_triangles(model, lattice, positions, triangles);
  return triangles;
}

}  // namespace

TriangleMesh reconstruct_mesh(ClContext& context, const SkeletexModel& model) {
  const Lattice lattice = number_lattice(model);
  const Walls walls(model.skeleton);
  const DevicePlanes points = displace_inner(context, model, walls, lattice);
  TriangleMesh mesh;
  mesh.positions = place_vertices(context, model, walls, lattice, points);
  mesh.triangles = triangulate(context, model, model.diagonals, walls, lattice, points, mesh.positions);
  return mesh;
}

TriangleMesh mesh_of_points(ClContext& context, const SkeletexModel& model, DiagonalRule rule, const std::array<std::vector<float>, 3>& planes) {
  const Lattice lattice = number_lattice(model);
  const Walls walls(model.skeleton);
  TriangleMesh mesh;
  mesh.positions.resize(lattice.vertex_count);
  std::array<ClBuffer<float>, 3> inner;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<float> values(lattice.inner_count);
    for (std::size_t bone = 0; bone < model.patches.size(); ++bone) {
      const Rectangle& r = model.patches[bone].rectangle;
      for (int row = 1; row + 1 < r.height; ++row)
        std::copy_n(planes[axis].begin() + (r.y + row) * static_cast<std::ptrdiff_t>(model.texture.width) + r.x, r.width,
                    values.begin() + lattice.first_inner[bone] + (row - 1) * static_cast<std::ptrdiff_t>(r.width));
    }
    for (int i = 0; i < lattice.inner_count; ++i) mesh.positions[i][axis] = model.origin[axis] + static_cast<double>(values[i]);
    for_each_pole(model, lattice, [&](int vertex, int, int, std::size_t texel) {
      mesh.positions[vertex][axis] = model.origin[axis] + static_cast<double>(planes[axis][texel]);
    });
    inner[axis] = context.upload(values);
  }
  place_seams(model, walls, lattice, mesh.positions);
  mesh.triangles = triangulate(context, model, rule, walls, lattice, {inner[0], inner[1], inner[2]}, mesh.positions);
  return mesh;
}

}  // namespace skeletex
