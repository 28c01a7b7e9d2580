// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/reconstruct_mesh.h"

#include <fmt/format.h>

#include <algorithm>

#include "reconstruct_structs.h"
#include "skeletex/model/frame.h"
#include "skeletex/model/memory.h"
#include "skeletex/reconstruct/displace.h"
#include "skeletex/reconstruct/lattice.h"
#include "skeletex/reconstruct/seam_strip.h"

namespace skeletex {
namespace {

Vec3 sample_point(const Skeleton& skeleton, const SeparationPlanes& separation, NodeIndex node, BoneIndex bone,
                  const SeamSample& sample) {
  return separation.seam_point(bone, end_at(skeleton, bone, node), sample.turn, sample.distance);
}

}  // namespace

void place_seams(const SkeletexModel& model, const SeparationPlanes& separation, const Lattice& lattice,
                 std::span<Vec3> positions) {
  for (std::size_t a = 0; a < model.arcs.size(); ++a)
    for (std::size_t i = 0; i < model.arcs[a].samples.size(); ++i)
      positions[lattice.first_sample[a] + i] = sample_point(model.skeleton, separation, model.arcs[a].node,
                                                            model.arcs[a].bones[0], model.arcs[a].samples[i]);
  for (std::size_t i = 0; i < model.corners.size(); ++i)
    positions[lattice.first_corner + i] = sample_point(model.skeleton, separation, model.corners[i].node,
                                                       model.corners[i].bones[0], model.corners[i].sample);
}

void for_each_pole(const SkeletexModel& model, const Lattice& lattice,
                   const std::function<void(VertexIndex vertex, BoneIndex bone, int end, std::size_t texel)>& place) {
  for (BoneIndex bone = 0; bone < static_cast<int>(model.patches.size()); ++bone)
    for (int end = 0; end < 2; ++end) {
      if (lattice.poles[bone][end] < 0) continue;
      const Rectangle& r = model.patches[bone].rectangle;
      place(lattice.poles[bone][end], bone, end,
            static_cast<std::size_t>(r.y + (end == 0 ? 0 : r.height - 1)) * model.texture.width + r.x);
    }
}

void place_shared_vertices(const PreparedModel& prepared, std::vector<Vec3>& positions) {
  const SkeletexModel& model = prepared.model;
  const DisplacementTexture& texture = model.texture;
  for_each_pole(model, prepared.lattice, [&](VertexIndex vertex, BoneIndex bone, int end, std::size_t texel) {
    positions[vertex] = decode_texel(tangent_frame(model.skeleton, prepared.separation, bone, end, 0),
                                     Vec3(texture.along[texel], texture.around[texel], texture.out[texel]),
                                     end_position(model.skeleton, bone, BoneEnd::kHead),
                                     end_position(model.skeleton, bone, BoneEnd::kTail));
  });
  place_seams(model, prepared.separation, prepared.lattice, positions);
}

EndSeam end_seam(const SkeletexModel& model, const SeparationPlanes& separation, const Lattice& lattice,
                 std::span<const Vec3> positions, BoneIndex bone, BoneEnd end) {
  EndSeam seam;
  if (lattice.poles[bone][static_cast<int>(end)] >= 0) return seam;
  seam.ring.vertices = end_loop(model, lattice, bone, end);
  std::vector<Vec3> points;
  for (const VertexIndex vertex : seam.ring.vertices) {
    points.push_back(positions[vertex]);
    seam.ring.turns.push_back(separation.turn_of(bone, points.back() - end_position(model.skeleton, bone, end)));
  }
  seam.turns = seam_turns(points, seam.ring.turns);
  return seam;
}

namespace {

std::vector<Vec3> place_vertices(ClContext& context, const PreparedModel& prepared, const DevicePlanes& inner) {
  std::vector<Vec3> positions(prepared.lattice.vertex_count);
  place_shared_vertices(prepared, positions);
  download_points(context, inner, prepared.model.origin, positions);
  return positions;
}

/// The triangles of the quads between inner rows.
/// \param inner  points of the inner vertices
std::vector<Triangle> triangulate(ClContext& context, const PreparedModel& prepared, const DevicePlanes& inner) {
  const std::vector<LatticeRow> rows = quad_rows(prepared.model.patches);
  auto triangles = context.allocate<Triangle>(2 * static_cast<std::size_t>(prepared.lattice.quad_count));
  context.launch({"reconstruct.cl", "triangulate"}, row_range(context, rows.size()),
                 TriangulateParameters{static_cast<int>(rows.size()), static_cast<int>(inner.count),
                                       static_cast<int>(prepared.model.diagonals == DiagonalRule::kSmooth)},
                 context.upload(rows), context.upload(prepared.tables.patches), inner.values, triangles);
  return context.download(triangles);
}

}  // namespace

void append_end_triangles(const SkeletexModel& model, const Lattice& lattice, std::span<const Vec3> positions,
                          const EndSeam& seam, BoneIndex bone, BoneEnd end, std::vector<Triangle>& triangles) {
  if (seam.ring.vertices.empty()) {
    append_pole_fan(model, lattice, bone, end, triangles);
    return;
  }
  Ring row{end_row(model, lattice, bone, end), {}};
  for (std::size_t j = 0; j < row.vertices.size(); ++j)
    row.turns.push_back(static_cast<double>(j) / static_cast<double>(row.vertices.size()));
  append_seam_strip(positions, seam.ring, seam.turns, row, end, triangles);
}

std::vector<Vec3> lattice_positions(ClContext& context, const PreparedModel& model) {
  return place_vertices(context, model, row_points(context, model, RowChoice::kInner));
}

std::vector<Triangle> end_triangles(const PreparedModel& model, const std::vector<Vec3>& positions) {
  std::vector<Triangle> triangles;
  for (BoneIndex bone = 0; bone < static_cast<int>(model.model.patches.size()); ++bone)
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail})
      append_end_triangles(model.model, model.lattice, positions,
                           end_seam(model.model, model.separation, model.lattice, positions, bone, end), bone, end,
                           triangles);
  return triangles;
}

BindMesh reconstruct_bind_mesh(ClContext& context, const PreparedModel& model) {
  constexpr double kBytesPerTexel = 75;
  const DisplacementTexture& texture = model.model.texture;
  require_memory(kBytesPerTexel * texture.width * texture.height,
                 fmt::format("a mesh of {} x {} texels", texture.width, texture.height));
  BindMesh bind;
  bind.inner = row_points(context, model, RowChoice::kInner);
  bind.mesh.positions = place_vertices(context, model, bind.inner);
  bind.mesh.triangles = triangulate(context, model, bind.inner);
  const std::vector<Triangle> ends = end_triangles(model, bind.mesh.positions);
  bind.mesh.triangles.insert(bind.mesh.triangles.end(), ends.begin(), ends.end());
  return bind;
}

TriangleMesh reconstruct_mesh(ClContext& context, const PreparedModel& model) {
  return in_user_units(reconstruct_bind_mesh(context, model).mesh, model.model.skeleton.frame);
}

}  // namespace skeletex
