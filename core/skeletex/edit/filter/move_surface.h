// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/edit/filter/differential.h"

namespace skeletex {

struct MoveReport {
  double largest_move = 0, mean_move = 0;  ///< diagonals; the mean over the area
  double largest_slide = 0;  ///< diagonals: how far a seam slides over the surface to stay in its separation plane
  double volume_after = 0;   ///< world units cubed
  SolveReport solver;
};
struct MovedModel {
  SkeletexModel model;
  MoveReport report;
};

/// The model with its surface moved. Seams stay in their separation planes: they slide over the moved surface, and the
/// rows next to them follow. What does not move stays bit by bit.
/// \param laplace  the operator of `surface`
/// \param moves  per vertex, world units
MovedModel move_surface(ClContext& context, const SkeletexModel& model, const ModelSurface& surface,
                        const SurfaceOperator& laplace, std::span<const Vec3> moves);

/// Area vectors (diffusion.h) of the surface with its vertices at given positions; world units squared.
std::vector<Vec3> area_vectors_at(ClContext& context, const SkeletexModel& model, const ModelSurface& surface,
                                  std::span<const Vec3> positions);
/// The volume inside of the surface, world units cubed.
/// \param vectors  of area_vectors_at there
double enclosed_volume(const SkeletexModel& model, std::span<const Vec3> positions, std::span<const Vec3> vectors);

}  // namespace skeletex
