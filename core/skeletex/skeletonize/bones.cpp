// SPDX-License-Identifier: MIT
#include "skeletex/skeletonize/bones.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include "skeletex/math/portable.h"

namespace skeletex {
namespace {

constexpr double kLeastBend = 0.025;  // of the diagonal, where the body is thin
constexpr double kSpare = 0.25;       // of the radius: what a bone leaves to the surface

double distance_to_line(const Vec3& p, const Vec3& a, const Vec3& b) { return distance_to_bone(p, a, b); }

/// A branch as it is made straight.
class Straightener {
 public:
  Straightener(const Surface& surface, double side, const std::vector<Vec3>& points, double bend)
      : surface_(surface), side_(side), points_(points), bend_(bend) {
    for (const Vec3& p : points) radii_.push_back(surface.radius(p));
  }

  /// Where the branch is split, ascending, its ends included.
  /// \param bones  at least so many
  std::vector<int> run(int bones) {
    const int last = static_cast<int>(points_.size()) - 1;
    std::vector<int> kept;
    for (int i = 0; i <= bones; ++i)
      kept.push_back(static_cast<int>(std::lround(static_cast<double>(i) * last / bones)));
    kept.erase(std::unique(kept.begin(), kept.end()), kept.end());
    std::vector<int> all{kept[0]};
    for (std::size_t i = 0; i + 1 < kept.size(); ++i) {
      split(kept[i], kept[i + 1], all);
      all.push_back(kept[i + 1]);
    }
    return all;
  }

 private:
  bool is_inside(int a, int b) const {
    const Vec3 &p = points_[a], &q = points_[b];
    return !surface_.is_between(p, q);
  }
  bool has_room(int a, int b) const {
    const Vec3 &p = points_[a], &q = points_[b];
    for (int i = a + 1; i < b; ++i) {
      const Vec3 at = p + (q - p) * (i - a) / (b - a);
      if (surface_.is_near(at, kSpare * radii_[i])) return false;
    }
    return true;
  }

  void split(int a, int b, std::vector<int>& kept) {
    if (b - a < 2) return;
    double worst = 0;
    int at = (a + b) / 2;
    for (int i = a + 1; i < b; ++i) {
      const double allowed = bend_ * std::max({radii_[i], side_, kLeastBend * surface_.diagonal});
      const double off = distance_to_line(points_[i], points_[a], points_[b]) / allowed;
      if (off > worst) worst = off, at = i;
    }
    const bool is_short = (points_[b] - points_[a]).norm() < 2 * radii_[at];
    if (worst <= 1 && is_inside(a, b) && (is_short || has_room(a, b))) return;
    split(a, at, kept);
    kept.push_back(at);
    split(at, b, kept);
  }

  const Surface& surface_;
  double side_;
  const std::vector<Vec3>& points_;
  double bend_;
  std::vector<double> radii_;
};

/// Shortens a branch from a free end at its front: the ball at the new end reaches the tip.
void draw_back(const Surface& surface, double side, std::vector<Vec3>& points) {
  constexpr double kThin = 0.6;  // of a voxel's side: a body too thin for its curve to be trusted
  const Vec3 tip = points.front();
  std::size_t first = 0;
  for (; first + 2 < points.size(); ++first) {
    const double radius = surface.radius(points[first]);
    if ((points[first] - tip).norm() + 0.5 * side >= radius && radius > kThin * side) break;
  }
  points.erase(points.begin(), points.begin() + static_cast<std::ptrdiff_t>(first));
}

/// The least distance from the surface of the nodes and the middles of the bones; 0 where the ring is not inside.
double depth_of_ring(const Surface& surface, const std::vector<Vec3>& curve_inside, const Skeleton& ring) {
  double depth = surface.diagonal;
  for (const Bone& bone : ring.bones) {
    const Vec3 &head = ring.nodes[bone.head].position, &tail = ring.nodes[bone.tail].position;
    if (surface.is_between(head, tail)) return 0;
    depth = std::min({depth, surface.radius(head), surface.radius(0.5 * (head + tail))});
  }
  const bool is_inside = std::any_of(curve_inside.begin(), curve_inside.end(),
                                     [&](const Vec3& p) { return !surface.is_between(p, ring.nodes[0].position); });
  return is_inside ? depth : 0;
}

}  // namespace

std::vector<int> straighten(const Surface& surface, double voxel_side, const std::vector<Vec3>& points, int pieces,
                            double bend) {
  return Straightener(surface, voxel_side, points, bend).run(pieces);
}

Skeleton make_bones(const Surface& surface, double voxel_side, const CurveGraph& graph, double bend) {
  Skeleton skeleton;
  const std::vector<int> degree = graph.degrees();
  for (const Vec3& node : graph.nodes) skeleton.nodes.push_back({"", node});
  std::map<std::pair<int, int>, int> between;  // branches between two nodes
  for (const Branch& branch : graph.branches) ++between[std::minmax(branch.from, branch.to)];
  for (const Branch& branch : graph.branches) {
    std::vector<Vec3> points = branch.points;
    if (degree[branch.from] == 1) {
      draw_back(surface, voxel_side, points);
      skeleton.nodes[branch.from].position = points.front();
    }
    if (degree[branch.to] == 1) {
      std::reverse(points.begin(), points.end());
      draw_back(surface, voxel_side, points);
      std::reverse(points.begin(), points.end());
      skeleton.nodes[branch.to].position = points.back();
    }
    const int least = branch.from == branch.to ? 3 : between[std::minmax(branch.from, branch.to)] > 1 ? 2 : 1;
    const std::vector<int> kept = straighten(surface, voxel_side, points, least, bend);
    int before = branch.from;
    for (std::size_t i = 1; i < kept.size(); ++i) {
      NodeIndex node = branch.to;
      if (i + 1 < kept.size()) {
        node = static_cast<int>(skeleton.nodes.size());
        skeleton.nodes.push_back({"", points[kept[i]]});
      }
      skeleton.bones.push_back({"", before, node, {}});
      before = node;
    }
  }
  return skeleton;
}

Skeleton make_even_ring(const Surface& surface, const VoxelBody& body, const CurveGraph& graph, int bones) {
  if (graph.branches.size() != 1 || graph.nodes.size() != 1) return {};
  const std::vector<Vec3>& curve = graph.branches[0].points;
  Vec3 centre = Vec3::Zero(), area = Vec3::Zero();
  for (const Vec3& p : body.centres) centre += p / body.size();
  for (std::size_t i = 0; i + 1 < curve.size(); ++i) area += (curve[i] - centre).cross(curve[i + 1] - centre);
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  for (const Vec3& p : body.centres) moments += (p - centre) * (p - centre).transpose();
  const Eigen::Matrix3d axes = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(moments).eigenvectors();
  int along = 0;
  (axes.transpose() * area).cwiseAbs().maxCoeff(&along);
  const Vec3 across = axes.col((along + 1) % 3), up = axes.col((along + 2) % 3);
  double radius = 0;
  for (const Vec3& p : body.centres) radius += std::hypot(across.dot(p - centre), up.dot(p - centre)) / body.size();
  Skeleton best;
  double most_depth = 0;
  for (double share = 0.6; share < 1.5; share += 0.02) {
    Skeleton ring;
    for (int n = 0; n < bones; ++n) {
      const double angle = 2 * std::numbers::pi * n / bones;
      ring.nodes.push_back({"", centre + share * radius * (portable::cos(angle) * across + portable::sin(angle) * up)});
      ring.bones.push_back({"", n, (n + 1) % bones, {}});
    }
    const double depth = depth_of_ring(surface, curve, ring);
    if (depth > most_depth) most_depth = depth, best = std::move(ring);
  }
  return best;
}

}  // namespace skeletex
