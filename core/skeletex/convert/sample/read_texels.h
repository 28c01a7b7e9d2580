// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <optional>
#include <span>
#include <vector>

#include "skeletex/convert/fit/fit.h"
#include "skeletex/convert/parameterize/chart.h"
#include "skeletex/convert/parameterize/spd.h"
#include "skeletex/convert/sample/half_texels.h"
#include "skeletex/convert/sample/unfold.h"
#include "skeletex/convert/snap/revert_faults.h"
#include "skeletex/convert/snap/snap.h"
#include "skeletex/device/context.h"
#include "skeletex/model/frame.h"

namespace skeletex {

/// What the texels of a layout are read from, per bone.
struct TexelSources {
  std::span<const Chart> charts;      ///< maps; of SPD patches only the positions are used
  std::span<const Patch> patches;     ///< rectangle, method, row_u
  std::span<const SpdHits> spd_hits;  ///< per bone; of VSM patches empty
  /// Per bone and end, the points of row 0 and of the last row: `width` points on a seam, or one point for a pole.
  std::span<const std::array<std::vector<Vec3>, 2>> end_points;
  /// With snapping or fit, what the finished lattice is compared with, see revert_faults; without, no texel reverts.
  const RevertSources* revert = nullptr;
  /// With snapping, what texels of VSM patches move to.
  const DeviceSnapTables* features = nullptr;
};

struct TexelOptions {
  bool has_prefilter = true;  ///< of patches that are neither snapped nor fitted
  bool has_unfold = true;
  double fit_steps = 0;  ///< so many at most fit points of VSM patches to the mesh, instead of the prefilter
  std::optional<DiagonalRule> half_rule =
      {};  ///< inner rows come as half floats, see round_to_half; the rule of the lattice's diagonals
};

/// What snapping did; of VSM patches.
struct SnapReport {
  int vertices = 0, snapped_vertices = 0;  ///< inner vertices that are not flat; those that a texel sits on
  int edges = 0, snapped_edges = 0;        ///< creased edges; those with a texel between their ends
  int texels_on_edges = 0;
  int reverted_texels = 0;  ///< see revert_faults
};

struct TexelReport {
  std::vector<double> sampled_triangle_fractions;  ///< per bone: share of the chart's triangles that a texel reads
  /// Per bone: texels that take what they lack from a neighbour, as no SPD ray hits (along the column) or no triangle
  /// of the map covers them (along the row).
  std::vector<int> missed_texels;
  std::optional<SnapReport> snap;
  std::optional<UnfoldReport> unfold;
  std::optional<FitReport> fit;
  std::optional<RoundingReport> rounding;  ///< to half floats
  std::optional<RevertReport> revert;      ///< with snapping or fit
};

struct TexelResult {
  DisplacementTexture texture;
  TexelReport report;
};

/// Reads the surface at every texel and stores it in bone tangent space (paper 3.4), on the device. Texels between
/// rectangles are zero.
/// \param origin  world position that device coordinates are relative to
TexelResult read_texels(ClContext& context, const Skeleton& skeleton, const SeparationPlanes& separation,
                        const TexelSources& sources, int texture_width, int texture_height, const Vec3& origin,
                        const TexelOptions& options = {});

}  // namespace skeletex
