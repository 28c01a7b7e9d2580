// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/pose/weight_walk.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "skin_weight.h"

namespace skeletex {
namespace {

constexpr int kMostJoints = 6;            // their weights are far below the cut beyond
constexpr std::size_t kMostSteps = 1024;  // of one bone; in graphs with many cycles ways get many

/// A straight piece of the seams around a node: the distances of its ends to their bones, the smaller one first, and
/// its length.
struct SeamPiece {
  double nearest = 0, furthest = 0, length = 0;
};

/// The distance that half of the length does not exceed. Between the ends of a piece it is taken to grow evenly.
double median_distance(const std::vector<SeamPiece>& pieces) {
  double low = std::numeric_limits<double>::infinity(), high = 0, half = 0;
  for (const SeamPiece& piece : pieces) {
    low = std::min(low, piece.nearest);
    high = std::max(high, piece.furthest);
    half += piece.length / 2;
  }
  for (int i = 0; i < 40; ++i) {
    const double middle = (low + high) / 2;
    double below = 0;
    for (const SeamPiece& piece : pieces) {
      const double range = std::max(piece.furthest - piece.nearest, 1e-12 * piece.furthest);
      below += piece.length * std::clamp((middle - piece.nearest) / range, 0.0, 1.0);
    }
    (below < half ? low : high) = middle;
  }
  return (low + high) / 2;
}

/// The size of the seams around each node: the median distance to their bones, and the largest to the node. World
/// units. The median is one of lengths, so that it hardly depends on where samples lie.
struct JointSizes {
  std::vector<double> girths, radii;
};

JointSizes joint_sizes(const SkeletexModel& model, const SeparationPlanes& separation) {
  const Skeleton& skeleton = model.skeleton;
  std::vector<std::vector<SeamPiece>> pieces(skeleton.nodes.size());
  JointSizes sizes;
  sizes.radii.assign(skeleton.nodes.size(), 0);
  for (const SeamArc& arc : model.arcs) {
    std::vector<std::pair<Vec3, double>> points;  // with their distances
    const auto add = [&](BoneIndex bone, const SeamSample& sample) {
      const BoneEnd end = end_at(skeleton, bone, arc.node);
      points.emplace_back(separation.seam_point(bone, end, sample.turn, sample.distance), sample.distance);
    };
    const auto add_corner = [&](int corner) { add(model.corners[corner].bones[0], model.corners[corner].sample); };
    if (!arc.is_closed()) add_corner(arc.corners[0]);
    for (const SeamSample& sample : arc.samples) add(arc.bones[0], sample);
    if (!arc.is_closed()) add_corner(arc.corners[1]);
    if (arc.is_closed() && !points.empty()) points.push_back(points.front());
    for (std::size_t i = 0; i < points.size(); ++i) {
      const auto& [point, distance] = points[i];
      sizes.radii[arc.node] = std::max(sizes.radii[arc.node], (point - skeleton.nodes[arc.node].position).norm());
      if (i == 0) continue;
      const auto& [before, distance_before] = points[i - 1];
      pieces[arc.node].push_back(
          {std::min(distance_before, distance), std::max(distance_before, distance), (point - before).norm()});
    }
  }
  for (const std::vector<SeamPiece>& list : pieces)  // no walk crosses ends without a seam
    sizes.girths.push_back(list.empty() ? model.diagonal : std::max(median_distance(list), 1e-6 * model.diagonal));
  return sizes;
}

/// Where a walk has come to: a bone, and the joint that it was entered through.
struct Place {
  BoneIndex bone;
  int joint = -1;
  int before = -1;  ///< number of the place before it
  int joints = 0;   ///< how many the walk has crossed
};

bool has_crossed(const std::vector<Place>& places, int at, int joint) {
  for (; at >= 0; at = places[at].before)
    if (places[at].joint == joint) return true;
  return false;
}

WeightStep make_step(const SkeletexModel& model, const JointSizes& sizes, NodeIndex node, BoneAtNode from,
                     BoneAtNode to) {
  WeightStep step{};
  const Vec3 normal = (direction_from(model.skeleton, from) - direction_from(model.skeleton, to)) / sizes.girths[node];
  const Vec3 joint = model.skeleton.nodes[node].position - model.origin;
  for (int i = 0; i < 3; ++i) {
    step.normal[i] = static_cast<float>(normal[i]);
    step.joint[i] = static_cast<float>(joint[i]);
  }
  step.girth_inverse = static_cast<float>(1 / sizes.girths[node]);
  step.seam_radius = static_cast<float>(sizes.radii[node]);
  step.bone = to.bone;
  return step;
}

/// The walk from one bone, breadth first. Step k leads to place k + 1; place 0 is the bone itself.
std::vector<WeightStep> walk_from(const SkeletexModel& model, const JointSizes& sizes,
                                  const std::vector<std::vector<BoneAtNode>>& at, int own) {
  std::vector<WeightStep> steps;
  std::vector<Place> places{{own, -1, -1, 0}};
  std::vector<int> first_step_to(model.skeleton.bones.size(), -1);
  for (int here = 0; here < static_cast<int>(places.size()); ++here) {
    const Place place = places[here];
    if (place.joints == kMostJoints) continue;
    const Bone& bone = model.skeleton.bones[place.bone];
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) {
      const NodeIndex node = end == BoneEnd::kHead ? bone.head : bone.tail;
      if (has_crossed(places, here, node)) continue;
      for (const BoneAtNode& next : at[node]) {
        if (next.bone == place.bone || next.bone == own || steps.size() == kMostSteps) continue;
        WeightStep step = make_step(model, sizes, node, {place.bone, end}, next);
        step.before = here - 1;
        step.same = first_step_to[next.bone];
        if (step.same < 0) first_step_to[next.bone] = static_cast<int>(steps.size());
        steps.push_back(step);
        places.push_back({next.bone, node, here, place.joints + 1});
      }
    }
  }
  return steps;
}

}  // namespace

WeightWalks make_weight_walks(const SkeletexModel& model, const SeparationPlanes& separation) {
  const JointSizes sizes = joint_sizes(model, separation);
  const auto at = bones_at_nodes(model.skeleton);
  WeightWalks walks;
  walks.first_steps.push_back(0);
  for (int own = 0; own < static_cast<int>(model.skeleton.bones.size()); ++own) {
    const std::vector<WeightStep> steps = walk_from(model, sizes, at, own);
    walks.steps.insert(walks.steps.end(), steps.begin(), steps.end());
    walks.first_steps.push_back(static_cast<int>(walks.steps.size()));
    walks.longest = std::max(walks.longest, static_cast<int>(steps.size()));
  }
  return walks;
}

std::vector<BoneWeight> bone_weights(const WeightWalks& walks, BoneIndex bone, const Vec3& point) {
  const int first = walks.first_steps[bone], count = walks.first_steps[bone + 1] - first;
  std::vector<double> potentials(count + 1, 0.0);
  for (int k = 0; k < count; ++k) {
    const WeightStep& step = walks.steps[first + k];
    const Vec3 from = point - Vec3(step.joint[0], step.joint[1], step.joint[2]);
    const double height = from.dot(Vec3(step.normal[0], step.normal[1], step.normal[2]));
    const double excess = std::max(0.0, from.norm() - step.seam_radius) * step.girth_inverse;
    potentials[k + 1] = potentials[step.before + 1] + SKIN_CROSSING(height, excess);
  }
  const double lowest = *std::min_element(potentials.begin(), potentials.end());
  for (int k = 0; k < count; ++k) {
    const int same = walks.steps[first + k].same;
    if (same < 0) continue;
    potentials[same + 1] = std::min(potentials[same + 1], potentials[k + 1]);
    potentials[k + 1] = std::numeric_limits<double>::infinity();
  }
  std::vector<BoneWeight> weights;
  double sum = 0;
  for (int k = 0; k <= count; ++k) {
    const double weight = std::exp(lowest - potentials[k]) - SKIN_CUT;
    if (!(weight > 0)) continue;
    weights.push_back({k == 0 ? bone : BoneIndex(walks.steps[first + k - 1].bone), weight});
    sum += weight;
  }
  for (BoneWeight& weight : weights) weight.weight /= sum;
  return weights;
}

}  // namespace skeletex
