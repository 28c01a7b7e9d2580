// SPDX-License-Identifier: MIT
#include "skeletex/edit/morph/patch_warp.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace skeletex {
namespace {

constexpr int kSteps = 48;
constexpr double kLeastReach = 1.0 / 8;  // of the patch's columns

}  // namespace

PatchWarp::PatchWarp(int width, int height, std::span<const PlaceMove> moves) : width_(width), height_(height) {
  const auto count = static_cast<Eigen::Index>(moves.size());
  std::vector<Eigen::Vector2d> places, ways;
  double to_end = height, farthest = kLeastReach * width;
  for (const PlaceMove& move : moves) {
    Eigen::Vector2d way = move.to - move.from;
    way.x() -= width * std::round(way.x() / width);
    places.push_back(move.from), ways.push_back(way);
    farthest = std::max(farthest, way.norm());
    for (const double row : {move.from.y(), move.to.y()}) to_end = std::min({to_end, row, height - 1 - row});
  }
  reach_ = farthest;
  fade_rows_ = std::max(1.0, std::min(farthest, to_end));
  for (int i = 0; i < kSteps; ++i) {
    Eigen::MatrixXd kernels(count, count);
    Eigen::MatrixX2d speeds(count, 2);
    for (Eigen::Index a = 0; a < count; ++a) {
      speeds.row(a) = ways[a].transpose() / kSteps;
      for (Eigen::Index b = 0; b < count; ++b) kernels(a, b) = kernel(places[a], places[b]);
    }
    const Eigen::MatrixX2d strengths = kernels.ldlt().solve(speeds);
    Step step{places, {}};
    for (Eigen::Index a = 0; a < count; ++a) step.strengths.emplace_back(strengths.row(a).transpose());
    steps_.push_back(std::move(step));
    for (std::size_t a = 0; a < places.size(); ++a) places[a] += ways[a] / kSteps;
  }
}

double PatchWarp::fade(double row) const {
  return (1 - std::exp(-row / fade_rows_)) * (1 - std::exp(-(height_ - 1 - row) / fade_rows_));
}

double PatchWarp::kernel(const Eigen::Vector2d& a, const Eigen::Vector2d& b) const {
  // Columns lie on a circle, whose chord is smooth all around.
  const double chord = width_ / std::numbers::pi * std::sin(std::numbers::pi * (a.x() - b.x()) / width_);
  const double distance = std::hypot(chord, a.y() - b.y()) / reach_;
  return fade(a.y()) * fade(b.y()) * (1 + distance) * std::exp(-distance);
}

Eigen::Vector2d PatchWarp::velocity(const Step& step, const Eigen::Vector2d& place) const {
  Eigen::Vector2d velocity = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < step.places.size(); ++i) velocity += kernel(place, step.places[i]) * step.strengths[i];
  return velocity;
}

Eigen::Vector2d PatchWarp::move(const Eigen::Vector2d& place) const {
  Eigen::Vector2d moved = place;
  for (const Step& step : steps_) moved += velocity(step, moved);
  return moved - place;
}

}  // namespace skeletex
