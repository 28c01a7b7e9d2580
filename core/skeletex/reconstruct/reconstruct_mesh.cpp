// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/reconstruct_mesh.h"

#include <algorithm>

#include "reconstruct_structs.h"
#include "skeletex/reconstruct/displace.h"
#include "skeletex/reconstruct/lattice.h"
#include "skeletex/reconstruct/seam_strip.h"
#include "skeletex/skeleton/frame.h"

namespace skeletex {
namespace {

/// The end of a bone that lies at a node.
BoneEnd end_at(const Skeleton& skeleton, int bone, int node) {
  return skeleton.bones[bone].head == node ? BoneEnd::kHead : BoneEnd::kTail;
}

Vec3 sample_point(const Skeleton& skeleton, const SeparationPlanes& separation, int node, int bone,
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
                   const std::function<void(int vertex, int bone, int end, std::size_t texel)>& place) {
  for (int bone = 0; bone < static_cast<int>(model.patches.size()); ++bone)
    for (int end = 0; end < 2; ++end) {
      if (lattice.poles[bone][end] < 0) continue;
      const Rectangle& r = model.patches[bone].rectangle;
      place(lattice.poles[bone][end], bone, end,
            static_cast<std::size_t>(r.y + (end == 0 ? 0 : r.height - 1)) * model.texture.width + r.x);
    }
}

void place_shared_vertices(const SkeletexModel& model, const SeparationPlanes& separation, const Lattice& lattice,
                           std::vector<Vec3>& positions) {
  const DisplacementTexture& texture = model.texture;
  for_each_pole(model, lattice, [&](int vertex, int bone, int end, std::size_t texel) {
    positions[vertex] = decode_texel(tangent_frame(model.skeleton, separation, bone, end, 0),
                                     Vec3(texture.along[texel], texture.around[texel], texture.out[texel]),
                                     end_position(model.skeleton, bone, BoneEnd::kHead),
                                     end_position(model.skeleton, bone, BoneEnd::kTail));
  });
  place_seams(model, separation, lattice, positions);
}

DevicePlanes displace_inner(ClContext& context, const SkeletexModel& model, const SeparationPlanes& separation,
                            const Lattice& lattice) {
  DevicePlanes points = allocate_planes(context, lattice.inner_count);
  displace(context,
           upload_lattice(context, frame_tables(model.skeleton, separation, model.patches, model.origin), model.patches,
                          model.texture, RowChoice::kInner),
           points);
  return points;
}

namespace {

std::vector<Vec3> place_vertices(ClContext& context, const SkeletexModel& model, const SeparationPlanes& separation,
                                 const Lattice& lattice, const DevicePlanes& inner) {
  std::vector<Vec3> positions(lattice.vertex_count);
  place_shared_vertices(model, separation, lattice, positions);
  download_points(context, inner, model.origin, positions);
  return positions;
}

}  // namespace

std::vector<Vec3> lattice_positions(ClContext& context, const SkeletexModel& model) {
  const Lattice lattice = number_lattice(model);
  const SeparationPlanes separation(model.skeleton);
  return place_vertices(context, model, separation, lattice, displace_inner(context, model, separation, lattice));
}

std::vector<Triangle> end_triangles(const SkeletexModel& model, const Lattice& lattice,
                                    const std::vector<Vec3>& positions) {
  const SeparationPlanes separation(model.skeleton);
  std::vector<Triangle> triangles;
  for (int bone = 0; bone < static_cast<int>(model.patches.size()); ++bone)
    for (const BoneEnd which : {BoneEnd::kHead, BoneEnd::kTail})
      append_end_triangles(model, lattice, positions, end_seam(model, separation, lattice, positions, bone, which),
                           bone, which, triangles);
  return triangles;
}

EndSeam end_seam(const SkeletexModel& model, const SeparationPlanes& separation, const Lattice& lattice,
                 std::span<const Vec3> positions, int bone, BoneEnd end) {
  EndSeam seam;
  if (lattice.poles[bone][static_cast<int>(end)] >= 0) return seam;
  seam.ring.vertices = end_loop(model, lattice, bone, end);
  std::vector<Vec3> points;
  for (const int vertex : seam.ring.vertices) {
    points.push_back(positions[vertex]);
    seam.ring.turns.push_back(separation.turn_of(bone, points.back() - end_position(model.skeleton, bone, end)));
  }
  seam.turns = seam_turns(points, seam.ring.turns);
  return seam;
}

void append_end_triangles(const SkeletexModel& model, const Lattice& lattice, std::span<const Vec3> positions,
                          const EndSeam& seam, int bone, BoneEnd end, std::vector<Triangle>& triangles) {
  if (seam.ring.vertices.empty()) {
    append_pole_fan(model, lattice, bone, end, triangles);
    return;
  }
  Ring row{end_row(model, lattice, bone, end), {}};
  for (std::size_t j = 0; j < row.vertices.size(); ++j)
    row.turns.push_back(static_cast<double>(j) / static_cast<double>(row.vertices.size()));
  append_seam_strip(positions, seam.ring, seam.turns, row, end, triangles);
}

DeviceQuads upload_quads(ClContext& context, const SkeletexModel& model, const SeparationPlanes& separation) {
  std::vector<LatticeRow> rows = lattice_rows(model.patches, RowChoice::kInner);
  std::erase_if(rows, [&](const LatticeRow& row) { return row[1] == model.patches[row[0]].rectangle.height - 2; });
  return {context.upload(rows),
          context.upload(frame_tables(model.skeleton, separation, model.patches, model.origin).patches)};
}

ClBuffer<Triangle> triangulate(ClContext& context, DiagonalRule rule, const DeviceQuads& quads, const Lattice& lattice,
                               const DevicePlanes& inner) {
  // Room for the strips and fans at the end, so that the host's copy need not grow.
  auto triangles = context.allocate<Triangle>(lattice.triangle_count);
  context.launch({"reconstruct.cl", "triangulate"}, row_range(context, quads.rows.size),
                 TriangulateParameters{static_cast<int>(quads.rows.size), static_cast<int>(inner.count),
                                       static_cast<int>(rule == DiagonalRule::kSmooth)},
                 quads.rows, quads.patches, inner.values, triangles);
  return triangles;
}

TriangleMesh reconstruct_mesh(ClContext& context, const SkeletexModel& model) {
  const Lattice lattice = number_lattice(model);
  const SeparationPlanes separation(model.skeleton);
  const DevicePlanes points = displace_inner(context, model, separation, lattice);
  TriangleMesh mesh;
  mesh.positions = place_vertices(context, model, separation, lattice, points);
  mesh.triangles = context.download(
      triangulate(context, model.diagonals, upload_quads(context, model, separation), lattice, points));
  mesh.triangles.resize(2 * static_cast<std::size_t>(lattice.quad_count));
  const std::vector<Triangle> ends = end_triangles(model, lattice, mesh.positions);
  mesh.triangles.insert(mesh.triangles.end(), ends.begin(), ends.end());
  return mesh;
}

}  // namespace skeletex
