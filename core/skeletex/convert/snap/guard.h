// SPDX-License-Identifier: MIT
#pragma once
#include <future>
#include <memory>

#include "skeletex/convert/snap/lattice_mesh.h"
#include "skeletex/convert/snap/snap.h"
#include "skeletex/convert/snap/vertex_distances.h"
#include "skeletex/geometry/mesh.h"
#include "skeletex/geometry/triangle_tree.h"
#include "skeletex/model/texture.h"

namespace skeletex {

/// What the guard needs that depends on the layout alone, not on where texels read.
struct GuardFrame {
  std::shared_ptr<const LatticeFrame> lattice;
  PlacedVertices vertices;  ///< of the original
};
/// \param model   all but its texels
/// \param charts  per patch, of VSM patches with their maps
GuardFrame frame_guard(const SkeletexModel& model, std::span<const Chart> charts);

/// What the guard of the finished lattice compares.
struct GuardSources {
  const SkeletexModel& model;            ///< all but its texels: layout, seams, rule of diagonals
  const TriangleMesh& mesh;              ///< the original
  const TriangleTree* tree;              ///< of its triangles; null: it is built
  std::span<const Chart> charts;         ///< its maps
  std::shared_future<GuardFrame> frame;  ///< of that model and those maps; waited for
};

struct GuardReport {
  int texels_put_back = 0;
  /// That look against the mesh: of the VSM patches' lattice, and of the even one, there but for its strips and fans.
  int turned_triangles = 0, even_turned_triangles = 0;
  std::vector<int> anchors;  ///< per texel what holds it now, see ReadingPositions
};

/// Looks at the very mesh that the decoder will make, strips at seams included. Texels go back to the regular grid
///  - where its triangles intersect, or look against the original,
///  - where it is further from the original, or the original's vertices from it, than (nearly) the regular grid
///  anywhere,
/// and with them what then folds. Repeated until nothing is left, so that neither the maximum nor those numbers rise
/// above the even lattice's. Where the regular grid has the same faults, and not clearly fewer, they are left.
class Guard {
 public:
  /// Measures the regular grid, for the most part on a thread of its own: the context is the guard's alone. All that is
  /// given by reference must outlive the guard. \param even_triangles  per texel a triangle of the map near it, of the
  /// regular grid \param even            the regular grid's points \param filtered        these as they would be
  /// stored: what texels go back to
  Guard(ClContext& context, const GuardSources& sources, const DeviceLayout& layout, const DeviceMaps& maps,
        ClBuffer<int> even_triangles, TexelPoints even, TexelPoints filtered);
  ~Guard();
  /// Can be called once.
  /// \param context        another queue than the guard's, beside which it goes on; it has come by what these are
  /// \param vertex_points  of the features' vertices, see SnapFeatures; none where nothing is snapped
  /// \param triangles      as even_triangles, of the points
  GuardReport put_back_faults(ClContext& context, std::span<const int> vertex_points, const ClBuffer<int>& triangles,
                              ReadingPositions& positions, TexelPoints& points);

 private:
  struct Even;
  std::unique_ptr<Even> even_;
};

}  // namespace skeletex
