// SPDX-License-Identifier: MIT
#pragma once
#include <Eigen/Geometry>
#include <vector>

#include "skeletex/convert/parameterize/spd.h"

namespace skeletex::testing {

struct TwinHit {
  int triangle;
  double distance;
};

/// Every triangle of a chart that a ray meets, by solving origin + t direction = a + p (b - a) + q (c - a) in double
/// precision. `slack` widens (> 0) or shrinks (< 0) the triangles, in barycentric coordinates.
inline std::vector<TwinHit> hits_of_ray(const Chart& chart, const Vec3& origin, const Vec3& direction, double slack) {
  std::vector<TwinHit> hits;
  for (int i = 0; i < static_cast<int>(chart.triangles.size()); ++i) {
    const Vec3 &a = chart.positions[chart.triangles[i][0]], &b = chart.positions[chart.triangles[i][1]],
               &c = chart.positions[chart.triangles[i][2]];
    Eigen::Matrix3d m;
    m << b - a, c - a, -direction;
    const Vec3 x = m.partialPivLu().solve(origin - a);
    if (x[0] >= -slack && x[1] >= -slack && x[0] + x[1] <= 1 + slack && x[2] >= -slack) hits.push_back({i, x[2]});
  }
  return hits;
}

/// Share of a chart's area whose triangles' centres are not the first hit of the ray from their foot.
inline double unseen_area_fraction_twin(const Skeleton& skeleton, const SeparationPlanes& separation,
                                        const Chart& chart) {
  double unseen = 0, total = 0;
  for (int i = 0; i < static_cast<int>(chart.triangles.size()); ++i) {
    const Vec3 &a = chart.positions[chart.triangles[i][0]], &b = chart.positions[chart.triangles[i][1]],
               &c = chart.positions[chart.triangles[i][2]];
    const Vec3 centre = (a + b + c) / 3;
    const double area = 0.5 * (b - a).cross(c - a).norm();
    total += area;
    const SpdCoordinates at = spd_coordinates(skeleton, separation, chart.bone, centre);
    bool is_seen = at.u >= 0 && at.u <= 1;
    if (is_seen) {
      const TangentFrame frame = tangent_frame(skeleton, separation, chart.bone, at.u, at.turn);
      const double distance = (centre - frame.foot).norm();
      for (const TwinHit& hit : hits_of_ray(chart, frame.foot, (centre - frame.foot) / distance, 0))
        is_seen = is_seen && (hit.triangle == i || hit.distance >= distance * (1 - 1e-5));
    }
    if (!is_seen) unseen += area;
  }
  return unseen / total;
}

}  // namespace skeletex::testing
