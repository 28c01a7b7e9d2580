// SPDX-License-Identifier: MIT
#include "skeletex/skeletonize/body/thinning.h"

#include <array>
#include <bit>
#include <cstdint>
#include <queue>
#include <utility>

namespace skeletex {
namespace {

/// Neighbourhoods of the 27 places around a voxel, as bit masks.
struct PlaceMasks {
  std::array<std::uint32_t, kVoxelPlaces> by_corner{};  ///< 26-neighbours within the 27 places, without the middle
  std::array<std::uint32_t, kVoxelPlaces> by_face{};    ///< 6-neighbours within the 18 nearest places
  std::uint32_t faces = 0;                              ///< the middle's 6-neighbours
  std::uint32_t near = 0;                               ///< the 18 places that share a face or an edge with the middle
};

/// How far two places are from each other along an axis, in voxels.
constexpr int gap(int a, int b, int axis) {
  const auto coordinate = [axis](int place) { return axis == 0 ? place / 9 : axis == 1 ? place / 3 % 3 : place % 3; };
  const int g = coordinate(a) - coordinate(b);
  return g < 0 ? -g : g;
}

constexpr PlaceMasks make_masks() {
  PlaceMasks masks;
  for (int a = 0; a < kVoxelPlaces; ++a) {
    if (a == kOwnPlace) continue;
    const int steps = gap(a, kOwnPlace, 0) + gap(a, kOwnPlace, 1) + gap(a, kOwnPlace, 2);
    if (steps == 1) masks.faces |= 1u << a;
    if (steps <= 2) masks.near |= 1u << a;
  }
  for (int a = 0; a < kVoxelPlaces; ++a)
    for (int b = 0; b < kVoxelPlaces; ++b) {
      if (a == b || a == kOwnPlace || b == kOwnPlace) continue;
      const int x = gap(a, b, 0), y = gap(a, b, 1), z = gap(a, b, 2);
      if (x <= 1 && y <= 1 && z <= 1) masks.by_corner[a] |= 1u << b;
      if (x + y + z == 1 && (masks.near >> a & 1) && (masks.near >> b & 1)) masks.by_face[a] |= 1u << b;
    }
  return masks;
}
constexpr PlaceMasks kMasks = make_masks();

/// The places of `all` that are connected with those of `seed`.
std::uint32_t spread(std::uint32_t seed, std::uint32_t all, const std::array<std::uint32_t, kVoxelPlaces>& neighbours) {
  std::uint32_t reached = seed, fresh = seed;
  while (fresh) {
    const int place = std::countr_zero(fresh);
    fresh &= fresh - 1;
    const std::uint32_t next = neighbours[place] & all & ~reached;
    reached |= next;
    fresh |= next;
  }
  return reached;
}

/// Whether taking away the middle keeps the topology (Bertrand and Malandain 1994): the object around it is one piece,
/// and so is the outside that touches its faces.
bool is_simple(std::uint32_t object) {
  const std::uint32_t around = object & ~(1u << kOwnPlace);
  if (!around || spread(around & -around, around, kMasks.by_corner) != around) return false;
  const std::uint32_t outside = ~object & kMasks.near, touching = outside & kMasks.faces;
  if (!touching) return false;
  return (touching & ~spread(touching & -touching, outside, kMasks.by_face)) == 0;
}

}  // namespace

std::vector<char> thin_body(const VoxelBody& body, const std::vector<int>& anchors) {
  std::vector<char> is_left(body.size(), 1), is_anchor(body.size(), 0), is_queued(body.size(), 0);
  for (const int anchor : anchors) is_anchor[anchor] = 1;
  const auto object_around = [&](int voxel) {
    std::uint32_t object = 0;
    for (int place = 0; place < kVoxelPlaces; ++place) {
      const int other = body.neighbours[voxel][place];
      if (other >= 0 && is_left[other]) object |= 1u << place;
    }
    return object;
  };
  using Entry = std::pair<double, int>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  const auto ask = [&](int voxel) {
    if (is_anchor[voxel] || is_queued[voxel] || !is_left[voxel]) return;
    is_queued[voxel] = 1;
    queue.emplace(body.radii[voxel], voxel);
  };
  for (int v = 0; v < body.size(); ++v)
    if (std::popcount(object_around(v)) < kVoxelPlaces) ask(v);
  while (!queue.empty()) {
    const int voxel = queue.top().second;
    queue.pop();
    is_queued[voxel] = 0;
    if (!is_simple(object_around(voxel))) continue;
    is_left[voxel] = 0;
    for (const int other : body.neighbours[voxel])
      if (other >= 0) ask(other);
  }
  return is_left;
}

}  // namespace skeletex
