// SPDX-License-Identifier: MIT
#pragma once
#include <algorithm>
#include <cstddef>
#include <span>

namespace skeletex {

/// Calls act(index), in order, for the values that `is` holds for. Where these are few, most of it is vector
/// instructions. \param is  without branches
template <class T, class Is, class Act>
void for_each_where(std::span<const T> values, const Is& is, const Act& act) {
  constexpr std::size_t kAtOnce = 32;
  for (std::size_t begin = 0; begin < values.size(); begin += kAtOnce) {
    const std::size_t end = std::min(begin + kAtOnce, values.size());
    if (end == begin + kAtOnce) {
      const T* some = values.data() + begin;
      int is_any = 0;
      for (std::size_t i = 0; i < kAtOnce; ++i) is_any |= is(some[i]);
      if (is_any == 0) continue;
    }
    for (std::size_t i = begin; i < end; ++i)
      if (is(values[i])) act(i);
  }
}

}  // namespace skeletex
