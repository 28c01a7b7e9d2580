// SPDX-License-Identifier: MIT
#include "skeletex/convert/sample/sample_seams.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>

#include "skeletex/geometry/loop_turns.h"
#include "skeletex/math/portable.h"

namespace skeletex {
namespace {

/// A polyline and the length up to each of its points.
struct Polyline {
  std::vector<Vec3> points;
  std::vector<double> lengths;

  Vec3 at(double length, std::size_t segment) const {
    const double span = lengths[segment + 1] - lengths[segment];
    const double share = span > 0 ? (length - lengths[segment]) / span : 0.5;
    return points[segment] + share * (points[segment + 1] - points[segment]);
  }
};

/// The points at which a polyline bends, the sharpest first.
std::vector<int> bends_of(const Polyline& line) {
  constexpr double kLeastBend = 1e-3;  // radians
  std::vector<std::pair<double, int>> bends;
  for (int i = 1; i + 1 < static_cast<int>(line.points.size()); ++i) {
    const Vec3 before = line.points[i] - line.points[i - 1], after = line.points[i + 1] - line.points[i];
    const double bend = portable::atan2(before.cross(after).norm(), before.dot(after));
    if (bend > kLeastBend) bends.emplace_back(-bend * (before.norm() + after.norm()), i);
  }
  std::sort(bends.begin(), bends.end());
  std::vector<int> points;
  for (const auto& [strength, point] : bends) points.push_back(point);
  return points;
}

/// Whether the place with a number may move to a length: not far, and so that its gaps stay neither narrow nor wide.
bool may_move(const std::vector<double>& places, int place, double to, double end, double step) {
  constexpr double kFarthest = 0.7, kLeastGap = 0.1, kMostGap = 1.5;  // steps
  if (std::abs(places[place] - to) > kFarthest * step) return false;
  const double low = place > 0 ? places[place - 1] : 0;
  const double high = place + 1 < static_cast<int>(places.size()) ? places[place + 1] : end;
  const double nearer = std::min(to - low, high - to), wider = std::max(to - low, high - to);
  // A wide gap cuts a corner of the surface, which no texel can make up for.
  return nearer >= kLeastGap * step &&
         wider <= std::max(kMostGap * step, std::max(places[place] - low, high - places[place]));
}

/// Moves evenly spread places along a polyline to its bends, the sharpest first, each to the nearest place that is free
/// and may move there; their order stays.
void snap_places(const Polyline& line, std::vector<double>& places) {
  const double end = line.lengths.back(), step = end / static_cast<double>(places.size() + 1);
  std::vector<bool> is_taken(places.size(), false);
  for (const int bend : bends_of(line)) {
    const double to = line.lengths[bend];
    const int right = static_cast<int>(std::upper_bound(places.begin(), places.end(), to) - places.begin());
    int best = -1;
    for (const int k : {right - 1, right}) {
      if (k < 0 || k >= static_cast<int>(places.size()) || is_taken[k] || !may_move(places, k, to, end, step)) continue;
      if (best < 0 || std::abs(places[k] - to) < std::abs(places[best] - to)) best = k;
    }
    if (best < 0) continue;
    places[best] = to;
    is_taken[best] = true;
  }
}

/// Seams while they are made.
class SeamSampler {
 public:
  SeamSampler(const Segmentation& segmentation, const Skeleton& skeleton, const SeparationPlanes& separation,
              std::span<const Rectangle> rectangles, SeamSampling sampling)
      : segmentation_(segmentation),
        skeleton_(skeleton),
        separation_(separation),
        rectangles_(rectangles),
        sampling_(sampling) {}

  Seams sample() {
    for (const Arc& arc : segmentation_.arcs) {
      SeamArc seam{arc.node, arc.bones, {-1, -1}, {}};
      if (!arc.is_closed) seam.corners = {corner_of(arc, arc.vertices.front()), corner_of(arc, arc.vertices.back())};
      add_samples(arc, seam);
      seams_.arcs.push_back(std::move(seam));
    }
    for (const auto& [vertex, number] : corner_of_vertex_) {
      SeamCorner& corner = seams_.corners[number];
      std::sort(corner.bones.begin(), corner.bones.end());
      corner.sample = sample_of(corner.bones.front(), corner.node, segmentation_.cut_mesh.positions[vertex]);
    }
    for (const Segment& segment : segmentation_.segments)
      seams_.ends.push_back({PatchEnd{segment.loops[0].arcs}, PatchEnd{segment.loops[1].arcs}});
    return std::move(seams_);
  }

 private:
  SeamSample sample_of(BoneIndex bone, NodeIndex node, const Vec3& point) const {
    return {separation_.turn_of(bone, point - skeleton_.nodes[node].position),
            separation_.half_line_distance(bone, end_at(skeleton_, bone, node), point)};
  }

  /// The corner at an arc's end, with the arc's bones.
  int corner_of(const Arc& arc, VertexIndex vertex) {
    const auto [it, is_new] = corner_of_vertex_.emplace(vertex, static_cast<int>(seams_.corners.size()));
    if (is_new) seams_.corners.push_back({arc.node, {}, {}});
    std::vector<BoneIndex>& bones = seams_.corners[it->second].bones;
    for (const BoneIndex bone : arc.bones)
      if (std::find(bones.begin(), bones.end(), bone) == bones.end()) bones.push_back(bone);
    return it->second;
  }

  /// As many intervals as the arc has columns in the wider of its two patches.
  int interval_count(const Arc& arc, const Polyline& line) const {
    const Vec3& node = skeleton_.nodes[arc.node].position;
    double columns = 0;
    for (const BoneIndex bone : arc.bones) {
      double turning = 0;
      for (std::size_t i = 1; i < line.points.size(); ++i)
        turning += shortest_turn(separation_.turn_of(bone, line.points[i] - node) -
                                 separation_.turn_of(bone, line.points[i - 1] - node));
      columns = std::max(columns, std::abs(turning) * rectangles_[bone].width);
    }
    return std::max(arc.is_closed ? 3 : 2, static_cast<int>(std::lround(columns)));
  }

  void add_samples(const Arc& arc, SeamArc& seam) const {
    Polyline line{{}, {0}};
    for (const VertexIndex vertex : arc.vertices) line.points.push_back(segmentation_.cut_mesh.positions[vertex]);
    if (arc.is_closed) line.points.push_back(line.points.front());
    for (std::size_t i = 1; i < line.points.size(); ++i)
      line.lengths.push_back(line.lengths.back() + (line.points[i] - line.points[i - 1]).norm());
    const int intervals = interval_count(arc, line);
    std::vector<double> places;
    for (int i = 1; i < intervals; ++i) places.push_back(line.lengths.back() * i / intervals);
    if (sampling_ == SeamSampling::kSnapped) snap_places(line, places);
    if (arc.is_closed) places.insert(places.begin(), 0.0);
    std::size_t segment = 0;
    for (const double at : places) {
      while (segment + 2 < line.points.size() && line.lengths[segment + 1] < at) ++segment;
      seam.samples.push_back(sample_of(arc.bones[0], arc.node, line.at(at, segment)));
    }
  }

  const Segmentation& segmentation_;
  const Skeleton& skeleton_;
  const SeparationPlanes& separation_;
  std::span<const Rectangle> rectangles_;
  SeamSampling sampling_;
  Seams seams_;
  std::map<int, int> corner_of_vertex_;
};

}  // namespace

Seams sample_seams(const Segmentation& segmentation, const Skeleton& skeleton, const SeparationPlanes& separation,
                   std::span<const Rectangle> rectangles, SeamSampling sampling) {
  return SeamSampler(segmentation, skeleton, separation, rectangles, sampling).sample();
}

std::vector<Vec3> points_on_loop(const Segment& segment, const Skeleton& skeleton, const SeparationPlanes& separation,
                                 BoneEnd end, int columns) {
  const std::vector<int>& loop = segment.loops[static_cast<int>(end)].vertices;
  const Vec3& node = end_position(skeleton, segment.bone, end);
  std::vector<Vec3> points;
  std::vector<double> angles;
  for (const VertexIndex vertex : loop) {
    points.push_back(segment.mesh.positions[vertex]);
    angles.push_back(separation.turn_of(segment.bone, points.back() - node));
  }
  // The chart's own v: make_chart has refused loops that do not wind once.
  return points_at_columns(points, loop_turns(points, angles).value(), columns);
}

}  // namespace skeletex
