// SPDX-License-Identifier: MIT
#include "skeletex/rig/rig_animation.h"

#include <fmt/format.h>

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

namespace skeletex {
namespace {

using Eigen::Affine3d;
using Eigen::Quaterniond;

constexpr double kFramesPerSecond = 30;
/// How far nodes may lie from where turned bones take them; diagonals.
constexpr double kRotationsSuffice = 1e-3;
constexpr std::size_t kMostFrames = 100'000;

/// Value of a track at a time.
Eigen::Vector4d value_at(const GltfTrack& track, double time) {
  const auto value = [&](std::size_t key) {
    return track.values[track.interpolation == GltfInterpolation::kCubic ? 3 * key + 1 : key];
  };
  const auto after = std::upper_bound(track.times.begin(), track.times.end(), time);
  if (after == track.times.begin()) return value(0);
  const std::size_t a = static_cast<std::size_t>(after - track.times.begin()) - 1;
  if (a + 1 == track.times.size() || track.interpolation == GltfInterpolation::kStep) return value(a);
  const double gap = track.times[a + 1] - track.times[a], t = (time - track.times[a]) / gap;
  if (track.interpolation == GltfInterpolation::kCubic) {
    const double t2 = t * t, t3 = t2 * t;
    const Eigen::Vector4d out = gap * track.values[3 * a + 2], in = gap * track.values[3 * (a + 1)];
    return (2 * t3 - 3 * t2 + 1) * value(a) + (t3 - 2 * t2 + t) * out + (3 * t2 - 2 * t3) * value(a + 1) +
           (t3 - t2) * in;
  }
  if (track.path == GltfPath::kRotation)
    return Quaterniond(value(a)).normalized().slerp(t, Quaterniond(value(a + 1)).normalized()).coeffs();
  return (1 - t) * value(a) + t * value(a + 1);
}

/// What a pose of the rig says about the skeleton.
struct Moment {
  double time = 0;
  std::vector<Vec3> nodes;             ///< of the skeleton
  std::vector<Quaterniond> rotations;  ///< per bone, from the bind pose, in world axes
};

class AnimationReader {
 public:
  AnimationReader(const GltfScene& scene, const GltfSurface& surface, const JointSkeleton& joints,
                  const GltfAnimation& animation)
      : scene_(scene),
        surface_(surface),
        joints_(joints),
        animation_(animation),
        diagonal_(bounding_box(surface.mesh).diagonal()) {
    is_moving_.assign(scene.nodes.size(), false);
    for (const GltfTrack& track : animation.tracks) is_moving_[track.node] = true;
    const std::vector<int> roots = root_nodes(joints.skeleton);
    root_ = roots.front();
    before_.assign(joints.skeleton.nodes.size(), -1);
    for (BoneIndex bone = 0; bone < static_cast<int>(joints.skeleton.bones.size()); ++bone)
      before_[joints.skeleton.bones[bone].tail] = bone;
  }

  RigAnimation read() {
    RigAnimation result;
    if (!moves_skeleton()) return result;
    std::vector<double> times = key_times(false);
    PoseAnimation turned = poses(times, [&](const Moment& moment) { return rotations_pose(moment); });
    const double deviation = largest_deviation(times, turned) / diagonal_;
    if (deviation <= kRotationsSuffice) {
      result.animation = std::move(turned);
    } else {
      times = key_times(true);
      result.animation = poses(times, [&](const Moment& moment) { return nodes_pose(moment); });
      result.notes.push_back(fmt::format(
          "animation \"{}\" moves joints away from each other, by up to {:.2g} % of the diagonal: its poses "
          "place nodes",
          animation_.name, 100 * deviation));
    }
    if (largest_scale_ > 1.01)
      result.notes.push_back(fmt::format("animation \"{}\" scales joints by up to {:.2f}, which poses do not hold",
                                         animation_.name, largest_scale_));
    return result;
  }

 private:
  bool moves_skeleton() const {
    for (const int joint : joints_.bone_joint)
      for (int node = joint; node >= 0; node = scene_.nodes[node].parent)
        if (is_moving_[node]) return true;
    return false;
  }

  /// Times of all keys, and with `is_dense` as many more as it takes for 30 per second. Curves are dense always.
  std::vector<double> key_times(bool is_dense) const {
    std::vector<double> times;
    for (const GltfTrack& track : animation_.tracks) {
      times.insert(times.end(), track.times.begin(), track.times.end());
      is_dense = is_dense || track.interpolation != GltfInterpolation::kLinear;
    }
    const auto [first, last] = std::minmax_element(times.begin(), times.end());
    const double begin = *first, length = *last - begin;
    const double steps = std::ceil(length * kFramesPerSecond);
    for (int i = 1; is_dense && i < steps && i < static_cast<int>(kMostFrames); ++i)
      times.push_back(begin + i * length / steps);
    std::sort(times.begin(), times.end());
    // Keys that rounding set apart are one.
    times.erase(std::unique(times.begin(), times.end(), [](double a, double b) { return b - a < 1e-4; }), times.end());
    if (times.size() > kMostFrames) times.resize(kMostFrames);
    return times;
  }

  Moment moment_at(double time) {
    std::vector<GltfNode> nodes = scene_.nodes;
    for (const GltfTrack& track : animation_.tracks) {
      const Eigen::Vector4d value = value_at(track, time);
      GltfNode& node = nodes[track.node];
      if (node.matrix) continue;  // the format animates none of those
      if (track.path == GltfPath::kTranslation) node.translation = value.head<3>();
      if (track.path == GltfPath::kScale) node.scale = value.head<3>();
      if (track.path == GltfPath::kRotation && value.norm() > 0) node.rotation = Quaterniond(value.normalized());
    }
    const std::vector<Affine3d> shown = node_transforms(nodes);
    Moment moment;
    moment.time = time;
    for (std::size_t i = 0; i < joints_.node_joint.size(); ++i) {
      const int joint = joints_.node_joint[i];
      moment.nodes.push_back(shown[joint] * surface_.rest[joint].inverse() * joints_.skeleton.nodes[i].position);
    }
    for (const int joint : joints_.bone_joint) {
      const Eigen::Matrix3d linear = (shown[joint] * surface_.rest[joint].inverse()).linear();
      const Eigen::JacobiSVD<Eigen::Matrix3d> svd(linear, Eigen::ComputeFullU | Eigen::ComputeFullV);
      Eigen::Matrix3d u = svd.matrixU();
      if ((u * svd.matrixV().transpose()).determinant() < 0) u.col(2) = -u.col(2);
      moment.rotations.push_back(Quaterniond(u * svd.matrixV().transpose()).normalized());
      const Vec3& scales = svd.singularValues();
      largest_scale_ = std::max({largest_scale_, scales[0], 1 / std::max(scales[2], 1e-9)});
    }
    return moment;
  }

  template <class MakePose>
  PoseAnimation poses(const std::vector<double>& times, const MakePose& make_pose) {
    PoseAnimation result;
    for (const double time : times) result.frames.push_back({time - times.front(), make_pose(moment_at(time))});
    return result;
  }

  Pose rotations_pose(const Moment& moment) const {
    Pose pose;
    for (std::size_t bone = 0; bone < joints_.skeleton.bones.size(); ++bone) {
      const int before = before_[joints_.skeleton.bones[bone].head];
      Quaterniond rotation = moment.rotations[bone];
      if (before >= 0) rotation = moment.rotations[before].conjugate() * rotation;
      if (rotation.w() < 0) rotation.coeffs() = -rotation.coeffs();
      // What rounding turns is as it was.
      if (rotation.vec().norm() < 1e-6) rotation = Quaterniond::Identity();
      pose.rotations.push_back(rotation);
    }
    const Vec3 way = moment.nodes[root_] - joints_.skeleton.nodes[root_].position;
    if (way.norm() > 1e-6 * diagonal_) pose.translation = way;
    return pose;
  }

  Pose nodes_pose(const Moment& moment) const {
    const Skeleton& bind = joints_.skeleton;
    Pose pose;
    pose.nodes = moment.nodes;
    const std::vector<BoneBasis> bound = bone_bases(bind);
    const Skeleton fitted = apply_pose(bind, pose);
    for (BoneIndex bone = 0; bone < static_cast<int>(bind.bones.size()); ++bone) {
      const Vec3 along = direction_from(fitted, {bone, BoneEnd::kHead});
      const auto across = [&](const Vec3& s) { return Vec3(s - s.dot(along) * along).normalized(); };
      const Vec3 has = across(*fitted.bones[bone].s), wanted = across(moment.rotations[bone] * bound[bone].s);
      pose.rolls.push_back(std::atan2(has.cross(wanted).dot(along), has.dot(wanted)));
    }
    return pose;
  }

  double largest_deviation(const std::vector<double>& times, const PoseAnimation& animation) {
    double largest = 0;
    for (std::size_t i = 0; i < times.size(); ++i) {
      const Skeleton posed = apply_pose(joints_.skeleton, animation.frames[i].pose);
      const Moment moment = moment_at(times[i]);
      for (std::size_t node = 0; node < posed.nodes.size(); ++node)
        largest = std::max(largest, (posed.nodes[node].position - moment.nodes[node]).norm());
    }
    return largest;
  }

  const GltfScene& scene_;
  const GltfSurface& surface_;
  const JointSkeleton& joints_;
  const GltfAnimation& animation_;
  double diagonal_;
  std::vector<bool> is_moving_;  ///< per node of the scene
  std::vector<int> before_;      ///< per node of the skeleton the bone that leads there
  int root_ = 0;
  double largest_scale_ = 1;
};

}  // namespace

RigAnimation read_rig_animation(const GltfScene& scene, const GltfSurface& surface, const JointSkeleton& joints,
                                const GltfAnimation& animation) {
  return AnimationReader(scene, surface, joints, animation).read();
}

}  // namespace skeletex
