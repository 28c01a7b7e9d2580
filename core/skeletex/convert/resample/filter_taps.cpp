// SPDX-License-Identifier: MIT
#include "skeletex/convert/resample/filter_taps.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace skeletex {
namespace {

/// The surface between old samples, along one axis: linear where the lattice gets coarser; where it gets finer, a cubic
/// of Mitchell and Netravali's family on the Keys line, which passes through P + B / 6 * (second difference of P).
struct Interpolant {
  bool is_cubic = false;
  double softness = 0;  // B / 6

  /// Weights of the samples floor(x) - 1 .. floor(x) + 2.
  std::array<double, 4> weights(double fraction) const {
    if (!is_cubic) return {0, 1 - fraction, fraction, 0};
    const double b = 6 * softness, c = (1 - b) / 2;
    const auto kernel = [b, c](double x) {
      x = std::abs(x);
      return x < 1 ? ((12 - 9 * b - 6 * c) * x * x * x + (-18 + 12 * b + 6 * c) * x * x + (6 - 2 * b)) / 6
                   : ((-b - 6 * c) * x * x * x + (6 * b + 30 * c) * x * x + (-12 * b - 48 * c) * x + (8 * b + 24 * c)) /
                         6;
    };
    return {kernel(1 + fraction), kernel(fraction), kernel(1 - fraction), kernel(2 - fraction)};
  }
};

/// Weights over consecutive samples of an axis that runs on past its ends.
struct OpenWeights {
  int first = 0;
  std::vector<double> values;

  void add(int index, double weight) {
    if (values.empty()) first = index;
    if (index < first) {
      values.insert(values.begin(), first - index, 0.0);
      first = index;
    }
    if (index >= first + static_cast<int>(values.size())) values.resize(index - first + 1, 0.0);
    values[index - first] += weight;
  }
  void add_at(const Interpolant& interpolant, double x, double weight) {
    const int cell = static_cast<int>(std::floor(x));
    const std::array<double, 4> w = interpolant.weights(x - cell);
    for (int k = 0; k < 4; ++k)
      if (w[k] != 0) add(cell - 1 + k, weight * w[k]);
  }
  /// Adds `weight` times the mean over the tent of half-width h around x: exact, by Gauss' rule between the kinks.
  void add_tent(const Interpolant& interpolant, double x, double h, double weight) {
    static const std::array<double, 3> nodes{-std::sqrt(0.6), 0.0, std::sqrt(0.6)}, gauss{5.0 / 9, 8.0 / 9, 5.0 / 9};
    for (double a = x - h; a < x + h - 1e-12 * h;) {
      double b = std::min(x + h, std::floor(a + 1e-9) + 1);
      if (a < x - 1e-9 * h) b = std::min(b, x);
      for (int k = 0; k < 3; ++k) {
        const double at = 0.5 * (a + b) + 0.5 * (b - a) * nodes[k];
        add_at(interpolant, at, weight * 0.5 * (b - a) * gauss[k] * (1 - std::abs(at - x) / h) / h);
      }
      a = b;
    }
  }
};

/// Weights of samples first, first + 1, ...
struct FoldedWeights {
  int first = 0;
  std::vector<double> values;
};

FoldedWeights folded_round(const OpenWeights& open, int count) {
  const auto wrap = [count](int index) { return (index % count + count) % count; };
  const int size = static_cast<int>(open.values.size());
  if (size < count) return {wrap(open.first), open.values};
  FoldedWeights folded{0, std::vector<double>(count, 0.0)};
  for (int k = 0; k < size; ++k) folded.values[wrap(open.first + k)] += open.values[k];
  return folded;
}

/// By reflection in the end point, p(-x) = 2 p(0) - p(x), which keeps the end and straight lines.
FoldedWeights folded_at_ends(const OpenWeights& open, int count) {
  std::vector<double> all(count, 0.0);
  int first = count, last = -1;
  const auto add = [&](int index, double weight) {
    all[index] += weight;
    first = std::min(first, index);
    last = std::max(last, index);
  };
  for (int k = 0; k < static_cast<int>(open.values.size()); ++k) {
    int index = open.first + k;
    double weight = open.values[k];
    while (index < 0 || index >= count) {
      const int end = index < 0 ? 0 : count - 1;
      add(end, 2 * weight);
      index = 2 * end - index;
      weight = -weight;
    }
    add(index, weight);
  }
  return {first, {all.begin() + first, all.begin() + last + 1}};
}

/// Appends the weights of an axis that runs on past its ends, folded back onto its samples.
void append_folded(const OpenWeights& open, int count, bool is_periodic, FilterTaps& taps) {
  const auto [first, folded] = is_periodic ? folded_round(open, count) : folded_at_ends(open, count);
  double sum = 0;
  for (const double weight : folded) sum += weight;
  taps.taps.push_back({first, static_cast<int>(folded.size()), static_cast<int>(taps.weights.size()), 0});
  for (const double weight : folded) taps.weights.push_back(static_cast<float>(weight / sum));
}

/// Inverse of the mass matrix of linear elements, [1 4 1] / 6: g(k) = sqrt(3) z^|k|, z = sqrt(3) - 2.
constexpr int kProjectionRange = 7;
double inverse_mass(int k) { return std::numbers::sqrt3 * std::pow(std::numbers::sqrt3 - 2, std::abs(k)); }

}  // namespace

FilterTaps filter_taps(int old_count, int new_count, bool is_periodic, ResampleFilter filter, double softness) {
  FilterTaps taps;
  const double spacing =
      is_periodic ? static_cast<double>(old_count) / new_count : static_cast<double>(old_count - 1) / (new_count - 1);
  const Interpolant interpolant{spacing < 1 && filter != ResampleFilter::kLinear, softness};
  for (int i = 0; i < new_count; ++i) {
    OpenWeights open;
    const double x = is_periodic || i + 1 < new_count ? i * spacing : old_count - 1;
    if (!is_periodic && (i == 0 || i + 1 == new_count)) {
      open.add(i == 0 ? 0 : old_count - 1, 1);
    } else if (filter == ResampleFilter::kSample || filter == ResampleFilter::kLinear) {
      open.add_at(interpolant, x, 1);
    } else if (filter == ResampleFilter::kAverage) {
      open.add_tent(interpolant, x, spacing, 1);
    } else {
      for (int k = -kProjectionRange; k <= kProjectionRange; ++k)
        open.add_tent(interpolant, x + k * spacing, spacing, inverse_mass(k));
    }
    append_folded(open, old_count, is_periodic, taps);
  }
  return taps;
}

}  // namespace skeletex
