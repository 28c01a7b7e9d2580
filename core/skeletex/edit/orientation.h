// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/edit/move_surface.h"

namespace skeletex {

/// What pulls a surface towards the mean of the ways that its sources face, vertex by vertex.
struct OrientationPull {
  DeviceField rotations;    ///< four planes, unit quaternions w, x, y, z: the surface to that mean; little where a source is mapped with folds
  DeviceField normals;  ///< of the rotated surface
  DeviceField b;        ///< scale^2 (D - L x): D is L x with the edges rotated, and at seams as steep as the sources'
                        ///< (kernels/orientation.cl)
};
/// \param sources  per source the place of each vertex on it, world units; how a source lies and faces as a whole does not count
/// \param weights  one per source, of sum 1
/// \param scale    diagonals
OrientationPull pull_orientations(ClContext& context, const SkeletexModel& model, const ModelSurface& surface, const SurfaceOperator& laplace,
                                  std::span<const std::vector<Vec3>> sources, std::span<const double> weights, double scale);

/// A morphed model whose surface is smooth across seams where its sources' are. Bones turn by different angles between
/// the sources, so averaged texels meet at creases. Here every edge is rotated to the mean orientation of its ends, and
/// the surface is the one with such edges (as-rigid-as-possible shapes of given rotations, Sorkine and Alexa 2007) that
/// keeps to the given one over distances of a tenth of the diagonal: (M + scale^2 L) x' = M x + scale^2 D.
/// At a weight of 1 nothing moves.
MovedModel blend_orientations(ClContext& context, const SkeletexModel& model, std::span<const std::vector<Vec3>> sources, std::span<const double> weights);

}  // namespace skeletex
