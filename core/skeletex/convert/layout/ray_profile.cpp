// SPDX-License-Identifier: MIT
#include "skeletex/convert/layout/ray_profile.h"

#include "skeletex/model/frame.h"

namespace skeletex {
namespace {

constexpr int kRows = 257, kColumns = 64;

/// The points of one column. A ray that misses repeats the point before it, and adds no length; those before the first
/// hit repeat that.
void place_column(const Skeleton& skeleton, const SeparationPlanes& separation, BoneIndex bone, const Patch& probe,
                  const SpdHits& hits, int column, std::vector<Vec3>& points) {
  int last_hit = -1;
  for (int row = 0; row < kRows; ++row) {
    const std::size_t at = static_cast<std::size_t>(row) * kColumns + column;
    if (hits.triangles[at] >= 0) {
      const TangentFrame frame =
          tangent_frame(skeleton, separation, bone, probe.row_u[row], static_cast<double>(column) / kColumns);
      points[at] = frame.foot + static_cast<double>(hits.distances[at]) * frame.out;
      if (last_hit < 0)
        for (int q = 0; q < row; ++q) points[static_cast<std::size_t>(q) * kColumns + column] = points[at];
      last_hit = row;
    } else if (last_hit >= 0) {
      points[at] = points[static_cast<std::size_t>(last_hit) * kColumns + column];
    }
  }
}

}  // namespace

std::vector<RowProfile> ray_profiles(ClContext& context, const Skeleton& skeleton, const SeparationPlanes& separation,
                                     std::span<const Chart> charts, SpdHit hit) {
  std::vector<Patch> probes(charts.size());
  for (Patch& probe : probes) {
    probe.rectangle = {0, 0, kColumns, kRows};
    probe.row_u = spread_rows_uniformly(kRows);
  }
  const std::vector<SpdHits> hits = cast_spd_rays(context, skeleton, separation, charts, probes, hit);
  std::vector<RowProfile> profiles;
  for (std::size_t i = 0; i < charts.size(); ++i) {
    std::vector<Vec3> points(static_cast<std::size_t>(kRows) * kColumns);
    for (int column = 0; column < kColumns; ++column)
      place_column(skeleton, separation, charts[i].bone, probes[i], hits[i], column, points);
    profiles.push_back(row_profile(points, kRows, kColumns));
  }
  return profiles;
}

}  // namespace skeletex
