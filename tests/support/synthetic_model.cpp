// SPDX-License-Identifier: MIT
#include "support/synthetic_model.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <random>
#include <tuple>

namespace skeletex {
namespace {

constexpr double kPi = std::numbers::pi;

double smoothstep(double t) { return t * t * (3 - 2 * t); }

Skeleton star(const std::vector<Vec3>& directions) {
  Skeleton skeleton;
  skeleton.nodes.push_back({"centre", Vec3(0.1, -0.2, 0.3)});
  for (std::size_t i = 0; i < directions.size(); ++i) {
    skeleton.nodes.push_back({"end" + std::to_string(i), skeleton.nodes[0].position + directions[i]});
    const int end = static_cast<int>(i) + 1;
    // Heads and tails mixed: nothing may depend on which end lies at the branch.
    if (i % 2 == 0)
      skeleton.bones.push_back({"bone" + std::to_string(i), 0, end, {}});
    else
      skeleton.bones.push_back({"bone" + std::to_string(i), end, 0, {}});
  }
  return skeleton;
}

}  // namespace

SyntheticSurface::SyntheticSurface(Skeleton skeleton, double radius, double relief)
    : skeleton_(std::move(skeleton)), radius_(radius), relief_(relief), separation_(skeleton_) {
  const std::vector<BoneBasis> bases = separation_.bases();
  for (std::size_t i = 0; i < bases.size(); ++i) skeleton_.bones[i].s = bases[i].s;
  separation_ = SeparationPlanes(skeleton_);
}

double SyntheticSurface::seam_radius(int node, const Vec3& direction) const {
  const Vec3 a(0.6, -0.7, 0.2), b(-0.3, 0.5, 0.8);
  return radius_ * (1 + 0.1 * relief_ * std::sin(2.5 * direction.dot(a) + node) +
                    0.06 * relief_ * std::cos(3 * direction.dot(b)));
}

Vec3 SyntheticSurface::seam_point(int node, const Vec3& direction) const {
  return skeleton_.nodes[node].position + seam_radius(node, direction) * direction;
}

Vec3 SyntheticSurface::point(int bone, double u, double turn) const {
  const TangentFrame frame = tangent_frame(skeleton_, separation_, bone, u, turn);
  std::array<double, 2> ends;
  for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) {
    double& r = ends[static_cast<int>(end)];
    r = radius_;
    if (!separation_.is_free(bone, end))
      r = seam_radius(end_node(skeleton_, bone, end),
                      tangent_frame(skeleton_, separation_, bone, end == BoneEnd::kHead ? 0 : 1, turn).out);
  }
  const double t = smoothstep(u), bump = std::sin(kPi * u) * std::sin(kPi * u);
  const double r =
      (1 - t) * ends[0] + t * ends[1] + 0.1 * relief_ * radius_ * bump * std::cos(2 * kPi * (2 * turn + u));
  const Vec3 lean = 0.1 * relief_ * radius_ * bump *
                    (std::sin(2 * kPi * turn) * frame.along + std::cos(2 * kPi * 3 * turn) * frame.around);
  return frame.foot + r * frame.out + lean;
}

int SyntheticSurface::genus() const {
  return static_cast<int>(skeleton_.bones.size()) - static_cast<int>(skeleton_.nodes.size()) + 1;
}

SkeletexModel SyntheticSurface::model(const std::vector<std::pair<int, int>>& sizes) const {
  const int count = static_cast<int>(skeleton_.bones.size());
  SkeletexModel model;
  model.skeleton = skeleton_;
  model.genus = genus();
  model.origin = Vec3(0.05, 0.1, -0.15);

  // Shelves of about the square root of all texels.
  int area = 0, widest = 0;
  for (const auto& [width, height] : sizes) {
    area += width * height;
    widest = std::max(widest, width);
  }
  const int shelf = std::max(widest, static_cast<int>(std::sqrt(area)));
  int x = 0, y = 0, high = 0;
  for (int bone = 0; bone < count; ++bone) {
    const auto [width, height] = sizes[bone];
    if (x + width > shelf) {
      x = 0;
      y += high;
      high = 0;
    }
    Patch patch;
    patch.rectangle = {x, y, width, height};
    x += width;
    high = std::max(high, height);
    const bool is_free[2] = {separation_.is_free(bone, BoneEnd::kHead), separation_.is_free(bone, BoneEnd::kTail)};
    patch.topology = is_free[0] && is_free[1]   ? SegmentTopology::kSphere
                     : is_free[0] || is_free[1] ? SegmentTopology::kDisk
                                                : SegmentTopology::kAnnulus;
    for (int r = 0; r < height; ++r) {
      const double t = static_cast<double>(r) / (height - 1);
      patch.row_u.push_back(t + 0.04 * std::sin(2 * kPi * t));  // rows are not even in u
    }
    model.patches.push_back(std::move(patch));
  }
  DisplacementTexture& texture = model.texture;
  texture.width = shelf;
  texture.height = y + high;
  const std::size_t texels = static_cast<std::size_t>(texture.width) * texture.height;
  texture.along.assign(texels, 0);
  texture.around.assign(texels, 0);
  texture.out.assign(texels, 0);
  BoundingBox box{Vec3::Constant(1e9), Vec3::Constant(-1e9)};
  for (int bone = 0; bone < count; ++bone) {
    const Patch& patch = model.patches[bone];
    for (int r = 0; r < patch.rectangle.height; ++r)
      for (int j = 0; j < patch.rectangle.width; ++j) {
        const double u = patch.row_u[r], turn = static_cast<double>(j) / patch.rectangle.width;
        const Vec3 p = point(bone, u, turn);
        box.lower = box.lower.cwiseMin(p);
        box.upper = box.upper.cwiseMax(p);
        const Vec3 texel =
            encode_texel(tangent_frame(skeleton_, separation_, bone, u, turn), p,
                         end_position(skeleton_, bone, BoneEnd::kHead), end_position(skeleton_, bone, BoneEnd::kTail));
        const std::size_t at = static_cast<std::size_t>(patch.rectangle.y + r) * texture.width + patch.rectangle.x + j;
        texture.along[at] = static_cast<float>(texel[0]);
        texture.around[at] = static_cast<float>(texel[1]);
        texture.out[at] = static_cast<float>(texel[2]);
      }
  }
  model.diagonal = box.diagonal();

  // Each end is an ordered list of intervals of neighbours; bounds by scan and bisection. Corners and arcs are the same
  // from every bone that sees them, and are found again by direction.
  model.ends.resize(count);
  std::map<std::pair<int, int>, std::vector<std::pair<Vec3, int>>> corner_at;  // node -> directions
  struct StoredArc {
    int index;
    Vec3 middle;
  };
  std::map<std::tuple<int, int, int>, StoredArc> arc_at;  // node, bones
  const auto direction = [&](int bone, BoneEnd end, double turn) {
    const Vec3& s = separation_.radial(bone, turn);
    return Vec3((s + separation_.slope(bone, end, turn) * separation_.bases()[bone].o).normalized());
  };
  const auto sample = [&](int bone, BoneEnd end, double turn) {
    const int node = end_node(skeleton_, bone, end);
    const Vec3 p = seam_point(node, direction(bone, end, turn));
    turn -= std::floor(turn);
    return SeamSample{turn < 1 ? turn : 0, separation_.half_line_distance(bone, end, p)};
  };
  for (int bone = 0; bone < count; ++bone)
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) {
      if (separation_.is_free(bone, end)) continue;
      const int node = end_node(skeleton_, bone, end);
      struct Interval {
        double begin;
        int neighbour;
      };
      std::vector<Interval> intervals;
      constexpr int kScan = 20000;
      int before = separation_.neighbour(bone, end, (kScan - 1.0) / kScan);
      for (int k = 0; k < kScan; ++k) {
        const int here = separation_.neighbour(bone, end, static_cast<double>(k) / kScan);
        if (here != before) {
          double low = (k - 1.0) / kScan, high_turn = static_cast<double>(k) / kScan;
          for (int step = 0; step < 60; ++step) {
            const double middle = 0.5 * (low + high_turn);
            (separation_.neighbour(bone, end, middle) == before ? low : high_turn) = middle;
          }
          intervals.push_back({high_turn, here});
        }
        before = here;
      }
      if (intervals.empty()) intervals.push_back({0.0, before});
      const bool is_closed = intervals.size() == 1;
      std::vector<int> corners;
      for (const Interval& interval : intervals) {
        if (is_closed) break;
        const Vec3 d = direction(bone, end, interval.begin);
        auto& known = corner_at[{node, 0}];
        int found = -1;
        for (const auto& [other, index] : known)
          if ((other - d).norm() < 1e-6) found = index;
        if (found < 0) {
          found = static_cast<int>(model.corners.size());
          known.emplace_back(d, found);
          model.corners.push_back({node, {}, sample(bone, end, interval.begin)});
        }
        model.corners[found].bones.push_back(bone);
        corners.push_back(found);
      }
      for (std::size_t k = 0; k < intervals.size(); ++k) {
        const Interval& here = intervals[k];
        const double until = is_closed                  ? here.begin + 1
                             : k + 1 < intervals.size() ? intervals[k + 1].begin
                                                        : intervals[0].begin + 1;
        const std::tuple<int, int, int> key{node, std::min(bone, here.neighbour), std::max(bone, here.neighbour)};
        const auto found = arc_at.find(key);
        if (found == arc_at.end()) {
          SeamArc arc;
          arc.node = node;
          arc.bones = {bone, here.neighbour};
          if (!is_closed) arc.corners = {corners[k], corners[(k + 1) % corners.size()]};
          const int wider = std::max(sizes[bone].first, sizes[here.neighbour].first);
          const int cells = std::max(is_closed ? 3 : 2, static_cast<int>(std::lround((until - here.begin) * wider)));
          for (int i = is_closed ? 0 : 1; i < cells; ++i)
            arc.samples.push_back(sample(bone, end, here.begin + (until - here.begin) * i / cells));
          arc_at[key] = {static_cast<int>(model.arcs.size()), direction(bone, end, here.begin)};
          model.ends[bone][static_cast<int>(end)].arcs.push_back({static_cast<int>(model.arcs.size()), false});
          model.arcs.push_back(std::move(arc));
          continue;
        }
        const SeamArc& arc = model.arcs[found->second.index];
        bool is_reversed = false;
        if (is_closed) {
          // Angles of the first two samples about this bone: does it grow with the arc?
          const BoneEnd other_end =
              end_node(skeleton_, arc.bones[0], BoneEnd::kHead) == node ? BoneEnd::kHead : BoneEnd::kTail;
          const auto turn_here = [&](int i) {
            return separation_.turn_of(
                bone, separation_.seam_point(arc.bones[0], other_end, arc.samples[i].turn, arc.samples[i].distance) -
                          skeleton_.nodes[node].position);
          };
          const double step = turn_here(1) - turn_here(0);
          is_reversed = step - std::floor(step) > 0.5;
        } else {
          is_reversed = arc.corners[0] != corners[k];
        }
        model.ends[bone][static_cast<int>(end)].arcs.push_back({found->second.index, is_reversed});
      }
    }
  return model;
}

Skeleton lone_bone() {
  Skeleton skeleton;
  skeleton.nodes = {{"a", Vec3(-0.4, 0.1, 0.2)}, {"b", Vec3(0.5, 0.3, -0.1)}};
  skeleton.bones = {{"lone", 0, 1, {}}};
  return skeleton;
}

Skeleton chain(int bones) {
  Skeleton skeleton;
  Vec3 at(-0.5, 0, 0), step(0.8, 0.1, 0.05);
  for (int i = 0; i <= bones; ++i) {
    skeleton.nodes.push_back({"n" + std::to_string(i), at});
    at += step;
    step = Eigen::AngleAxisd(0.35, Vec3(0.2, 0.3 * (i + 1), 1).normalized()) * step;
  }
  for (int i = 0; i < bones; ++i) {
    // Every third bone runs backwards: nodes where two heads or two tails meet.
    if (i % 3 == 2)
      skeleton.bones.push_back({"b" + std::to_string(i), i + 1, i, {}});
    else
      skeleton.bones.push_back({"b" + std::to_string(i), i, i + 1, {}});
  }
  return skeleton;
}

Skeleton y_branch() { return star({Vec3(0, 0, -1), Vec3(0.7, 0.1, 0.7), Vec3(-0.6, 0.2, 0.8)}); }

Skeleton cross(int arms) {
  // A spiral on the sphere keeps any number of arms apart.
  std::vector<Vec3> directions;
  for (int i = 0; i < arms; ++i) {
    const double z = 1 - (2 * i + 1.0) / arms, angle = 2.4 * i + 0.1 * i * i;
    directions.push_back((1 + 0.1 * i) *
                         Vec3(std::sqrt(1 - z * z) * std::cos(angle), std::sqrt(1 - z * z) * std::sin(angle), z));
  }
  return star(directions);
}

Skeleton ring(int bones) {
  Skeleton skeleton;
  for (int i = 0; i < bones; ++i) {
    const double angle = 2 * kPi * i / bones;
    skeleton.nodes.push_back(
        {"n" + std::to_string(i), Vec3(1.5 * std::cos(angle), 1.2 * std::sin(angle), 0.1 * std::sin(2 * angle))});
    skeleton.bones.push_back({"b" + std::to_string(i), i, (i + 1) % bones, {}});
  }
  return skeleton;
}

Skeleton ring_with_arm(int bones) {
  Skeleton skeleton = ring(bones);
  skeleton.nodes.push_back({"arm", 1.8 * skeleton.nodes[0].position + Vec3(0, 0.1, 0.4)});
  skeleton.bones.push_back({"arm", bones, 0, {}});
  return skeleton;
}

Skeleton random_tree(int bones, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> length(0.5, 1.5);
  Skeleton skeleton;
  skeleton.nodes.push_back({"n0", Vec3::Zero()});
  std::vector<std::vector<Vec3>> away(1);  // directions of the bones at each node
  while (static_cast<int>(skeleton.bones.size()) < bones) {
    const int from = static_cast<int>(random() % skeleton.nodes.size());
    const Vec3 d = Vec3(normal(random), normal(random), normal(random)).normalized();
    if (std::any_of(away[from].begin(), away[from].end(), [&](const Vec3& other) { return other.dot(d) > 0.5; }))
      continue;
    const int to = static_cast<int>(skeleton.nodes.size());
    skeleton.nodes.push_back({"n" + std::to_string(to), skeleton.nodes[from].position + length(random) * d});
    away[from].push_back(d);
    away.push_back({-d});
    const std::string name = "b" + std::to_string(skeleton.bones.size());
    if (random() % 2)
      skeleton.bones.push_back({name, from, to, {}});
    else
      skeleton.bones.push_back({name, to, from, {}});
  }
  return skeleton;
}

std::vector<NamedSkeleton> all_skeletons() {
  return {{"lone bone", lone_bone(), 0.3},
          {"chain of two", chain(2), 0.2},
          {"chain of five", chain(5), 0.2},
          {"chain of nine", chain(9), 0.2},
          {"Y", y_branch(), 0.25},
          {"cross of 4", cross(4), 0.3},
          {"cross of 6", cross(6), 0.3},
          {"cross of 11", cross(11), 0.3},
          {"ring of 3", ring(3), 0.2},
          {"ring of 7", ring(7), 0.2},
          {"ring with an arm", ring_with_arm(6), 0.2},
          {"tree of 12", random_tree(12, 3), 0.15}};
}

std::vector<std::pair<int, int>> random_sizes(int count, int smallest, int largest, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<int> size(smallest, largest);
  std::vector<std::pair<int, int>> sizes;
  for (int i = 0; i < count; ++i) {
    const int width = size(random);
    sizes.emplace_back(width, size(random));
  }
  return sizes;
}

}  // namespace skeletex
