// SPDX-License-Identifier: MIT
#include "skeletex/skeletonize/body/mirror.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <vector>

#include "skeletex/geometry/parallel.h"

namespace skeletex {
namespace {

constexpr double kLargestError = 0.004;  // diagonals
constexpr std::size_t kPoints = 600;

/// Mean distance of the mirrored points from the surface, diagonals.
double mirror_error(const Surface& surface, const std::vector<Vec3>& points, const MirrorPlane& plane) {
  std::vector<double> distances(points.size());
  for_each_index(points.size(), 64, [&](std::size_t i) { distances[i] = surface.radius(plane.mirrored(points[i])); });
  double sum = 0;
  for (const double d : distances) sum += d;
  return sum / static_cast<double>(points.size()) / surface.diagonal;
}

}  // namespace

std::optional<MirrorPlane> find_mirror_plane(const Surface& surface, const VoxelBody& body) {
  std::vector<Vec3> points;
  const std::size_t count = surface.mesh.positions.size(), step = std::max<std::size_t>(1, count / kPoints);
  for (std::size_t i = 0; i < count; i += step) points.push_back(surface.mesh.positions[i]);
  Vec3 centre = Vec3::Zero();
  for (const Vec3& p : body.centres) centre += p;
  centre /= body.size();
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  for (const Vec3& p : body.centres) moments += (p - centre) * (p - centre).transpose();
  const Eigen::Matrix3d axes = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(moments).eigenvectors();
  std::optional<MirrorPlane> best;
  double least = kLargestError;
  for (int i = 0; i < 6; ++i) {
    Vec3 normal = i < 3 ? Vec3(Vec3::Unit(i)) : Vec3(axes.col(i - 3));
    int largest = 0;
    normal.cwiseAbs().maxCoeff(&largest);
    if (normal[largest] < 0) normal = -normal;
    const MirrorPlane plane{centre, normal};
    const double error = mirror_error(surface, points, plane);
    // An axis of space is taken over one that is only a little better.
    if (error < (best ? (i < 3 ? 0.98 : 0.8) * least : least)) best = plane, least = error;
  }
  return best;
}

}  // namespace skeletex
