// SPDX-License-Identifier: MIT
#include "skeletex/edit/morph/angle_map.h"

#include <algorithm>
#include <cmath>

namespace skeletex {
namespace {

using Intervals = std::vector<AngleInterval>;

Intervals::const_iterator find_neighbour(const Intervals& loop, int neighbour) {
  return std::find_if(loop.begin(), loop.end(),
                      [&](const AngleInterval& interval) { return interval.neighbour == neighbour; });
}

/// The intervals of a loop whose neighbours another loop has, from the first neighbour of that loop on.
Intervals common_intervals(const Intervals& loop, const Intervals& other) {
  const auto first = static_cast<std::size_t>(find_neighbour(loop, other[0].neighbour) - loop.begin());
  Intervals common;
  for (std::size_t i = 0; i < loop.size(); ++i) {
    const std::size_t at = (first + i) % loop.size();
    const double turns = at < first ? 1 : 0;
    if (find_neighbour(other, loop[at].neighbour) != other.end())
      common.push_back({loop[at].neighbour, loop[at].begin + turns, loop[at].end + turns});
  }
  return common;
}

bool have_same_neighbours(const Intervals& a, const Intervals& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const AngleInterval& p, const AngleInterval& q) { return p.neighbour == q.neighbour; });
}

}  // namespace

double map_angle(const std::vector<AnglePair>& pairs, double AnglePair::*from, double AnglePair::*to, double turn) {
  const double first = pairs.front().*from, whole = std::floor(turn - first);
  const double local = turn - whole;
  std::size_t i = pairs.size() - 1;
  while (i > 0 && pairs[i].*from > local) --i;
  const bool is_last = i + 1 == pairs.size();
  const double begin = pairs[i].*from, width = (is_last ? first + 1 : pairs[i + 1].*from) - begin;
  const double y = pairs[i].*to, height = (is_last ? pairs.front().*to + 1 : pairs[i + 1].*to) - y;
  return whole + y + (width > 0 ? (local - begin) / width * height : height / 2);
}

std::vector<AnglePair> pair_bounds(const Intervals& target, Intervals model) {
  std::erase_if(
      model, [&](const AngleInterval& interval) { return find_neighbour(target, interval.neighbour) == target.end(); });
  if (model.empty()) return {};
  Intervals common = common_intervals(target, model);
  while (!have_same_neighbours(common, model)) {
    model.erase(std::min_element(model.begin(), model.end(), [](const AngleInterval& p, const AngleInterval& q) {
      return p.end - p.begin < q.end - q.begin;
    }));
    if (model.empty()) return {};
    common = common_intervals(target, model);
  }
  // Between two common neighbours, what only one loop has is divided at its middle.
  std::vector<AnglePair> pairs(1);
  for (std::size_t i = 0; i < model.size(); ++i) {
    const bool is_last = i + 1 == model.size();
    const double next_target = is_last ? common[0].begin + 1 : common[i + 1].begin,
                 next_model = is_last ? model[0].begin + 1 : model[i + 1].begin;
    pairs.push_back({(model[i].end + next_model) / 2, (common[i].end + next_target) / 2});
  }
  // The last pair is the first one, a turn later.
  pairs[0] = {pairs.back().model - 1, pairs.back().target - 1};
  pairs.pop_back();
  return pairs;
}

}  // namespace skeletex
