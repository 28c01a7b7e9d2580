// SPDX-License-Identifier: MIT
#include "skeletex/edit/transfer/bone_profile.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace skeletex {

BonePoints download_points(ClContext& context, const DevicePlanes& points) {
  return {download_planes(context, points)};
}

BoneProfile bone_profile(const PatchPoints& patch, int column, BoneEnd end, double length) {
  BoneProfile result;
  for (int r = 0; r < patch.height; ++r) {
    const int row = end == BoneEnd::kHead ? r : patch.height - 1 - r;
    Vec3 p = about_bone(patch.points->at(patch.first + static_cast<std::size_t>(row) * patch.width + column), column,
                        patch.width);
    if (end == BoneEnd::kTail) p.z() = length - p.z();
    result.push_back(p);
  }
  return result;
}

Vec3 at_row(const BoneProfile& profile, double row) {
  const int below = std::clamp(static_cast<int>(row), 0, static_cast<int>(profile.size()) - 2);
  const double share = std::clamp(row - below, 0.0, 1.0);
  return (1 - share) * profile[below] + share * profile[below + 1];
}

Vec3 about_bone(const Vec3& vector, int column, int width) {
  const double angle = 2 * std::numbers::pi * column / width, c = std::cos(angle), s = std::sin(angle);
  return {c * vector.x() + s * vector.y(), c * vector.y() - s * vector.x(), vector.z()};
}

void smooth_around(std::vector<double>& values) {
  const int count = static_cast<int>(values.size()), radius = std::max(1, count / 10);
  for (int pass = 0; pass < 2; ++pass) {
    std::vector<double> smooth(count);
    double sum = 0;
    for (int i = -radius; i <= radius; ++i) sum += values[(i + count) % count];
    for (int i = 0; i < count; ++i) {
      smooth[i] = sum / (2 * radius + 1);
      sum += values[(i + radius + 1) % count] - values[(i - radius + count) % count];
    }
    values = std::move(smooth);
  }
}

}  // namespace skeletex
