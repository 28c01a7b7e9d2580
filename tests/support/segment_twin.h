// SPDX-License-Identifier: MIT
#pragma once
#include <cstdint>
#include <limits>
#include <vector>

#include "skeletex/convert/segment/cells.h"

namespace skeletex {

/// Twin of kernels/segment.cl classify_points, in the precision of T.
template <class T>
std::vector<std::uint8_t> classify_points_twin(const ClassifyTables& tables) {
  std::vector<std::uint8_t> labels;
  const std::size_t count = tables.points.size() / 3;
  for (std::size_t n = 0; n < tables.margin.size(); ++n)
    for (std::size_t p = 0; p < count; ++p) {
      T first = -std::numeric_limits<T>::infinity(), second = first;
      int best = 0;
      for (int c = tables.cell_begin[n]; c < tables.cell_begin[n + 1]; ++c) {
        const float* cell = &tables.cells[4 * static_cast<std::size_t>(c)];
        const T value = T(tables.points[p]) * T(cell[0]) + T(tables.points[count + p]) * T(cell[1]) +
                        T(tables.points[2 * count + p]) * T(cell[2]) + T(cell[3]);
        if (value > first) {
          second = first;
          first = value;
          best = c - tables.cell_begin[n];
        } else if (value > second) {
          second = value;
        }
      }
      labels.push_back(first - second > T(tables.margin[n]) ? static_cast<std::uint8_t>(best) : kUncertainCell);
    }
  return labels;
}

}  // namespace skeletex
