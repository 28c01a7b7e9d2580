// SPDX-License-Identifier: MIT
#include "skeletex/convert/fit/mean_distance.h"

#include <algorithm>
#include <utility>

namespace skeletex {
namespace {

constexpr double kSqueezed = 20;  // times the mean of the median patch

}  // namespace

MeanDistance::MeanDistance(std::vector<int> texel_patches, std::size_t patches)
    : texel_patches_(std::move(texel_patches)), is_left_out_(patches, false) {}

void MeanDistance::leave_out_squeezed(std::span<const float> costs, std::span<const float> areas) {
  struct Sum {
    double cost = 0, area = 0;
  };
  std::vector<Sum> sums(is_left_out_.size());
  for (std::size_t t = 0; t < texel_patches_.size(); ++t)
    if (texel_patches_[t] >= 0) {
      Sum& sum = sums[texel_patches_[t]];
      sum.cost += static_cast<double>(costs[t]), sum.area += static_cast<double>(areas[t]);
    }
  std::vector<double> means;
  for (const Sum& sum : sums)
    if (sum.area > 0) means.push_back(sum.cost / sum.area);
  if (means.empty()) return;
  const auto median = means.begin() + static_cast<std::ptrdiff_t>(means.size() / 2);
  std::nth_element(means.begin(), median, means.end());
  for (std::size_t p = 0; p < sums.size(); ++p) is_left_out_[p] = sums[p].cost > kSqueezed * *median * sums[p].area;
}

double MeanDistance::of(std::span<const float> costs, std::span<const float> areas) const {
  double cost = 0, area = 0;
  for (std::size_t t = 0; t < texel_patches_.size(); ++t)
    if (texel_patches_[t] >= 0 && !is_left_out_[texel_patches_[t]])
      cost += static_cast<double>(costs[t]), area += static_cast<double>(areas[t]);
  return area > 0 ? cost / area : 0;
}

}  // namespace skeletex
