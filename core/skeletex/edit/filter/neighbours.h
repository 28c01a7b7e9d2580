// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <memory>
#include <span>
#include <vector>

#include "skeletex/device/context.h"
#include "skeletex/reconstruct/lattice.h"
#include "surface_structs.h"

namespace skeletex {

/// The neighbours of the vertices of a model's lattice (lattice.h), across patches.
///
/// Inside a patch, vertex (row, column) of the inner rows has the eight around it, and columns wrap. At the ends of
/// patches, where they meet seams and poles, each vertex has a fan: its triangles outside the quads between inner rows.
/// The triangles on both sides of a seam are in one fan. A pole is one vertex.
struct Neighbours {
  std::vector<SurfaceRow> rows;  ///< the inner rows of all patches
  /// Vertices increase: first and last inner rows, poles, seam samples, corners. The last entry is no vertex: it has
  /// the number of fans' triangles.
  std::vector<FanVertex> fan_vertices;
  /// The other two corners of each triangle, counter-clockwise, in order around the vertex. The fan of a pole, a sample
  /// or a corner is closed: the first corners of its triangles are the vertex's neighbours, each once.
  std::vector<std::array<int, 2>> fans;
  int inner_count = 0;
  int vertex_count = 0;
};

/// \param end_triangles  of reconstruct_mesh.h
Neighbours find_neighbours(const SkeletexModel& model, const Lattice& lattice, std::span<const Triangle> end_triangles);

struct DeviceCoarseLattice;

/// The tables on the device; see kernels/filter.cl.
struct DeviceNeighbours {
  ClBuffer<SurfaceRow> rows;
  ClBuffer<ColumnBlock> column_blocks;
  ClBuffer<FanVertex> fan_vertices;
  ClBuffer<std::array<int, 2>> fans;
  int inner_count = 0, vertex_count = 0;
  std::shared_ptr<const DeviceCoarseLattice> coarser;  ///< for solvers; may be missing

  int fan_count() const { return static_cast<int>(fan_vertices.size) - 1; }
  /// The counts that kernels take; all else is 0.
  SurfaceParameters parameters(int components) const;
};
/// One work-group per row, and one per FAN_CHUNK fan vertices.
ClRange rows_range(const ClContext& context, const DeviceNeighbours& neighbours);
ClRange fans_range(const ClContext& context, const DeviceNeighbours& neighbours);

/// The next level of a solver (coarsen.h): the coarser lattice's neighbours, and the interpolation between the two.
struct DeviceCoarseLattice {
  DeviceNeighbours neighbours;
  ClBuffer<int> picks;  ///< see CoarseLattice
  ClBuffer<std::array<int, 4>> sources;
  ClBuffer<std::array<float, 4>> shares;
  /// The transpose of the interpolation: per vertex of the coarser lattice, the finer vertices that read it.
  ClBuffer<int> reader_begin, readers;
  ClBuffer<float> reader_shares;
};
/// The levels below a model's lattice, down to some hundred vertices; nullptr when there are none.
std::shared_ptr<const DeviceCoarseLattice> upload_coarser(ClContext& context, const SkeletexModel& model,
                                                          const Lattice& lattice, const std::vector<Vec3>& positions);

DeviceNeighbours upload_neighbours(ClContext& context, const Neighbours& neighbours);

/// Sets the values of the poles of the chosen bones to 1, and those of the seam vertices all of whose bones are chosen.
void mark_ends(const SkeletexModel& model, const Lattice& lattice, const std::vector<bool>& is_chosen,
               std::vector<float>& values);

}  // namespace skeletex
