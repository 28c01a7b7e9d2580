// SPDX-License-Identifier: MIT
#pragma once
#include <nlohmann/json.hpp>
#include <span>
#include <vector>

#include "skeletex/device/context.h"
#include "skeletex/edit/morph/morph.h"
#include "skeletex/model/texture.h"
#include "skeletex/page/pack.h"

namespace skeletex {

/// A model on the way from one to another.
struct PageKey {
  double t = 0;         ///< 0: the first model, 1: the second
  SkeletexModel model;  ///< with texels
  BlendTables tables;   ///< of both models, also where one has no weight; empty where there is no second model
  EndMoves moves;
};

/// Whether two models have the same arcs, corners and numbers of samples, so that seams between them are interpolated.
bool has_same_seams(const SkeletexModel& a, const SkeletexModel& b);

/// Adds what the page needs of the seams of consecutive keys, and of the triangles that do not follow from the numbers
/// of rows and columns.
///
/// \param keys  with the same seams
/// \param is_decoded  whether the page decodes the seams and chooses the diagonals of quads itself
nlohmann::ordered_json add_stage(ClContext& context, PageArrays& arrays, std::span<const PageKey> keys,
                                 bool is_decoded);

/// Adds what blends the texels of two models at every key (kernels/blend.cl).
nlohmann::ordered_json add_blend(PageArrays& arrays, const Morph& morph, std::span<const PageKey> keys);

}  // namespace skeletex
