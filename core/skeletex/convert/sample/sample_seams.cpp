// SPDX-License-Identifier: MIT
#include "skeletex/convert/sample/sample_seams.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>

#include "skeletex/geometry/loop_turns.h"

namespace skeletex {
namespace {

/// Moves evenly spread places along a polyline to its bends, the sharpest first, each to the nearest place that is free
/// and within 0.7 of a step; their order stays, and no gap gets wider than 1.5 steps.
/// \param reached  length up to each of the points
void snap_places(const std::vector<Vec3>& points, const std::vector<double>& reached, std::vector<double>& places) {
  constexpr double kReach = 0.7, kLeastGap = 0.1, kMostGap = 1.5, kLeastBend = 1e-3;  // steps, steps, steps, radians
  const double step = reached.back() / static_cast<double>(places.size() + 1);
  std::vector<std::pair<double, int>> bends;
  for (int i = 1; i + 1 < static_cast<int>(points.size()); ++i) {
    const Vec3 before = points[i] - points[i - 1], after = points[i + 1] - points[i];
    const double bend = std::atan2(before.cross(after).norm(), before.dot(after));
    if (bend > kLeastBend) bends.emplace_back(-bend * (before.norm() + after.norm()), i);
  }
  std::sort(bends.begin(), bends.end());
  std::vector<bool> is_taken(places.size(), false);
  for (const auto& [strength, i] : bends) {
    const int right = static_cast<int>(std::upper_bound(places.begin(), places.end(), reached[i]) - places.begin());
    int best = -1;
    for (const int k : {right - 1, right}) {
      if (k < 0 || k >= static_cast<int>(places.size()) || is_taken[k] ||
          std::abs(places[k] - reached[i]) > kReach * step)
        continue;
      const double low = k > 0 ? places[k - 1] : 0,
                   high = k + 1 < static_cast<int>(places.size()) ? places[k + 1] : reached.back();
      const double nearer = std::min(reached[i] - low, high - reached[i]),
                   wider = std::max(reached[i] - low, high - reached[i]);
      // A wide gap cuts a corner of the surface, which no texel can make up for.
      if (nearer < kLeastGap * step || wider > std::max(kMostGap * step, std::max(places[k] - low, high - places[k])))
        continue;
      if (best < 0 || std::abs(places[k] - reached[i]) < std::abs(places[best] - reached[i])) best = k;
    }
    if (best < 0) continue;
    places[best] = reached[i];
    is_taken[best] = true;
  }
}

}  // namespace

Seams sample_seams(const Segmentation& segmentation, const Skeleton& skeleton, const SeparationPlanes& separation,
                   std::span<const Rectangle> rectangles, SeamSampling sampling) {
  Seams seams;
  const auto sample_of = [&](int bone, int node, const Vec3& point) {
    const BoneEnd end = end_at(skeleton, bone, node);
    return SeamSample{separation.turn_of(bone, point - skeleton.nodes[node].position),
                      separation.half_line_distance(bone, end, point)};
  };

  std::map<int, int> corner_of_vertex;
  for (const Arc& arc : segmentation.arcs) {
    SeamArc seam{arc.node, arc.bones, {-1, -1}, {}};
    if (!arc.is_closed) {
      for (const int side : {0, 1}) {
        const int vertex = side == 0 ? arc.vertices.front() : arc.vertices.back();
        const auto [it, is_new] = corner_of_vertex.emplace(vertex, static_cast<int>(seams.corners.size()));
        if (is_new) seams.corners.push_back({arc.node, {}, {}});
        auto& bones = seams.corners[it->second].bones;
        for (const int bone : arc.bones)
          if (std::find(bones.begin(), bones.end(), bone) == bones.end()) bones.push_back(bone);
        seam.corners[side] = it->second;
      }
    }
    // The polyline, closed where the arc is.
    std::vector<Vec3> points;
    for (const int vertex : arc.vertices) points.push_back(segmentation.cut_mesh.positions[vertex]);
    if (arc.is_closed) points.push_back(points.front());
    std::vector<double> length{0};
    for (std::size_t i = 1; i < points.size(); ++i)
      length.push_back(length.back() + (points[i] - points[i - 1]).norm());

    double columns = 0;
    for (const int bone : arc.bones) {
      double turning = 0;
      for (std::size_t i = 1; i < points.size(); ++i) {
        const Vec3& node = skeleton.nodes[arc.node].position;
        turning +=
            shortest_turn(separation.turn_of(bone, points[i] - node) - separation.turn_of(bone, points[i - 1] - node));
      }
      columns = std::max(columns, std::abs(turning) * rectangles[bone].width);
    }
    const int intervals = std::max(arc.is_closed ? 3 : 2, static_cast<int>(std::lround(columns)));
    std::vector<double> places;
    for (int i = 1; i < intervals; ++i) places.push_back(length.back() * i / intervals);
    if (sampling == SeamSampling::kSnapped) snap_places(points, length, places);
    if (arc.is_closed) places.insert(places.begin(), 0.0);
    std::size_t segment = 0;
    for (const double at : places) {
      while (segment + 2 < points.size() && length[segment + 1] < at) ++segment;
      const double span = length[segment + 1] - length[segment];
      const double t = span > 0 ? (at - length[segment]) / span : 0.5;
      seam.samples.push_back(
          sample_of(arc.bones[0], arc.node, points[segment] + t * (points[segment + 1] - points[segment])));
    }
    seams.arcs.push_back(std::move(seam));
  }
  for (const auto& [vertex, corner] : corner_of_vertex) {
    SeamCorner& c = seams.corners[corner];
    std::sort(c.bones.begin(), c.bones.end());
    c.sample = sample_of(c.bones.front(), c.node, segmentation.cut_mesh.positions[vertex]);
  }
  for (const Segment& segment : segmentation.segments)
    seams.ends.push_back({PatchEnd{segment.loops[0].arcs}, PatchEnd{segment.loops[1].arcs}});
  return seams;
}

std::vector<Vec3> points_on_loop(const Segment& segment, const Skeleton& skeleton, const SeparationPlanes& separation,
                                 BoneEnd end, int columns) {
  const std::vector<int>& loop = segment.loops[static_cast<int>(end)].vertices;
  const Vec3& node = end_position(skeleton, segment.bone, end);
  std::vector<Vec3> points;
  std::vector<double> angles;
  for (const int vertex : loop) {
    points.push_back(segment.mesh.positions[vertex]);
    angles.push_back(separation.turn_of(segment.bone, points.back() - node));
  }
  // The chart's own v: make_chart has refused loops that do not wind once.
  return points_at_columns(points, loop_turns(points, angles).value(), columns);
}

}  // namespace skeletex
