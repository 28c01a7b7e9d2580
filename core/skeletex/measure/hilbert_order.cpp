// SPDX-License-Identifier: MIT
#include "skeletex/measure/hilbert_order.h"

#include <algorithm>
#include <array>
#include <cstddef>

#include "skeletex/model/parallel.h"

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

std::uint64_t hilbert_key(std::uint32_t x, std::uint32_t y, std::uint32_t z) {
  std::array<std::uint32_t, 3> axes{x, y, z};
  constexpr std::uint32_t kTop = 1u << (kBits - 1);
  for (std::uint32_t q = kTop; q > 1; q >>= 1) {
    const std::uint32_t p = q - 1;
    for (std::uint32_t& axis : axes) {
      const std::uint32_t is_set = 0u - ((axis & q) != 0);  // all ones or zero: no branch to mispredict
      const std::uint32_t t = (axes[0] ^ axis) & p & ~is_set;
      axes[0] ^= (p & is_set) | t;
      axis ^= t;
    }
  }
  axes[1] ^= axes[0];
  axes[2] ^= axes[1];
  std::uint32_t t = 0;
  for (std::uint32_t q = kTop; q > 1; q >>= 1)
    if (axes[2] & q) t ^= q - 1;
  for (std::uint32_t& axis : axes) axis ^= t;
  return spread(axes[0]) << 2 | spread(axes[1]) << 1 | spread(axes[2]);
}

std::vector<int> hilbert_order(std::span<const Vec3> points) {
  std::vector<int> order(points.size());
  if (points.empty()) return order;
  Vec3 lower = points.front(), upper = points.front();
  for (const Vec3& p : points) {
    lower = lower.cwiseMin(p);
    upper = upper.cwiseMax(p);
  }
  const double side = (upper - lower).maxCoeff();
  const double cells_per_unit = side > 0 ? ((1 << kBits) - 1) / side : 0;
  std::vector<KeyAndIndex> items(points.size());
  for_each_block(points.size(), 1 << 14, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Vec3 cell = (points[i] - lower) * cells_per_unit;
      const auto key = hilbert_key(static_cast<std::uint32_t>(cell.x()), static_cast<std::uint32_t>(cell.y()), static_cast<std::uint32_t>(cell.z()));
      items[i] = {key, static_cast<int>(i)};
    }
  });
  sort_by_key(items);
  for (std::size_t i = 0; i < items.size(); ++i) order[i] = items[i].index;
  return order;
}

}  // namespace skeletex
