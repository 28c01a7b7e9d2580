// SPDX-License-Identifier: MIT
// A part of find_correspondence.
#pragma once
#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

namespace skeletex {

/// What each of some bones costs as each of as many targets, of which some are taken. Infinite: it may not be it.
class CostTable {
 public:
  explicit CostTable(std::size_t count)
      : count_(count), costs_(count * count, std::numeric_limits<double>::infinity()), is_taken_(count, 0) {}
  double& of(std::size_t bone, std::size_t target) { return costs_[bone * count_ + target]; }
  void take(std::size_t target, bool is_taken) { is_taken_[target] = is_taken; }

  /// A lower bound of what this bone and those after it cost.
  double least_from(std::size_t bone) const {
    double sum = 0;
    for (; bone < count_; ++bone) {
      double least = std::numeric_limits<double>::infinity();
      for (std::size_t j = 0; j < count_; ++j)
        if (!is_taken_[j]) least = std::min(least, costs_[bone * count_ + j]);
      sum += least;
    }
    return sum;
  }
  /// The targets that are not taken.
  std::vector<std::size_t> cheapest_first(std::size_t bone) const {
    std::vector<std::size_t> targets;
    for (std::size_t j = 0; j < count_; ++j)
      if (!is_taken_[j]) targets.push_back(j);
    const double* row = costs_.data() + bone * count_;
    std::stable_sort(targets.begin(), targets.end(), [row](std::size_t a, std::size_t b) { return row[a] < row[b]; });
    return targets;
  }

 private:
  std::size_t count_;
  std::vector<double> costs_;
  std::vector<char> is_taken_;
};

}  // namespace skeletex
