// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "skeletex/geometry/half_edge_table.h"
#include "skeletex/model/segment.h"
#include "skeletex/skeleton/separation_planes.h"

namespace skeletex {

enum class ChartVertex : std::uint8_t {
  kInner,     ///< u and v are unknowns
  kHeadRow,   ///< u = 0, v fixed
  kTailRow,   ///< u = 1, v fixed
  kHeadPole,  ///< u = 0, no v: acts on its ring through u only
  kTailPole,  ///< u = 1, no v
};
inline bool is_pole(ChartVertex kind) { return kind == ChartVertex::kHeadPole || kind == ChartVertex::kTailPole; }

/// A segment made ready to be mapped to its rectangle, and then its map: u from head (0) to tail (1), v periodic with
/// period 1. The v of a triangle's corner is v[vertex] + turns[triangle][corner]; over a triangle these lifted values
/// are continuous (corners at a pole have no v: the pole's triangle covers the trapezoid over its opposite edge).
/// For an outward surface the lifted triangles are clockwise in (u, v), that is, counter-clockwise in (v, u).
struct Chart {
  BoneIndex bone;
  SegmentTopology topology = SegmentTopology::kAnnulus;
  std::vector<Vec3> positions;  ///< the segment's vertices first, then poles and the midpoints of split chords
  std::vector<Triangle> triangles;
  HalfEdgeTable half_edges;  ///< of the triangles
  std::vector<std::array<std::int8_t, 3>> turns;
  std::vector<ChartVertex> kinds;
  std::vector<double> u, v;  ///< per vertex; rows are fixed, the rest is filled by a parameterization
};

/// Fixes the boundary rows of a segment by the angle about its bone (see loop_turns for loops that are no graphs over
/// the angle), inserts the poles at free ends (where the ray from the free node along the bone, away from it, leaves
/// the segment last), splits edges and triangles that join two vertices of one row, and counts the turns between the
/// rows so that the map is not twisted.
/// \throw TopologyError naming the bone when the pole's ray misses the segment
Chart make_chart(const Segment& segment, const Skeleton& skeleton, const SeparationPlanes& separation);

/// Signed areas in (v, u), with the trapezoid for a pole's triangle: all > 0 when the map is a bijection.
std::vector<double> texture_areas(const Chart& chart);
/// Triangles with texture area <= 0.
int count_flipped(const Chart& chart);

}  // namespace skeletex
