// SPDX-License-Identifier: MIT
#pragma once
#include <vector>

#include "skeletex/edit/filter/diffusion.h"
#include "skeletex/model/texture.h"

namespace skeletex {

/// A model's bind pose as a surface on the device: the vertices of its lattice and who is next to whom.
struct ModelSurface {
  Lattice lattice;
  std::vector<Vec3> positions;  ///< world
  DeviceNeighbours neighbours;
  DeviceField points;  ///< relative to the model's origin, in diagonals
};
ModelSurface upload_surface(ClContext& context, const SkeletexModel& model);

/// Unit normals at the vertices, outward: the mean over the triangles around each, by area.
std::vector<Vec3> vertex_normals(ClContext& context, const ModelSurface& surface);

struct CurvatureResult {
  std::vector<float> mean_curvature;  ///< per vertex, 1 / world unit: half the sum of the two; positive where convex
  double scale = 0;                   ///< diagonals: what it is averaged over
  SolveReport solver;
};
/// Mean curvature: the mean curvature normal, (M + scale^2 L)^-1 L x, which is averaged over distances of about `scale`
/// and therefore sees no lattice, along the normal.
/// \param scale  diagonals; 0: three times the mean spacing of vertices
CurvatureResult mean_curvature(ClContext& context, const SkeletexModel& model, const ModelSurface& surface,
                               double scale = 0);

/// The mean distance between neighbouring vertices: the root of a vertex's share of the area. Diagonals.
double mean_spacing(ClContext& context, const SurfaceOperator& surface);

}  // namespace skeletex
