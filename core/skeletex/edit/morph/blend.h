// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <vector>

#include "blend_structs.h"
#include "skeletex/edit/morph/seam_map.h"
#include "skeletex/reconstruct/displace.h"

namespace skeletex {

/// Where the rows of the result read in each source (kernels/blend.cl).
struct BlendTables {
  int source_count = 0;
  std::vector<BlendSource> sources;         ///< per source and patch of the result
  std::vector<BlendSourceRow> source_rows;  ///< per source and row to do
  std::vector<BlendColumn> columns;         ///< per source and column of the result
  std::vector<float> slopes;                ///< pairs; see BlendSource::slope_begin
};

/// The columns, at the bone's head and tail, that the columns of one patch of the result read in a model.
/// \param bone  of the result
/// \param width  columns of its patch
std::array<std::vector<float>, 2> model_columns(const SeamMap& map, BoneIndex bone, int width);
/// Appends the same, and their smoothed values. Texels are not turned.
void append_columns(const SeamMap& map, BoneIndex bone, int width, BlendTables& tables);
/// Appends the same. Texels are turned from the source's frames to those of the result; sets source.slope_begin.
/// \param separation  of the result
void append_turned_columns(const SeamMap& map, const SeparationPlanes& separation, BoneIndex bone, int width,
                           BlendSource& source, BlendTables& tables);
/// Appends the rows of one source, which lie at the same share of its patch's height.
/// \param rows, patches  the rows to do, and the result's patches
void append_rows(const SeamMap& map, const std::vector<LatticeRow>& rows, const std::vector<Patch>& patches,
                 double weight, BlendTables& tables);

/// u of a model's patch at the same share of its rows as a row of a patch of `height` rows, in the direction of the
/// target's bone.
double u_at_same_share(const Patch& model, int row, int height, bool is_reversed);

/// Queues the blend.
/// \param texels  of all sources
/// \param rows  of the result's patches, those to do
void blend_texels(ClContext& context, const BlendTables& tables, const std::vector<LatticeRow>& rows,
                  const FrameTables& result, int texture_width, const DevicePlanes& texels, DevicePlanes& blended);

/// Queues (1 - share) first + share second, texel by texel; shares of 0 and 1 give the very bits of first and second.
void mix_texels(ClContext& context, const DevicePlanes& first, const DevicePlanes& second, double share,
                int texture_width, DevicePlanes& mixed);

/// Moves of the texels in the rows at the ends. Rows inside move along, less with their distance from the end.
struct EndMoves {
  /// Head, tail; along, around, out; the columns of all patches.
  std::array<std::array<std::vector<float>, 3>, 2> planes;
  bool is_empty = true;
  void add(BoneEnd end, const Vec3& move);
};
/// Queues the moves. Parameters as of blend_texels.
void move_ends(ClContext& context, const EndMoves& moves, const std::vector<LatticeRow>& rows,
               const FrameTables& result, int texture_width, DevicePlanes& texels);

}  // namespace skeletex
