// SPDX-License-Identifier: MIT
#include "skeletex/skeletonize/repair_skeleton.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <utility>

#include "skeletex/analysis/findings.h"
#include "skeletex/geometry/union_find.h"
#include "skeletex/model/error.h"
#include "skeletex/skeleton/check_skeleton.h"
#include "skeletex/skeleton/free_name.h"
#include "skeletex/skeletonize/accept.h"
#include "skeletex/skeletonize/body/body_paths.h"
#include "skeletex/skeletonize/body/fitting_body.h"
#include "skeletex/skeletonize/bones.h"
#include "skeletex/skeletonize/replacement.h"
#include "skeletex/skeletonize/skeletonize.h"

namespace skeletex {
namespace {

/// A skeleton on its way, with what was done to it.
class Draft {
 public:
  Draft(const Surface& surface, const VoxelBody& body, const Skeleton& skeleton)
      : surface_(surface), body_(body), skeleton_(skeleton) {}

  void run() {
    drop_unusable_bones();
    join_parts();
    drop_unused_nodes();
    std::vector<double> lengths;
    for (std::size_t b = 0; b < skeleton_.bones.size(); ++b)
      lengths.push_back(bone_length(skeleton_, static_cast<int>(b)));
    shorten_free_ends();
    move_inside();
    cut_stray_limbs(lengths);
    bend_bones();
  }
  Skeleton& skeleton() { return skeleton_; }
  std::vector<std::string>& changes() { return changes_; }

 private:
  void say(std::string change) { changes_.push_back(std::move(change)); }
  std::string node_name(int n) const { return name_of_node(skeleton_, n); }

  /// Bones from a node to itself, and a second bone between the same nodes.
  void drop_unusable_bones() {
    std::set<std::pair<int, int>> seen;
    for (std::size_t b = 0; b < skeleton_.bones.size();) {
      const Bone& bone = skeleton_.bones[b];
      const std::pair<int, int> ends = std::minmax(bone.head, bone.tail);
      if (bone.head != bone.tail && seen.insert(ends).second) {
        ++b;
        continue;
      }
      say(fmt::format(
          "{} taken away: {}", name_of_bone(skeleton_, static_cast<int>(b)),
          bone.head == bone.tail ? "it begins and ends at the same node" : "another bone runs between its nodes"));
      skeleton_.bones.erase(skeleton_.bones.begin() + static_cast<std::ptrdiff_t>(b));
    }
  }

  /// Parts get a bone between their nearest nodes.
  void join_parts() {
    for (;;) {
      UnionFind parts(static_cast<int>(skeleton_.nodes.size()));
      std::set<int> used;
      for (const Bone& bone : skeleton_.bones) {
        parts.unite(bone.head, bone.tail);
        used.insert({bone.head, bone.tail});
      }
      double least = -1;
      std::pair<int, int> nearest{-1, -1};
      for (const int i : used)
        for (const int j : used) {
          if (parts.find(i) == parts.find(j)) continue;
          const double distance = (skeleton_.nodes[i].position - skeleton_.nodes[j].position).norm();
          if (least < 0 || distance < least) least = distance, nearest = {i, j};
        }
      if (least < 0) return;
      skeleton_.bones.push_back({free_name("joining_bone"), nearest.first, nearest.second, {}});
      say(fmt::format("bone \"{}\" added from {} to {}, which joins two parts", skeleton_.bones.back().name,
                      node_name(nearest.first), node_name(nearest.second)));
    }
  }

  void drop_unused_nodes() {
    std::vector<int> number(skeleton_.nodes.size(), -1);
    for (const Bone& bone : skeleton_.bones) number[bone.head] = number[bone.tail] = 0;
    std::vector<Node> kept;
    for (std::size_t n = 0; n < number.size(); ++n) {
      if (number[n] < 0) {
        say(fmt::format("{} taken away: no bone ends there", node_name(static_cast<int>(n))));
        continue;
      }
      number[n] = static_cast<int>(kept.size());
      kept.push_back(skeleton_.nodes[n]);
    }
    for (Bone& bone : skeleton_.bones) bone.head = number[bone.head], bone.tail = number[bone.tail];
    skeleton_.nodes = std::move(kept);
  }

  /// A bone whose free end is outside of the body ends before it leaves the body.
  void shorten_free_ends() {
    constexpr double kShare = 0.9;  // of the way to the surface
    const std::span corners(surface_.mesh.triangles.data()->data(), 3 * surface_.mesh.triangles.size());
    const auto at_nodes = bones_at_nodes(skeleton_);
    for (std::size_t n = 0; n < at_nodes.size(); ++n) {
      if (at_nodes[n].size() != 1) continue;
      Vec3& end = skeleton_.nodes[n].position;
      const Vec3 start =
          skeleton_.nodes[end_node(skeleton_, at_nodes[n][0].bone, opposite(at_nodes[n][0].end))].position;
      const double exit = find_first_hit(surface_.mesh, surface_.tree, start, end - start, 1);
      const auto is_outside = [&](const Vec3& p) { return winding_number(surface_.mesh.positions, corners, p) <= 0; };
      if (exit <= 1 && is_outside(end) && !is_outside(start)) end = start + kShare * exit * (end - start);
    }
  }

  int nearest_voxel(const Vec3& point) const {
    int nearest = 0;
    for (int v = 1; v < body_.size(); ++v)
      if ((body_.centres[v] - point).squaredNorm() < (body_.centres[nearest] - point).squaredNorm()) nearest = v;
    return nearest;
  }

  /// From a voxel to the middle of the body there: up the distance from the surface, but not far.
  int towards_middle(int voxel, double farthest) const {
    const Vec3 start = body_.centres[voxel];
    for (;;) {
      int best = voxel;
      for (const int next : body_.neighbours[voxel])
        if (next >= 0 && body_.radii[next] > body_.radii[best] && (body_.centres[next] - start).norm() <= farthest)
          best = next;
      if (best == voxel) return voxel;
      voxel = best;
    }
  }

  /// Whether a node is inside and not next to the surface.
  bool is_inside(const Vec3& point, int nearest) const {
    constexpr double kNext = 0.05;  // of the radius in the middle there
    const std::span corners(surface_.mesh.triangles.data()->data(), 3 * surface_.mesh.triangles.size());
    return winding_number(surface_.mesh.positions, corners, point) > 0 &&
           surface_.radius(point) > kNext * body_.radii[towards_middle(nearest, 2 * body_.side)];
  }

  void move_inside() {
    std::vector<int> voxels;
    int outside = 0;
    for (const Node& node : skeleton_.nodes) {
      voxels.push_back(nearest_voxel(node.position));
      outside += (body_.centres[voxels.back()] - node.position).norm() > 0.25 * surface_.diagonal;
    }
    if (outside == static_cast<int>(voxels.size()))
      throw InputError(
          "no node of the skeleton is near the mesh; check that mesh and skeleton share units, axes and origin");
    std::set<int> taken;
    for (std::size_t n = 0; n < voxels.size(); ++n) {
      Vec3& p = skeleton_.nodes[n].position;
      if (is_inside(p, voxels[n])) continue;
      int place = towards_middle(voxels[n], 0.1 * surface_.diagonal);
      if (taken.contains(place)) place = voxels[n];  // another node is in the middle there
      taken.insert(place);
      p = body_.centres[place];
    }
    // Two nodes in one place would make a bone of no length.
    for (std::size_t n = 0; n < voxels.size(); ++n)
      for (std::size_t m = 0; m < n; ++m)
        if ((skeleton_.nodes[n].position - skeleton_.nodes[m].position).norm() < 1e-3 * body_.side) {
          const auto& around = body_.neighbours[nearest_voxel(skeleton_.nodes[n].position)];
          for (const int next : around)
            if (next >= 0 && !taken.contains(next)) {
              taken.insert(next);
              skeleton_.nodes[n].position = body_.centres[next];
              break;
            }
        }
  }

  /// Neither a node nor a bone has it.
  std::string free_name(const std::string& wanted) const {
    std::set<std::string> taken;
    for (const Node& node : skeleton_.nodes) taken.insert(node.name);
    for (const Bone& bone : skeleton_.bones) taken.insert(bone.name);
    return skeletex::free_name(wanted, taken);
  }

  static double length_of(const std::vector<Vec3>& points) {
    double length = 0;
    for (std::size_t i = 1; i < points.size(); ++i) length += (points[i] - points[i - 1]).norm();
    return length;
  }

  /// From the middle of the body at a point to that at another one, with both points.
  std::vector<Vec3> way_through_body(const Vec3& head, const Vec3& tail, const std::vector<double>& costs) const {
    std::vector<Vec3> points{head};
    // A node that was moved lies in the middle of a voxel, which would make a bone without length.
    for (const int v : path_between(body_, costs, nearest_voxel(head), nearest_voxel(tail)))
      if (const Vec3& p = body_.centres[v]; std::min((p - head).norm(), (p - tail).norm()) > 1e-3 * body_.side)
        points.push_back(p);
    points.push_back(tail);
    return points;
  }

  /// A limb ends where its next bone would be far longer inside the body: its end lies in another part near by.
  void cut_stray_limbs(const std::vector<double>& lengths) {
    constexpr double kStray = 3;  // times the bone's length
    const std::vector<double> costs = middle_costs(body_);
    std::vector<int> gone;
    for (const SkeletonLimb& limb : find_limbs(skeleton_)) {
      const auto strays = [&](int b) {
        const Vec3 &head = end_position(skeleton_, b, BoneEnd::kHead),
                   &tail = end_position(skeleton_, b, BoneEnd::kTail);
        return surface_.is_between(head, tail) &&
               length_of(way_through_body(head, tail, costs)) > kStray * std::max(lengths[b], body_.side);
      };
      gone.insert(gone.end(), std::find_if(limb.bones.begin(), limb.bones.end(), strays), limb.bones.end());
    }
    std::sort(gone.rbegin(), gone.rend());
    for (const int b : gone) skeleton_.bones.erase(skeleton_.bones.begin() + b);
    drop_unused_nodes();
  }

  /// Bones that leave the body follow it instead.
  void bend_bones() {
    const std::vector<double> costs = middle_costs(body_);
    const std::size_t count = skeleton_.bones.size();
    for (std::size_t b = 0; b < count; ++b) {
      const Bone bone = skeleton_.bones[b];
      const Vec3 head = skeleton_.nodes[bone.head].position, tail = skeleton_.nodes[bone.tail].position;
      if (!surface_.is_between(head, tail)) continue;
      const std::vector<Vec3> points = way_through_body(head, tail, costs);
      const std::vector<int> kept = straighten(surface_, body_.side, points, 2);
      if (kept.size() < 3) continue;
      int before = bone.head;
      for (std::size_t i = 1; i + 1 < kept.size(); ++i) {
        skeleton_.nodes.push_back({free_name(bone.name + "_bend"), points[kept[i]]});
        const int bend = static_cast<int>(skeleton_.nodes.size()) - 1;
        if (i == 1) {
          skeleton_.bones[b].tail = bend;
          skeleton_.bones[b].s.reset();
        } else {
          skeleton_.bones.push_back({free_name(bone.name + "_part"), before, bend, {}});
        }
        before = bend;
      }
      skeleton_.bones.push_back({free_name(bone.name + "_part"), before, bone.tail, {}});
      say(fmt::format("bone \"{}\" left the body and got {} node{} on the way through it", bone.name, kept.size() - 2,
                      kept.size() == 3 ? "" : "s"));
    }
  }

  const Surface& surface_;
  const VoxelBody& body_;
  Skeleton skeleton_;
  std::vector<std::string> changes_;
};

/// Names for what has none, as messages and files need them.
void complete_names(Skeleton& skeleton) {
  for (std::size_t n = 0; n < skeleton.nodes.size(); ++n)
    if (skeleton.nodes[n].name.empty()) skeleton.nodes[n].name = fmt::format("node_{}", n);
  for (std::size_t b = 0; b < skeleton.bones.size(); ++b)
    if (skeleton.bones[b].name.empty()) skeleton.bones[b].name = fmt::format("bone_{}", b);
}

void drop_bad_angles(Skeleton& skeleton) {
  for (std::size_t b = 0; b < skeleton.bones.size(); ++b) {
    if (!skeleton.bones[b].s) continue;
    const Vec3 s = *skeleton.bones[b].s, o = direction_from(skeleton, {static_cast<int>(b), BoneEnd::kHead});
    if (!s.allFinite() || !((s - o.dot(s) * o).norm() > 1e-3 * s.norm())) skeleton.bones[b].s.reset();
  }
}

/// What became of the nodes and bones that the user knows.
void describe(const Skeleton& before, const Skeleton& after, std::vector<std::string>& changes) {
  std::map<std::string, Vec3> places;
  std::set<std::string> bones;
  for (const Node& node : after.nodes) places[node.name] = node.position;
  for (const Bone& bone : after.bones) bones.insert(bone.name);
  for (const Node& node : before.nodes) {
    const auto now = places.find(node.name);
    if (now == places.end()) {
      changes.push_back(fmt::format("node \"{}\" taken away", node.name));
      continue;
    }
    const double distance = (now->second - node.position).norm(), scale = after.frame.scale;
    if (distance > 1e-9)
      changes.push_back(fmt::format("node \"{}\" moved by {} to {}", node.name,
                                    text_of_distance(distance * scale, scale), text_of(after, now->second)));
  }
  for (const Bone& bone : before.bones)
    if (!bones.contains(bone.name)) changes.push_back(fmt::format("bone \"{}\" taken away", bone.name));
}

/// A mesh that is to accept a skeleton.
struct Target {
  ClContext& context;
  const TriangleMesh& mesh;
  const TriangleTree& tree;
  const Surface& surface;
  const Acceptance& acceptance;
};

/// The skeleton that skeletonize makes for the mesh, with the nodes of the wanted one.
/// \param original  where the nodes were before they were moved into the body
/// \return nothing where it makes none
std::optional<Repair> replacement(const Target& target, const Skeleton& wanted, const Skeleton& original) {
  try {
    const SkeletonizeResult found = skeletonize(target.context, target.mesh, target.tree);
    return with_nodes_of(target.surface, in_frame(found.skeleton, target.surface.frame), wanted, original);
  } catch (const TopologyError&) {
    return std::nullopt;
  }
}

/// Skeletons that are accepted, and the choice among them.
class Candidates {
 public:
  Candidates(const Target& target, const Skeleton& wanted) : target_(target), wanted_(wanted) {}

  /// Adds a skeleton if it can be made acceptable.
  void add(Repair repair, bool is_replacement = false) {
    refusal_ = target_.acceptance.segment(repair);
    if (!refusal_.empty()) return;
    Skeleton skeleton = repair.skeleton();
    repair.move_back();
    if (target_.acceptance.is_accepted(repair.skeleton())) skeleton = repair.skeleton();
    const double followed = followed_share(target_.surface, wanted_, skeleton);
    most_followed_ = std::max(most_followed_, followed);
    list_.push_back({std::move(skeleton), followed, is_replacement});
  }
  /// Whether the last one has all bones.
  bool is_complete() const { return !list_.empty() && list_.back().skeleton.bones.size() == wanted_.bones.size(); }
  bool loses_limbs() const { return most_followed_ < kFollowedEnough; }

  /// The one of the most bones among those that follow the wanted one best.
  /// \throw TopologyError when there is none
  Skeleton best(std::vector<std::string>& changes) {
    if (list_.empty()) throw TopologyError(refusal_);
    std::erase_if(list_, [&](const Candidate& c) { return c.followed < most_followed_ - kAsMuch; });
    Candidate& chosen = *std::max_element(list_.begin(), list_.end(), [](const Candidate& a, const Candidate& b) {
      return a.skeleton.bones.size() < b.skeleton.bones.size();
    });
    if (chosen.is_replacement) {
      changes.emplace_back(
          "limbs would be lost, so the skeleton that skeletonize makes for the mesh takes its place and its names");
      take_bone_names(wanted_, chosen.skeleton);
    }
    return std::move(chosen.skeleton);
  }

 private:
  static constexpr double kFollowedEnough = 0.95, kAsMuch = 0.05;  // shares of the wanted skeleton
  struct Candidate {
    Skeleton skeleton;
    double followed = 0;  ///< share of the wanted skeleton
    bool is_replacement = false;
  };
  const Target& target_;
  const Skeleton& wanted_;
  std::vector<Candidate> list_;
  double most_followed_ = 0;
  std::string refusal_;
};

/// Moves nodes; where that is not enough, contracts bones one after the other, with or without minor limbs, or with a
/// look at all of them. Where all these lose limbs, tries the skeleton that skeletonize makes.
/// \param original  where the nodes were before they were moved into the body
/// \throw TopologyError when nothing helps
Skeleton accepted_skeleton(const Target& target, const Skeleton& wanted, const Skeleton& original,
                           std::vector<std::string>& changes) {
  Candidates candidates(target, wanted);
  const Repair start(target.surface, wanted, original);
  Repair moved = start;
  if (moved.run(false)) candidates.add(std::move(moved));
  if (candidates.is_complete()) return candidates.best(changes);
  candidates.add(start);
  for (const bool is_relaxed : {false, true}) {
    Repair repair = start;
    repair.drop_minor_limbs();
    if (is_relaxed) repair.relax();
    candidates.add(std::move(repair));
  }
  if (candidates.loses_limbs())
    if (std::optional<Repair> repair = replacement(target, wanted, original)) candidates.add(std::move(*repair), true);
  return candidates.best(changes);
}

}  // namespace

RepairResult repair_skeleton(ClContext& context, const TriangleMesh& mesh, const TriangleTree& tree,
                             const Skeleton& skeleton) {
  const UnitMesh unit(mesh, tree);
  Surface surface(unit.mesh, unit.tree);
  surface.frame = unit.frame;
  std::vector<Finding> findings;
  if (!find_in_skeleton(skeleton, unit.frame.scale, findings)) {
    const auto error =
        std::find_if(findings.begin(), findings.end(), [](const Finding& f) { return f.severity == Severity::kError; });
    throw InputError(fmt::format("{}; {}", error->message, error->remedy));
  }
  Skeleton named = in_frame(skeleton, unit.frame);
  complete_names(named);
  const int genus = genus_of(mesh);
  const VoxelBody body = make_fitting_body(surface, genus);
  if (body.size() == 0)
    throw TopologyError("the body is too thin to find its middle; give the mesh some thickness, or repair by hand");
  Draft draft(surface, body, named);
  draft.run();
  if (const int cycles = count_cycles(draft.skeleton()); cycles != genus)
    throw TopologyError(
        fmt::format("the mesh has {} handle{} and the skeleton {} ring{} of bones, which no move mends; lay one ring "
                    "through every handle, or start from skeletex skeletonize",
                    genus, genus == 1 ? "" : "s", cycles, cycles == 1 ? "" : "s"));
  RepairResult result{draft.skeleton(), std::move(draft.changes())};
  const Acceptance acceptance(context, surface);
  if (!acceptance.is_accepted(result.skeleton))
    result.skeleton =
        accepted_skeleton({context, mesh, tree, surface, acceptance}, draft.skeleton(), named, result.changes);
  drop_bad_angles(result.skeleton);
  describe(named, result.skeleton, result.changes);
  result.skeleton = in_frame(std::move(result.skeleton), skeleton.frame);
  for (Node& node : result.skeleton.nodes)  // what did not move stays as it was, to the last bit
    for (const Node& before : skeleton.nodes)
      if (before.name == node.name && (before.position - node.position).norm() < 1e-9 * unit.frame.scale)
        node.position = before.position;
  return result;
}

}  // namespace skeletex
