// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <vector>

#include "blend_structs.h"
#include "skeletex/edit/morph/overlay.h"
#include "skeletex/reconstruct/displace.h"

namespace skeletex {

/// What the kernel blend_texels reads beside the texels: where the rows of some patches read in each source.
struct BlendTables {
  int source_count = 0;
  std::vector<BlendSource> sources;  ///< per source and patch of the result
  std::vector<BlendRow> rows;        ///< per source and row to do
  std::vector<BlendColumn> columns;  ///< per source and column of the result
  std::vector<float> slopes;         ///< pairs; see BlendSource::slope_begin
};

/// Appends the columns that one patch of the result, `width` columns wide, reads in a source at the bone's head and
/// tail. \param bone  of the result
void append_columns(const Overlay& overlay, int bone, int width, std::vector<float>& head_columns,
                    std::vector<float>& tail_columns);
/// The same for blend_texels, which needs them smoothed as well; texels are not turned.
void append_columns(const Overlay& overlay, int bone, int width, BlendTables& tables);
/// The same; texels are turned from the source's frames to those of the result, and `source` is told so.
/// \param separation planes  of the result
void append_turned_columns(const Overlay& overlay, const SeparationPlanes& separation, int bone, int width,
                           BlendSource& source, BlendTables& tables);

/// Row of a patch of `source_height` rows at the same share of the way as a row of one of `height` rows.
double row_at_same_share(int row, int height, int source_height, bool is_reversed);
/// u at a row between a patch's rows.
double u_at_row(const Patch& patch, double row);

/// Queues the blend. \param texels  of all sources   \param rows  of the result's patches, those to do
void blend_texels(ClContext& context, const BlendTables& tables, const std::vector<LatticeRow>& rows,
                  const FrameTables& result, int texture_width, const DevicePlanes& texels, DevicePlanes& blended);

/// Queues (1 - share) first + share second, texel by texel; shares of 0 and 1 give the very bits of first and second.
void mix_texels(ClContext& context, const DevicePlanes& first, const DevicePlanes& second, double share,
                int texture_width, DevicePlanes& mixed);

/// What is added to the texels of the rows at the ends, and to those inside less and less.
struct EndMoves {
  std::array<std::array<std::vector<float>, 3>, 2>
      planes;  ///< head, tail; along, around, out; the columns of all patches
  bool is_empty = true;
  void add(BoneEnd end, const Vec3& move);
};
void move_ends(ClContext& context, const EndMoves& moves, const std::vector<LatticeRow>& rows,
               const FrameTables& result, int texture_width, DevicePlanes& texels);

}  // namespace skeletex
