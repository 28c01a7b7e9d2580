// SPDX-License-Identifier: MIT
#include "skeletex/model/loop_turns.h"

#include <algorithm>
#include <cmath>

namespace skeletex {
namespace {

/// Part of a turn that is spread over the steps evenly, so that equal points get different v.
constexpr double kEvenPart = 1e-4;

/// The sequence that is nearest to y in the least-squares sense and grows by at least spacing[i] from i to i + 1, for a
/// sequence that goes on with y[i + n] = y[i] + 1. Pool-adjacent-violators on three periods: the middle one feels no end.
std::vector<double> nearest_increasing(const std::vector<double>& y, const std::vector<double>& spacing) {
  const int n = static_cast<int>(y.size());
  struct Block {
    double sum;
    int count;
    double mean() const { return sum / count; }
  };
  std::vector<double> offset(3 * n, 0);
  for (int i = 1; i < 3 * n; ++i) offset[i] = offset[i - 1] + spacing[(i - 1) % n];
  std::vector<Block> blocks;
  for (int i = 0; i < 3 * n; ++i) {
    blocks.push_back({y[i % n] + i / n - offset[i], 1});
    while (blocks.size() > 1 && blocks[blocks.size() - 2].mean() > blocks.back().mean()) {
      const Block last = blocks.back();
      blocks.pop_back();
      blocks.back().sum += last.sum;
      blocks.back().count += last.count;
    }
  }
  std::vector<double> x(n);
  int i = 0;
  for (const Block& block : blocks)
    for (int k = 0; k < block.count; ++k, ++i)
      if (i / n == 1) x[i - n] = block.count == 1 ? y[i - n] : block.mean() + offset[i] - 1;
  return x;
}

}  // namespace

std::optional<std::vector<double>> loop_turns(const std::vector<Vec3>& points, const std::vector<double>& turns, double least_density) {
  const std::size_t count = points.size();
  if (count < 3) return {};
  std::vector<double> lifted{turns[0]}, spacing(count);
  double total = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double step = turns[(i + 1) % count] - turns[i];
    lifted.push_back(lifted.back() + step - std::round(step));
    total += spacing[i] = (points[(i + 1) % count] - points[i]).norm();
  }
  if (!(std::abs(lifted.back() - lifted.front() - 1) <= 1e-6)) return {};  // also when an angle is no number
  lifted.pop_back();
  const bool has_length = total > 0 && std::isfinite(total);
  for (double& s : spacing) s = (least_density - kEvenPart) * (has_length ? s / total : 0) + kEvenPart / static_cast<double>(count);
  return nearest_increasing(lifted, spacing);
}

std::vector<Vec3> points_at_columns(std::vector<Vec3> points, std::vector<double> turns, int columns) {
  points.push_back(points.front());
  turns.push_back(turns.front() + 1);
  std::vector<Vec3> result(columns);
  std::size_t at = 0;
  const int first = static_cast<int>(std::ceil(turns.front() * columns));
  for (int i = 0; i < columns; ++i) {
    const int column = first + i;
    const double turn = static_cast<double>(column) / columns;
    while (at + 2 < turns.size() && turns[at + 1] < turn) ++at;
    const double span = turns[at + 1] - turns[at];
    const double t = span > 0 ? std::clamp((turn - turns[at]) / span, 0.0, 1.0) : 0;
    result[((column % columns) + columns) % columns] = points[at] + t * (points[at + 1] - points[at]);
  }
  return result;
}

}  // namespace skeletex
