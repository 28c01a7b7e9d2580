// SPDX-License-Identifier: MIT
#include "skeletex/geometry/loop_turns.h"

#include <algorithm>
#include <cmath>

namespace skeletex {
namespace {

/// Part of a turn that is spread over the steps evenly, so that equal points get different v.
constexpr double kEvenPart = 1e-4;

/// The sequence that is nearest to y in the least-squares sense, each point weighing weights[i], and grows by at least
/// spacing[i] from i to i + 1: pool adjacent violators.
std::vector<double> nearest_increasing(const std::vector<double>& y, const std::vector<double>& weights,
                                       const std::vector<double>& spacing) {
  struct Block {
    double sum, weight;
    int count;
    double mean() const { return sum / weight; }
  };
  std::vector<double> offset(y.size(), 0);
  std::vector<Block> blocks;
  for (std::size_t i = 0; i < y.size(); ++i) {
    if (i > 0) offset[i] = offset[i - 1] + spacing[i - 1];
    blocks.push_back({weights[i] * (y[i] - offset[i]), weights[i], 1});
    while (blocks.size() > 1 && blocks[blocks.size() - 2].mean() > blocks.back().mean()) {
      const Block last = blocks.back();
      blocks.pop_back();
      blocks.back().sum += last.sum;
      blocks.back().weight += last.weight;
      blocks.back().count += last.count;
    }
  }
  std::vector<double> x;
  for (const Block& block : blocks)
    for (int k = 0; k < block.count; ++k) x.push_back(block.count == 1 ? y[x.size()] : block.mean() + offset[x.size()]);
  return x;
}

/// The same for a sequence that goes on with y[i + n] = y[i] + 1: the middle one of three periods feels no end.
std::vector<double> nearest_increasing_loop(const std::vector<double>& y, const std::vector<double>& weights,
                                            const std::vector<double>& spacing) {
  const std::size_t n = y.size();
  std::vector<double> all_y, all_weights, all_spacing;
  for (const int period : {-1, 0, 1}) {
    for (const double value : y) all_y.push_back(value + period);
    all_weights.insert(all_weights.end(), weights.begin(), weights.end());
    all_spacing.insert(all_spacing.end(), spacing.begin(), spacing.end());
  }
  const std::vector<double> x = nearest_increasing(all_y, all_weights, all_spacing);
  return {x.begin() + n, x.begin() + 2 * n};
}

}  // namespace

std::optional<std::vector<double>> loop_turns(const std::vector<Vec3>& points, const std::vector<double>& turns,
                                              double least_density) {
  const std::size_t count = points.size();
  if (count < 3) return {};
  std::vector<double> lifted{turns[0]}, spacing(count);
  double total = 0;
  for (std::size_t i = 0; i < count; ++i) {
    lifted.push_back(lifted.back() + shortest_turn(turns[(i + 1) % count] - turns[i]));
    total += spacing[i] = (points[(i + 1) % count] - points[i]).norm();
  }
  if (!(std::abs(lifted.back() - lifted.front() - 1) <= 1e-6)) return {};  // also when an angle is no number
  lifted.pop_back();
  const bool has_length = total > 0 && std::isfinite(total);
  for (double& s : spacing)
    s = (least_density - kEvenPart) * (has_length ? s / total : 0) + kEvenPart / static_cast<double>(count);
  // Points weigh as much of the length as lies nearest to them, so that it does not matter how densely a loop is
  // sampled.
  std::vector<double> weights(count);
  for (std::size_t i = 0; i < count; ++i) weights[i] = spacing[i] + spacing[(i + count - 1) % count];
  return nearest_increasing_loop(lifted, weights, spacing);
}

std::vector<double> arc_shares(const std::vector<Vec3>& points, const std::vector<double>& turns,
                               double least_density) {
  const std::size_t steps = points.size() - 1;
  std::vector<double> lifted{0}, spacing(steps), weights(steps + 1, 0);
  double total = 0;
  for (std::size_t i = 0; i < steps; ++i) {
    lifted.push_back(lifted.back() + shortest_turn(turns[i + 1] - turns[i]));
    total += spacing[i] = (points[i + 1] - points[i]).norm();
  }
  // Whichever way the angles run; on an arc of no angle all that counts is the length.
  const double turning = lifted.back(), least = kEvenPart;
  if (turning < 0)
    for (double& turn : lifted) turn = -turn;
  const double width = std::max(std::abs(turning), least);
  for (std::size_t i = 0; i < steps; ++i) {
    spacing[i] = width * ((least_density - kEvenPart) * (total > 0 ? spacing[i] / total : 0) +
                          kEvenPart / static_cast<double>(steps));
    weights[i] += spacing[i];
    weights[i + 1] += spacing[i];
  }
  std::vector<double> shares = nearest_increasing(lifted, weights, spacing);
  const double begin = shares.front(), end = shares.back();
  for (double& share : shares) share = (share - begin) / (end - begin);
  return shares;
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
