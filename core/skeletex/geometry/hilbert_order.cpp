// SPDX-License-Identifier: MIT
#include "skeletex/geometry/hilbert_order.h"

#include <algorithm>
#include <array>
#include <cstddef>

#include "skeletex/geometry/parallel.h"

namespace skeletex {
namespace {

constexpr int kBits = 16;

struct KeyAndIndex {
  std::uint64_t key;
  int index;
};

/// Puts two zero bits after each of the lower 16 bits.
std::uint64_t spread(std::uint64_t bits) {
  bits = (bits | bits << 16) & 0x0000ff0000ffULL;
  bits = (bits | bits << 8) & 0x00f00f00f00fULL;
  bits = (bits | bits << 4) & 0x0c30c30c30c3ULL;
  bits = (bits | bits << 2) & 0x249249249249ULL;
  return bits;
}

constexpr int kLanes = 8;
using Cells = std::array<std::array<std::uint32_t, kLanes>, 3>;  // by coordinate

/// Positions of eight cells along the curve (Skilling 2004).
std::array<std::uint64_t, kLanes> keys_of(const Cells& cells) {
  std::array<std::uint32_t, kLanes> x = cells[0], y = cells[1], z = cells[2];
  constexpr std::uint32_t kTop = 1u << (kBits - 1);
  const auto turn = [&](std::array<std::uint32_t, kLanes>& axis, std::uint32_t q) {
    for (int k = 0; k < kLanes; ++k) {
      const std::uint32_t is_set = 0u - ((axis[k] & q) != 0);  // all ones or zero
      const std::uint32_t t = (x[k] ^ axis[k]) & (q - 1) & ~is_set;
      x[k] ^= ((q - 1) & is_set) | t;
      axis[k] ^= t;
    }
  };
  for (std::uint32_t q = kTop; q > 1; q >>= 1) {
    for (int k = 0; k < kLanes; ++k) x[k] ^= (q - 1) & (0u - ((x[k] & q) != 0));
    turn(y, q), turn(z, q);
  }
  std::array<std::uint32_t, kLanes> t{};
  for (int k = 0; k < kLanes; ++k) y[k] ^= x[k], z[k] ^= y[k];
  for (std::uint32_t q = kTop; q > 1; q >>= 1)
    for (int k = 0; k < kLanes; ++k) t[k] ^= (q - 1) & (0u - ((z[k] & q) != 0));
  std::array<std::uint64_t, kLanes> keys;
  for (int k = 0; k < kLanes; ++k) keys[k] = spread(x[k] ^ t[k]) << 2 | spread(y[k] ^ t[k]) << 1 | spread(z[k] ^ t[k]);
  return keys;
}

void sort_by_key(std::vector<KeyAndIndex>& items) {
  constexpr int kDigitBits = 12;
  std::vector<KeyAndIndex> other(items.size());
  for (int shift = 0; shift < 3 * kBits; shift += kDigitBits) {
    std::array<std::size_t, (1 << kDigitBits) + 1> begin{};
    const auto digit = [shift](const KeyAndIndex& item) { return (item.key >> shift) & ((1u << kDigitBits) - 1); };
    for (const KeyAndIndex& item : items) ++begin[digit(item) + 1];
    for (std::size_t d = 1; d < begin.size(); ++d) begin[d] += begin[d - 1];
    for (const KeyAndIndex& item : items) other[begin[digit(item)]++] = item;
    items.swap(other);
  }
}

}  // namespace

std::vector<int> hilbert_order(std::span<const Vec3> points) {
  std::vector<int> order(points.size());
  if (points.empty()) return order;
  const BoundingBox box = bounding_box(points);
  const double side = (box.upper - box.lower).maxCoeff();
  const double cells_per_unit = side > 0 ? ((1 << kBits) - 1) / side : 0;
  std::vector<KeyAndIndex> items(points.size());
  for_each_block(points.size(), 1 << 14, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t first = begin; first < end; first += kLanes) {
      const int count = static_cast<int>(std::min<std::size_t>(kLanes, end - first));
      Cells cells{};
      for (int k = 0; k < count; ++k) {
        const Vec3 cell = (points[first + k] - box.lower) * cells_per_unit;
        for (int axis = 0; axis < 3; ++axis) cells[axis][k] = static_cast<std::uint32_t>(cell[axis]);
      }
      const std::array<std::uint64_t, kLanes> keys = keys_of(cells);
      for (int k = 0; k < count; ++k) items[first + k] = {keys[k], static_cast<int>(first) + k};
    }
  });
  sort_by_key(items);
  for (std::size_t i = 0; i < items.size(); ++i) order[i] = items[i].index;
  return order;
}

}  // namespace skeletex
