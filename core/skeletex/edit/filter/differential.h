// SPDX-License-Identifier: MIT
#pragma once
#include <vector>

#include "skeletex/edit/filter/diffusion.h"
#include "skeletex/model/texture.h"

namespace skeletex {

/// A model's bind pose as a surface on the device: the vertices of its lattice and their neighbours.
struct ModelSurface {
  Lattice lattice;
  std::vector<Vec3> positions;  ///< world units
  DeviceNeighbours neighbours;
  DeviceField points;  ///< relative to the model's origin, in diagonals

  /// The first vertex on a seam; all later ones lie on seams, too.
  int first_seam() const { return lattice.first_sample.empty() ? lattice.vertex_count : lattice.first_sample[0]; }
};
ModelSurface upload_surface(ClContext& context, const SkeletexModel& model);

/// Outward unit normals of the vertices: the mean over the triangles around each, by area.
std::vector<Vec3> vertex_normals(ClContext& context, const ModelSurface& surface);

struct CurvatureResult {
  std::vector<float> mean_curvature;  ///< per vertex, 1 / world unit; positive where convex
  double scale = 0;                   ///< the distance that it is averaged over, diagonals
  SolveReport solver;
};
/// The mean curvature: the part along the normal of the mean curvature normal (M + scale^2 L)^-1 L x, which is averaged
/// over distances of about `scale`.
/// \param scale  diagonals; 0: three times the mean spacing of vertices
CurvatureResult mean_curvature(ClContext& context, const SkeletexModel& model, const ModelSurface& surface,
                               double scale = 0);

/// The mean distance between neighbouring vertices, diagonals: the root of a vertex's share of the area.
double mean_spacing(ClContext& context, const SurfaceOperator& surface);

}  // namespace skeletex
