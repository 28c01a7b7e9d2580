// SPDX-License-Identifier: MIT
#pragma once
#include <Eigen/Geometry>
#include <span>
#include <vector>

#include "skeletex/edit/filter/move_surface.h"

namespace skeletex {

/// A surface that another one shall look like, vertex by vertex.
struct OrientationSource {
  DeviceField points;                         ///< the place of each vertex on it; as a whole it may lie anywhere
  std::vector<float> weights;                 ///< per vertex; those of all sources have the sum 1
  std::vector<Eigen::Quaternionf> rotations;  ///< per row of the neighbours' table: how it is to be turned first
};
/// A source with one weight for all vertices, turned as a whole to face as the surface does.
/// \param source  the place of each vertex on it, world units
OrientationSource whole_source(ClContext& context, const SkeletexModel& model, const ModelSurface& surface,
                               const SurfaceOperator& laplace, const std::vector<Vec3>& source, double weight);

/// What pulls a surface towards the mean of the ways that its sources face, vertex by vertex.
struct OrientationPull {
  DeviceField rotations;  ///< four planes, unit quaternions w, x, y, z: the surface to that mean; little where a source
                          ///< is mapped with folds
  DeviceField normals;    ///< of the rotated surface
  DeviceField b;          ///< scale^2 (D - L x): D is L x with the edges rotated, and at seams as steep as the sources'
                          ///< (kernels/orientation.cl)
};
/// \param row_shares  per row of the neighbours' table, how much of the rotations counts there
/// \param scale       diagonals
OrientationPull pull_orientations(ClContext& context, const ModelSurface& surface, const SurfaceOperator& laplace,
                                  std::span<const OrientationSource> sources, const std::vector<float>& row_shares,
                                  double scale);
/// Per row, so that tips, which some sources may not have, keep the orientation of their texels.
std::vector<float> shares_without_tips(const SkeletexModel& model, const Lattice& lattice);

/// A morphed model whose surface is smooth across seams where its sources' are. Bones turn by different angles between
/// the sources, so averaged texels meet at creases. Here every edge is rotated to the mean orientation of its ends, and
/// the surface is the one with such edges (as-rigid-as-possible shapes of given rotations, Sorkine and Alexa 2007) that
/// keeps to the given one over distances of a tenth of the diagonal: (M + scale^2 L) x' = M x + scale^2 D.
/// At a weight of 1 nothing moves.
MovedModel blend_orientations(ClContext& context, const SkeletexModel& model,
                              std::span<const std::vector<Vec3>> sources, std::span<const double> weights);

}  // namespace skeletex
