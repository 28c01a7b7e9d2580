// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <span>
#include <vector>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// The edges of a mesh between two triangles.
struct SurfaceEdges {
  std::vector<std::array<int, 2>> vertices;   ///< the lower first
  std::vector<std::array<int, 2>> triangles;  ///< at each edge
  std::vector<double> bends;                  ///< degrees by which the surface turns over each edge, 0 to 180
};
SurfaceEdges surface_edges(const TriangleMesh& mesh);
/// The edges over which the surface turns by more than 90 degrees, and did not in the bind pose.
/// \param edges  of the bind pose
/// \param positions  of the mesh's vertices in the pose
std::vector<int> new_folds(const TriangleMesh& bind, const SurfaceEdges& edges, std::span<const Vec3> positions);

/// What is measured of a mesh in its bind pose, once for all its poses.
struct BindSurface {
  TriangleMesh mesh;
  SurfaceEdges edges;
  std::vector<std::array<int, 2>> intersections;  ///< pairs of triangles, sorted
};
/// \pre indices in range, coordinates finite
BindSurface make_bind_surface(TriangleMesh mesh);

/// Symmetric Dirichlet energy (|J|^2 + |J^-1|^2) / 4 of the map of a triangle from the bind pose (Smith and Schaefer,
/// Bijective Parameterization with Free Boundaries, 2015): 1 where nothing is stretched.
struct TriangleEnergy {
  double energy = 1;
  double area = 0;  ///< in the bind pose
};
/// Of the triangles that have an area in the bind pose. One that is pressed to nothing counts as 1e6.
std::vector<TriangleEnergy> triangle_energies(const BindSurface& bind, std::span<const Vec3> positions);
/// What a share of the area lies below.
/// \param share  0 to 1
/// \return 1 when there are none
double energy_below(std::vector<TriangleEnergy> energies, double share);

/// How far a pose has spoilt a surface.
struct DeformationReport {
  long new_folds = 0;          ///< edges over which it turns by more than 90 degrees, and did not in the bind pose
  long new_intersections = 0;  ///< pairs of triangles that intersect, and did not
  double energy_mean = 1, energy_99 = 1;  ///< of triangles, by area: mean, and what 99 % lies below
  double volume_ratio = 1;                ///< enclosed volume over that of the bind pose
};
/// \param positions  of the bind mesh's vertices in the pose
/// \throw InputError when their number differs
DeformationReport measure_deformation(const BindSurface& bind, std::span<const Vec3> positions);

/// What a share of some edges' added bends lies below, degrees: bends in the pose less those of the bind pose.
/// \param is_chosen  per edge of the bind surface
/// \param share  0 to 1
/// \return 0 when no edge is chosen
double added_bend(const BindSurface& bind, std::span<const Vec3> positions, const std::vector<bool>& is_chosen,
                  double share);

}  // namespace skeletex
