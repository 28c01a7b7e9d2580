// SPDX-License-Identifier: MIT
#include "skeletex/skeleton/weight_walk.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "skin_weight.h"

namespace skeletex {
namespace {

constexpr int kMostJoints = 6;            // their weights are far below the cut beyond
constexpr std::size_t kMostSteps = 1024;  // of one bone; in graphs with many cycles ways get many

/// The size of the seams around each node: the median distance to their bones, and the largest to the node. World
/// units.
struct JointSizes {
  std::vector<double> girths, radii;
};

JointSizes joint_sizes(const SkeletexModel& model, const SeparationPlanes& separation) {
  const Skeleton& skeleton = model.skeleton;
  std::vector<std::vector<double>> distances(skeleton.nodes.size());
  JointSizes sizes;
  sizes.radii.assign(skeleton.nodes.size(), 0);
  const auto add = [&](int node, int bone, const SeamSample& sample) {
    const Vec3 point = separation.seam_point(bone, end_at(skeleton, bone, node), sample.turn, sample.distance);
    distances[node].push_back(sample.distance);
    sizes.radii[node] = std::max(sizes.radii[node], (point - skeleton.nodes[node].position).norm());
  };
  for (const SeamArc& arc : model.arcs)
    for (const SeamSample& sample : arc.samples) add(arc.node, arc.bones[0], sample);
  for (const SeamCorner& corner : model.corners) add(corner.node, corner.bones[0], corner.sample);
  for (std::vector<double>& list : distances) {
    double girth = model.diagonal;  // of ends without a seam, which no walk crosses
    if (!list.empty()) {
      const auto middle = list.begin() + static_cast<std::ptrdiff_t>(list.size() / 2);
      std::nth_element(list.begin(), middle, list.end());
      girth = std::max(*middle, 1e-6 * model.diagonal);
    }
    sizes.girths.push_back(girth);
  }
  return sizes;
}

/// Where a walk has come to: a bone, and the joint that it was entered through.
struct Place {
  int bone = -1, joint = -1;
  int before = -1;  ///< number of the place before it
  int joints = 0;   ///< how many the walk has crossed
};

bool has_crossed(const std::vector<Place>& places, int at, int joint) {
  for (; at >= 0; at = places[at].before)
    if (places[at].joint == joint) return true;
  return false;
}

WeightStep make_step(const SkeletexModel& model, const JointSizes& sizes, int node, BoneAtNode from, BoneAtNode to) {
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
      const int node = end == BoneEnd::kHead ? bone.head : bone.tail;
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

std::vector<BoneWeight> bone_weights(const WeightWalks& walks, int bone, const Vec3& point) {
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
    weights.push_back({k == 0 ? bone : walks.steps[first + k - 1].bone, weight});
    sum += weight;
  }
  for (BoneWeight& weight : weights) weight.weight /= sum;
  return weights;
}

}  // namespace skeletex
