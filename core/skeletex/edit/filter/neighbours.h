// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <memory>
#include <span>
#include <vector>

#include "skeletex/device/context.h"
#include "skeletex/reconstruct/lattice.h"

namespace skeletex {

/// Who is next to whom on a model's lattice (lattice.h), whichever patches they lie on.
///
/// Inside a patch arithmetic tells: vertex (row, column) of the inner rows has the eight around it, and columns wrap.
/// The ends of patches, where they meet seams and poles, are a table: for each vertex there the triangles outside the
/// quads between inner rows, as fans. A seam vertex has both sides in one fan, a pole is one vertex.
struct Neighbours {
  /// Per inner row of every patch: first vertex, width, whether the rows before and after are inner rows too (0 or 1).
  std::vector<std::array<int, 4>> rows;
  std::vector<int> fan_vertices;  ///< increasing: first and last inner rows, poles, seam samples, corners
  std::vector<int> fan_begin;     ///< per fan vertex its first entry of `fans`, and their number at the end
  /// The other two corners of each triangle, counter-clockwise; in order around the vertex. Of a pole, a sample and a
  /// corner the fan is closed: the first ones of its pairs are its neighbours, each once.
  std::vector<std::array<int, 2>> fans;
  int inner_count = 0;
  int vertex_count = 0;
};

/// \param end_triangles  those of reconstruct_mesh.h: fans and strips
Neighbours find_neighbours(const SkeletexModel& model, const Lattice& lattice, std::span<const Triangle> end_triangles);

struct DeviceCoarseLattice;

/// The table on the device; see kernels/filter.cl.
struct DeviceNeighbours {
  ClBuffer<std::array<int, 4>> rows;
  ClBuffer<std::array<int, 4>> column_blocks;  ///< first vertex in the first inner row, columns, width, inner rows
  ClBuffer<int> fan_vertices, fan_begin;
  ClBuffer<std::array<int, 2>> fans;
  int inner_count = 0, vertex_count = 0;
  std::shared_ptr<const DeviceCoarseLattice> coarser;  ///< for solvers; may be missing
};

/// The next level of a solver's lattice (coarsen.h): its own neighbours, and how values pass between the two.
struct DeviceCoarseLattice {
  DeviceNeighbours neighbours;
  ClBuffer<int> picks;
  ClBuffer<std::array<int, 4>> sources;
  ClBuffer<std::array<float, 4>> shares;
  /// The transpose: per vertex of the coarse lattice the finer ones that read it, with their shares.
  ClBuffer<int> reader_begin, readers;
  ClBuffer<float> reader_shares;
};
/// Levels from a model's lattice down to some hundred vertices.
std::shared_ptr<const DeviceCoarseLattice> upload_coarser(ClContext& context, const SkeletexModel& model,
                                                          const Lattice& lattice, const std::vector<Vec3>& positions);

DeviceNeighbours upload_neighbours(ClContext& context, const Neighbours& neighbours);

}  // namespace skeletex
