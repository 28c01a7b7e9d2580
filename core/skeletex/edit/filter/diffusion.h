// SPDX-License-Identifier: MIT
#pragma once
#include <memory>
#include <span>
#include <vector>

#include "skeletex/device/context.h"
#include "skeletex/edit/filter/neighbours.h"
#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// Values per vertex on the device: one or three planes behind each other.
struct DeviceField {
  int components = 0;
  ClBuffer<float> values;
};

/// The surface's Laplace operator on the device: weights L (cotangents; symmetric, positive semi-definite, zero for
/// constants) and areas M of the vertices. Both triangulations of a quad count half each, and M L are those of the
/// surface, not of the texture: where the lattice is dense, at poles and at seams, makes no difference beyond its
/// error. Unit of length: as the points'.
struct SurfaceOperator {
  const DeviceNeighbours* neighbours = nullptr;  ///< must outlive this
  ClBuffer<float> weights;                       ///< four planes: see weigh_rows in kernels/filter.cl
  ClBuffer<float> fan_weights;                   ///< two per triangle of the fans
  ClBuffer<float> mass, stiffness;
  std::shared_ptr<const SurfaceOperator> coarser;  ///< on the neighbours' coarser lattice, where there is one
};
/// \param points  positions, three components
SurfaceOperator make_surface_operator(ClContext& context, const DeviceNeighbours& neighbours,
                                      const DeviceField& points);

/// (mass_share M + time L) x on the device; 0 where is_free is 0.
DeviceField apply_operator(ClContext& context, const SurfaceOperator& surface, float mass_share, float time,
                           const ClBuffer<float>& is_free, const DeviceField& x);

struct SolveReport {
  int steps = 0;
  double residual = 0;  ///< what is left of the right-hand side, preconditioned
};
struct SolveResult {
  DeviceField x;
  SolveReport report;
};
/// Solves (M + time L) x = b where is_free is 1, with x = 0 elsewhere: by conjugate gradients on the device, in single
/// precision. With b = M f, x is f diffused over distances of about sqrt(time).
/// Rows and columns of all levels serve as preconditioners: some 50 steps at 512, and half as many again at twice the
/// size; the time and the density of rings at poles count for little.
/// \param tolerance  of the residual
/// \throw InputError when the weights are no finite numbers
SolveResult solve_diffusion(ClContext& context, const SurfaceOperator& surface, float time,
                            const ClBuffer<float>& is_free, const DeviceField& b, double tolerance = 1e-5,
                            int most_steps = 2000);

/// Each vertex's third of the area vectors around it, outward: normals times area shares, three components.
DeviceField area_vectors(ClContext& context, const DeviceNeighbours& neighbours, const DeviceField& points);

/// Positions as a field: (p - origin) / unit.
DeviceField upload_points(ClContext& context, std::span<const Vec3> positions, const Vec3& origin, double unit);
/// A field of three components as vectors.
std::vector<Vec3> download_vectors(ClContext& context, const DeviceField& field);

}  // namespace skeletex
