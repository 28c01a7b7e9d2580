// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <vector>

namespace skeletex {

/// How new samples follow from old ones, along one axis of the lattice.
enum class ResampleFilter {
  kSample,   ///< the curve through the old samples (see softness), read at the new places
  kLinear,   ///< the polygon through the old samples, read at the new places: values stay between the old ones
  kAverage,  ///< a tent over the new cells: smooths, and shrinks what is convex
  kProject,  ///< the polygon over the new samples that is nearest to the old one in the least-squares sense
};

/// Weights of one axis: new sample i = sum over t of weights[taps[i][2] + t] * old[taps[i][0] + t], t < taps[i][1].
struct FilterTaps {
  std::vector<std::array<int, 4>> taps;  ///< first old sample, count, first weight, 0
  std::vector<float> weights;            ///< each new sample's sum to 1
};
/// \param softness  where the lattice gets finer, the surface between old samples is the cubic that passes through
///                  p + softness * (second difference of p); 1/16 takes back the encoder's prefilter, 0 passes through
///                  p
/// \param is_periodic  sample i lies at i / count and old indices wrap round (they stay below old_count, so do counts);
///                     otherwise at i / (count - 1), and the two ends are kept as they are
FilterTaps filter_taps(int old_count, int new_count, bool is_periodic, ResampleFilter filter, double softness);

}  // namespace skeletex
