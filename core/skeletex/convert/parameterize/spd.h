// SPDX-License-Identifier: MIT
#pragma once
#include <memory>
#include <span>
#include <vector>

#include "skeletex/convert/parameterize/method.h"
#include "skeletex/model/frame.h"

namespace skeletex {

/// The method whose texels are the hits of rays from the bone.
std::unique_ptr<ParameterizationMethod> make_spd_method();

enum class SpdHit { kFirst, kLast };

/// What rays from a bone meet: for a texel at (u, v) the ray starts at the foot W(u) and runs along the frame's
/// `out` (paper 3.2.1; caps: the hemisphere of rays from the end node).
struct SpdHits {
  std::vector<int> triangles;    ///< per texel of the patch, row-major: the chart's triangle, -1 for a miss
  std::vector<float> distances;  ///< along the ray, world units; 0 for a miss
};

/// Casts the rays of some patches against their own charts, on the device. Rows 0 and height-1 at seams are cast too,
/// but their hits are the seam itself up to rounding.
/// \param patches  per chart: rectangle sizes and row_u are read
std::vector<SpdHits> cast_spd_rays(ClContext& context, const Skeleton& skeleton, const SeparationPlanes& separation,
                                   std::span<const Chart> charts, std::span<const Patch> patches, SpdHit which);

/// Share of each chart's surface area that SPD cannot see: of a triangle with centre P, the ray from W(u(P)) through P
/// hits another triangle of the chart before P. On the host, through a tree over the chart's triangles.
std::vector<double> unseen_area_fractions(const Skeleton& skeleton, const SeparationPlanes& separation,
                                          std::span<const Chart> charts);

/// Map coordinates (u, turn) of a point under SPD; outside the cell u leaves [0,1].
struct SpdCoordinates {
  double u = 0, turn = 0;
};
SpdCoordinates spd_coordinates(const Skeleton& skeleton, const SeparationPlanes& separation, BoneIndex bone,
                               const Vec3& point);

}  // namespace skeletex
