// SPDX-License-Identifier: MIT
#include "skeletex/edit/filter/move_surface.h"

#include <algorithm>
#include <cmath>

#include "skeletex/reconstruct/store_positions.h"

namespace skeletex {
namespace {

/// Moves the surface along with seams that slide over it, so that the rows next to a seam keep their distance from it.
/// The slides fade out with the distance from the seam, in the tangent planes. Vertices that have not moved stay.
void spread_slides(ClContext& context, const SkeletexModel& model, const ModelSurface& surface,
                   const SurfaceOperator& laplace, std::span<const Vec3> normals, std::span<const Vec3> moves,
                   std::span<const Vec3> slides, MoveReport& report, std::vector<Vec3>& positions) {
  const int first_seam = surface.first_seam();
  const double range = std::max(4 * report.largest_slide, 2 * mean_spacing(context, laplace));
  std::vector<float> is_free(positions.size());
  for (int i = 0; i < static_cast<int>(is_free.size()); ++i) is_free[i] = i < first_seam && moves[i] != Vec3::Zero();
  const SolveResult solved = interpolate_field(context, laplace, range * range, is_free,
                                               upload_points(context, slides, Vec3::Zero(), -model.diagonal));
  add_solve({solved.report.steps, 0}, report.solver);
  const std::vector<Vec3> spread = download_vectors(context, solved.x);
  for (int i = 0; i < first_seam; ++i) {
    const Vec3 slide = model.diagonal * spread[i];
    positions[i] += slide - normals[i].dot(slide) * normals[i];
  }
}

}  // namespace

std::vector<Vec3> area_vectors_at(ClContext& context, const SkeletexModel& model, const ModelSurface& surface,
                                  std::span<const Vec3> positions) {
  std::vector<Vec3> vectors = download_vectors(
      context,
      area_vectors(context, surface.neighbours, upload_points(context, positions, model.origin, model.diagonal)));
  for (Vec3& vector : vectors) vector *= model.diagonal * model.diagonal;
  return vectors;
}

double enclosed_volume(const SkeletexModel& model, std::span<const Vec3> positions, std::span<const Vec3> vectors) {
  double volume = 0;
  for (std::size_t i = 0; i < positions.size(); ++i) volume += (positions[i] - model.origin).dot(vectors[i]) / 3;
  return volume;
}

MovedModel move_surface(ClContext& context, const SkeletexModel& model, const ModelSurface& surface,
                        const SurfaceOperator& laplace, std::span<const Vec3> moves) {
  const std::vector<Vec3>& before = surface.positions;
  MoveReport report;
  std::vector<Vec3> moved = before;
  for (std::size_t i = 0; i < moved.size(); ++i) moved[i] += moves[i];
  std::vector<Vec3> normals = area_vectors_at(context, model, surface, moved);
  report.volume_after = enclosed_volume(model, moved, normals);
  for (Vec3& normal : normals) normal.normalize();

  std::vector<Vec3> after = moved;
  const PreparedModel prepared(model);
  slide_to_separation(prepared, normals, after);
  std::vector<Vec3> slides(after.size(), Vec3::Zero());
  for (std::size_t i = 0; i < after.size(); ++i) {
    if (moved[i] == before[i])
      after[i] = before[i];  // its place in the separation plane is only as exact as its stored angle
    slides[i] = after[i] - moved[i];
    report.largest_slide = std::max(report.largest_slide, slides[i].norm() / model.diagonal);
  }
  if (report.largest_slide > 0) spread_slides(context, model, surface, laplace, normals, moves, slides, report, after);

  const std::vector<float> areas = context.download(laplace.mass);
  double area = 0;
  for (std::size_t i = 0; i < after.size(); ++i) {
    const double move = (moved[i] - before[i]).norm() / model.diagonal;
    report.largest_move = std::max(report.largest_move, move);
    report.mean_move += static_cast<double>(areas[i]) * move;
    area += static_cast<double>(areas[i]);
  }
  report.mean_move /= area;
  return {store_positions(context, prepared, after), report};
}

}  // namespace skeletex
