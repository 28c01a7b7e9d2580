// SPDX-License-Identifier: MIT
#pragma once
#include <Eigen/Core>
#include <span>
#include <vector>

namespace skeletex {

/// A point of a patch that is moved: places as (column, row), in texels.
struct PlaceMove {
  Eigen::Vector2d from = Eigen::Vector2d::Zero(), to = Eigen::Vector2d::Zero();
};

/// A smooth one-to-one map of a patch to itself which moves given places to others, and leaves the rows at its ends
/// where they are. It is the flow of landmarks (Joshi and Miller 2000): all landmarks walk at constant speed, and at
/// each step the other points follow by radial functions, Matern's of smoothness 3/2, which fade out towards the ends.
class PatchWarp {
 public:
  /// \param width, height  of the patch, texels; columns are periodic
  /// \param moves  each by the shorter way around
  /// \pre no move begins on an end, and no two at one place
  PatchWarp(int width, int height, std::span<const PlaceMove> moves);

  /// How far a place moves.
  Eigen::Vector2d move(const Eigen::Vector2d& place) const;

 private:
  struct Step {
    std::vector<Eigen::Vector2d> places, strengths;  ///< per landmark
  };
  double kernel(const Eigen::Vector2d& a, const Eigen::Vector2d& b) const;
  double fade(double row) const;
  Eigen::Vector2d velocity(const Step& step, const Eigen::Vector2d& place) const;

  int width_, height_;
  double reach_ = 1, fade_rows_ = 1;
  std::vector<Step> steps_;
};

}  // namespace skeletex
