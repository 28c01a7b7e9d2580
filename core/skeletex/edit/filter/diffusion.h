// SPDX-License-Identifier: MIT
#pragma once
#include <memory>
#include <span>
#include <vector>

#include "skeletex/device/context.h"
#include "skeletex/edit/filter/neighbours.h"
#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// Values per vertex on the device: one plane per component, plane behind plane.
struct DeviceField {
  int components = 0;
  ClBuffer<float> values;
};

/// The Laplace operator of a surface on the device: cotangent weights L (symmetric, positive semi-definite, 0 for
/// constants) and the areas M of the vertices. Both triangulations of a quad count half each. The operator depends on
/// the surface, not on the density of the lattice. Its unit of length is that of the points.
struct SurfaceOperator {
  const DeviceNeighbours* neighbours = nullptr;    ///< must outlive this
  ClBuffer<float> weights;                         ///< four planes: see weigh_rows in kernels/filter.cl
  ClBuffer<float> fan_weights;                     ///< two per triangle of the fans
  ClBuffer<float> mass, stiffness;                 ///< per vertex: M, and the sum of its weights
  std::shared_ptr<const SurfaceOperator> coarser;  ///< on the coarser lattice, where there is one
};
/// \param points  positions, three components
SurfaceOperator make_surface_operator(ClContext& context, const DeviceNeighbours& neighbours,
                                      const DeviceField& points);

/// (mass_share M + time L) x; 0 where is_free is 0.
DeviceField apply_operator(ClContext& context, const SurfaceOperator& surface, float mass_share, float time,
                           const ClBuffer<float>& is_free, const DeviceField& x);

struct SolveReport {
  int steps = 0;
  double residual = 0;  ///< relative to the right-hand side, preconditioned
};
struct SolveResult {
  DeviceField x;
  SolveReport report;
};
/// Solves (M + time L) x = b where is_free is 1, with x = 0 elsewhere, by conjugate gradients in single precision. With
/// b = M f, x is f diffused over distances of about sqrt(time). The preconditioner solves along rows and columns on all
/// levels: a model of 512 takes some 50 steps, one of 1024 some 75.
/// \pre b has one component or three
/// \throw InputError when the weights are not finite
SolveResult solve_diffusion(ClContext& context, const SurfaceOperator& surface, float time,
                            const ClBuffer<float>& is_free, const DeviceField& b, double tolerance = 1e-5,
                            int most_steps = 2000);

/// Solves (M + time L) x = 0 where is_free is 1, with given values elsewhere: interpolation that decays over distances
/// of about sqrt(time).
/// \param negated  minus the given values; 0 where is_free is 1
/// \return x where is_free is 1, 0 elsewhere
SolveResult interpolate_field(ClContext& context, const SurfaceOperator& surface, double time,
                              const std::vector<float>& is_free, const DeviceField& negated);
/// The reports of two solves as one: the sum of the steps, the largest residual.
void add_solve(const SolveReport& solve, SolveReport& all);

/// Area vectors of the vertices, three components: a third of the sum over the triangles around each, outward.
DeviceField area_vectors(ClContext& context, const DeviceNeighbours& neighbours, const DeviceField& points);

/// Positions as a field: (p - origin) / unit.
DeviceField upload_points(ClContext& context, std::span<const Vec3> positions, const Vec3& origin, double unit);
/// A field of three components as vectors.
std::vector<Vec3> download_vectors(ClContext& context, const DeviceField& field);

}  // namespace skeletex
