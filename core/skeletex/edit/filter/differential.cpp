// SPDX-License-Identifier: MIT
#include "skeletex/edit/filter/differential.h"

#include <cmath>
#include <numeric>

#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex {

ModelSurface upload_surface(ClContext& context, const SkeletexModel& model) {
  ModelSurface surface{number_lattice(model), lattice_positions(context, model), {}, {}};
  surface.neighbours =
      upload_neighbours(context, find_neighbours(model, surface.lattice, end_triangles(model, surface.positions)));
  surface.neighbours.coarser = upload_coarser(context, model, surface.lattice, surface.positions);
  surface.points = upload_points(context, surface.positions, model.origin, model.diagonal);
  return surface;
}

std::vector<Vec3> vertex_normals(ClContext& context, const ModelSurface& surface) {
  std::vector<Vec3> normals = download_vectors(context, area_vectors(context, surface.neighbours, surface.points));
  for (Vec3& normal : normals) normal.normalize();
  return normals;
}

double mean_spacing(ClContext& context, const SurfaceOperator& surface) {
  const std::vector<float> mass = context.download(surface.mass);
  return std::sqrt(std::accumulate(mass.begin(), mass.end(), 0.0) / static_cast<double>(mass.size()));
}

CurvatureResult mean_curvature(ClContext& context, const SkeletexModel& model, const ModelSurface& surface,
                               double scale) {
  const SurfaceOperator laplace = make_surface_operator(context, surface.neighbours, surface.points);
  CurvatureResult result;
  result.scale = scale > 0 ? scale : 3 * mean_spacing(context, laplace);
  const auto everywhere = context.upload(std::vector<float>(surface.neighbours.vertex_count, 1.f));
  const DeviceField laplacian = apply_operator(context, laplace, 0, 1, everywhere, surface.points);
  SolveResult solved =
      solve_diffusion(context, laplace, static_cast<float>(result.scale * result.scale), everywhere, laplacian);
  result.solver = solved.report;
  const std::vector<Vec3> curvature_normals = download_vectors(context, solved.x),
                          normals = vertex_normals(context, surface);
  const double unit = model.diagonal * model.skeleton.frame.scale;
  for (std::size_t i = 0; i < normals.size(); ++i)
    result.mean_curvature.push_back(static_cast<float>(0.5 * normals[i].dot(curvature_normals[i]) / unit));
  return result;
}

}  // namespace skeletex
