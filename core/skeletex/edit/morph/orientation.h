// SPDX-License-Identifier: MIT
#pragma once
#include <Eigen/Geometry>
#include <span>
#include <vector>

#include "skeletex/edit/filter/move_surface.h"

namespace skeletex {

/// x^2 (3 - 2 x) with x clamped to 0 .. 1.
double smooth_step(double x);

/// A surface whose orientation another one takes, vertex by vertex.
struct OrientationSource {
  DeviceField points;                         ///< each vertex's place on it; it may lie anywhere as a whole
  std::vector<float> weights;                 ///< per vertex; the sources' weights sum to 1
  std::vector<Eigen::Quaternionf> rotations;  ///< per row of the neighbours' table, applied to the source first
};
/// A source with one weight for all vertices, rotated as a whole to the best fit with the surface.
/// \param source  each vertex's place on it, world units
OrientationSource whole_source(ClContext& context, const SkeletexModel& model, const ModelSurface& surface,
                               const SurfaceOperator& laplace, const std::vector<Vec3>& source, double weight);

/// Rotations of a surface to the mean orientation of its sources, and the right-hand side that follows from them.
struct OrientationPull {
  DeviceField rotations;  ///< unit quaternions w, x, y, z; near the identity where the map to a source folds
  DeviceField normals;    ///< of the rotated surface
  DeviceField b;  ///< scale^2 (D - L x), where D is L x with rotated edges whose slopes at seams are the sources'
                  ///< (kernels/orientation.cl)
};
/// \param row_shares  per row of the neighbours' table, from 0 (no rotation) to 1
/// \param scale       diagonals
OrientationPull pull_orientations(ClContext& context, const ModelSurface& surface, const SurfaceOperator& laplace,
                                  std::span<const OrientationSource> sources, const std::vector<float>& row_shares,
                                  double scale);
/// Shares of the rows that fall to 0 at free ends, which therefore keep the orientation of their texels: a source may
/// have no such tip.
std::vector<float> shares_without_tips(const SkeletexModel& model, const Lattice& lattice);

/// A morphed model without creases at its seams. Bones turn by different angles between the sources, so that averaged
/// texels meet at creases. Here every edge is rotated by the mean of the rotations at its ends, and the surface with
/// such edges is solved for (as-rigid-as-possible surfaces for given rotations, Sorkine and Alexa 2007). It stays near
/// the given one over distances of a tenth of the diagonal: (M + scale^2 L) x' = M x + scale^2 D.
/// At a weight of 1 nothing moves.
/// \param sources  per model, each vertex's place on it, world units; empty where the weight is 0
MovedModel blend_orientations(ClContext& context, const SkeletexModel& model,
                              std::span<const std::vector<Vec3>> sources, std::span<const double> weights);

}  // namespace skeletex
