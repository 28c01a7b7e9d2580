// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/convert/parameterize/chart.h"
#include "skeletex/device/context.h"
#include "skeletex/geometry/triangle_tree.h"
#include "skeletex/reconstruct/lattice.h"

namespace skeletex {

/// How far one bone's part of a surface is from another surface. World units.
struct BoneDistance {
  double mean = 0;            ///< over its area, from the middles of its triangles; or over its vertices
  double median = 0;          ///< of the points measured
  double furthest = 0;        ///< of its vertices and of those middles
  Vec3 place = Vec3::Zero();  ///< where that is
};

/// Of the diagonal: nearer than this is near enough where only what is lost matters.
inline constexpr double kNearEnough = 1e-4;

/// From the parts of the input to the mesh that the decoder makes: what the model lacks.
/// \param mesh    that mesh
/// \param tree    of it
/// \param enough  above 0: distances up to it need not be exact (they are never more than it then), and vertices alone
///                are measured: faster
/// \return per chart
std::vector<BoneDistance> distances_from_bones(ClContext& context, std::span<const Chart> charts,
                                               const TriangleMesh& mesh, const TriangleTree& tree, double enough);

/// From the inner vertices of charts to the mesh of a lattice, on the host. Each vertex is compared first with the quad
/// at its place in the map, which mostly holds it.
/// \param mesh    of the lattice; triangles 2 q and 2 q + 1 are quad q
/// \param tree    of that mesh
/// \param quads   per chart the quads of its inner vertices; empty for a chart whose map is not known
/// \param enough  a quad so near is taken for the nearest; world units
/// \return per chart, in world units; means and medians are over vertices
std::vector<BoneDistance> vertex_distances(std::span<const Chart> charts, const TriangleMesh& mesh,
                                           const TriangleTree& tree, std::span<const std::vector<int>> quads,
                                           double enough);

/// From the parts of that mesh to the input: what the model has and the input has not. The triangles next to seams and
/// poles are not measured.
/// \param lattice  numbers of the mesh's triangles
/// \param tree     of the input
/// \return per patch
std::vector<BoneDistance> distances_to_surface(ClContext& context, const SkeletexModel& model, const Lattice& lattice,
                                               const TriangleMesh& mesh, const TriangleMesh& input,
                                               const TriangleTree& tree);

}  // namespace skeletex
