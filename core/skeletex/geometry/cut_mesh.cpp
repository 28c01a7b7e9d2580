// SPDX-License-Identifier: MIT
#include "skeletex/geometry/cut_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>

#include "skeletex/geometry/half_edge.h"
#include "skeletex/geometry/half_edge_table.h"
#include "skeletex/geometry/parallel.h"
#include "skeletex/model/error.h"

namespace skeletex {

namespace {

/// Every directed edge once and its opposite as well, and one fan of triangles around each vertex.
bool is_closed_surface(const HalfEdgeTable& table, int vertex_count) {
  for (int h = 0; h < static_cast<int>(table.twins.size()); ++h)
    if (table.twins[h] < 0 || table.twins[table.twins[h]] != h) return false;
  std::atomic<bool> is_closed = true;
  for_each_block(vertex_count, 4096, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      const int valence = table.begin[v + 1] - table.begin[v];
      if (valence == 0) continue;
      const int first = table.outgoing[table.begin[v]];
      int count = 0, h = first;
      do h = table.turn_left(h), ++count;
      while (h != first && count <= valence);
      if (count != valence) is_closed = false;
    }
  });
  return is_closed;
}

bool has_good_triangles(const TriangleMesh& mesh) {
  const int count = static_cast<int>(mesh.positions.size());
  return std::all_of(mesh.triangles.begin(), mesh.triangles.end(), [&](const Triangle& t) {
    return t[0] != t[1] && t[1] != t[2] && t[2] != t[0] &&
           std::all_of(t.begin(), t.end(), [&](int v) { return v >= 0 && v < count; });
  });
}

/// OpenMesh says where.
[[noreturn]] void throw_not_closed(const TriangleMesh& mesh) {
  const HalfEdgeMesh half_edges = build_half_edges(mesh);
  for (const auto h : half_edges.halfedges())
    if (half_edges.is_boundary(h)) {
      const auto& p = half_edges.point(half_edges.from_vertex_handle(h));
      throw InputError(fmt::format("the mesh is not closed: there is a hole at ({:.6g}, {:.6g}, {:.6g}); close it",
                                   p[0], p[1], p[2]));
    }
  throw InputError("the mesh is no closed surface; make it 2-manifold and consistently oriented");
}

}  // namespace

CutMesh cut_mesh_of(const TriangleMesh& mesh) {
  if (!has_good_triangles(mesh)) throw_not_closed(mesh);
  const int count = static_cast<int>(mesh.positions.size());
  const HalfEdgeTable table = link_half_edges(mesh.triangles, count);
  if (!is_closed_surface(table, count)) throw_not_closed(mesh);
  CutMesh cut;
  cut.positions = mesh.positions;
  // A triangle's last corner comes first, as in OpenMesh: results and messages stay those of earlier versions to the
  // last digit.
  cut.origins.resize(table.twins.size()), cut.opposites.resize(table.twins.size());
  for (int h = 0; h < static_cast<int>(table.twins.size()); ++h) {
    const int at = CutMesh::next(h);
    cut.origins[at] = mesh.triangles[h / 3][h % 3];
    cut.opposites[at] = CutMesh::next(table.twins[h]);
  }
  cut.seams.assign(cut.origins.size(), -1);
  return cut;
}

void split_edge(CutMesh& mesh, int half_edge) {
  const int sides[2] = {half_edge, mesh.opposites[half_edge]};
  const int middle = static_cast<int>(mesh.positions.size());
  mesh.positions.push_back(0.5 * (mesh.positions[mesh.origins[sides[0]]] + mesh.positions[mesh.origins[sides[1]]]));
  int second_part[2];
  for (int k = 0; k < 2; ++k) {
    // Triangle a b c over the side a b becomes a m c and m b c.
    const int ab = sides[k], bc = CutMesh::next(ab), ca = CutMesh::next(bc);
    const int mb = static_cast<int>(mesh.origins.size());
    mesh.origins.insert(mesh.origins.end(), {middle, mesh.origins[bc], mesh.origins[ca]});
    mesh.opposites.insert(mesh.opposites.end(), {-1, mesh.opposites[bc], bc});
    mesh.seams.insert(mesh.seams.end(), {mesh.seams[ab], mesh.seams[bc], -1});
    mesh.opposites[mesh.opposites[bc]] = mb + 1;
    mesh.origins[bc] = middle;
    mesh.opposites[bc] = mb + 2;
    mesh.seams[bc] = -1;
    second_part[k] = mb;
  }
  for (int k = 0; k < 2; ++k) {
    mesh.opposites[sides[k]] = second_part[1 - k];
    mesh.opposites[second_part[1 - k]] = sides[k];
  }
}

}  // namespace skeletex
