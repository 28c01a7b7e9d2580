// SPDX-License-Identifier: MIT
#pragma once
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "skeletex/skeleton/skeleton.h"

namespace skeletex::test {

/// A direction evenly spread over the sphere.
inline Vec3 random_direction(std::mt19937& random) {
  std::normal_distribution<double> normal;
  const double x = normal(random), y = normal(random), z = normal(random);
  return Vec3(x, y, z).normalized();
}

inline double random_between(std::mt19937& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

/// Node 0 with one bone in each direction, of length 0.5 to 2, heads and tails at random, no s given.
inline Skeleton star_skeleton(const std::vector<Vec3>& directions, std::mt19937& random) {
  Skeleton skeleton;
  skeleton.nodes.push_back({"centre", random_between(random, 0.1, 2) * random_direction(random)});
  for (std::size_t i = 0; i < directions.size(); ++i) {
    skeleton.nodes.push_back(
        {"end" + std::to_string(i), skeleton.nodes[0].position + random_between(random, 0.5, 2) * directions[i]});
    const bool is_head_here = random() % 2 == 0;
    const int end = static_cast<int>(i) + 1;
    skeleton.bones.push_back({"bone" + std::to_string(i), is_head_here ? 0 : end, is_head_here ? end : 0, {}});
  }
  return skeleton;
}

/// As many directions, no two closer than `least_angle` (radians).
inline std::vector<Vec3> spread_directions(int count, double least_angle, std::mt19937& random) {
  std::vector<Vec3> directions;
  while (static_cast<int>(directions.size()) < count) {
    const Vec3 d = random_direction(random);
    if (std::all_of(directions.begin(), directions.end(),
                    [&](const Vec3& other) { return d.dot(other) < std::cos(least_angle); }))
      directions.push_back(d);
  }
  return directions;
}

/// A tree of bones with random branching; neighbouring bones are at least 30 degrees apart.
inline Skeleton random_tree(int bones, std::mt19937& random) {
  Skeleton skeleton;
  skeleton.nodes.push_back({"root", Vec3::Zero()});
  while (static_cast<int>(skeleton.bones.size()) < bones) {
    const int from = static_cast<int>(random() % skeleton.nodes.size());
    const Vec3 d = random_direction(random);
    const auto at = bones_at_nodes(skeleton);
    if (std::any_of(at[from].begin(), at[from].end(),
                    [&](const BoneAtNode& b) { return d.dot(direction_from(skeleton, b)) > std::cos(0.5); }))
      continue;
    const int to = static_cast<int>(skeleton.nodes.size());
    skeleton.nodes.push_back(
        {"node" + std::to_string(to), skeleton.nodes[from].position + random_between(random, 0.5, 2) * d});
    const bool is_forward = random() % 2 == 0;
    skeleton.bones.push_back({"bone" + std::to_string(to), is_forward ? from : to, is_forward ? to : from, {}});
  }
  return skeleton;
}

/// Distance between two angles in turns, at most 1/2.
inline double turn_distance(double a, double b) {
  const double d = a - b - std::floor(a - b);
  return std::min(d, 1 - d);
}

}  // namespace skeletex::test
