// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "skeletex/analysis/findings.h"

namespace skeletex {
namespace {

/// Nodes that bones use, and where they lie.
struct UsedNodes {
  std::vector<int> numbers;
  std::vector<Vec3> points;
};

UsedNodes used_nodes_of(const Skeleton& skeleton) {
  std::vector<bool> is_used(skeleton.nodes.size(), false);
  for (const Bone& bone : skeleton.bones) is_used[bone.head] = is_used[bone.tail] = true;
  UsedNodes used;
  for (int n = 0; n < static_cast<int>(skeleton.nodes.size()); ++n)
    if (is_used[n]) used.numbers.push_back(n), used.points.push_back(skeleton.nodes[n].position);
  return used;
}

/// A node that is not inside.
/// \param doubt  what the message says of a surface that is not closed
Finding finding_of_node(const SurfaceProbe& surface, const std::string& name, const Vec3& position,
                        const NearestPoint& nearest, bool is_on_surface, const char* doubt) {
  const double diagonal = surface.diagonal();
  const Vec3 inward = is_on_surface ? Vec3(-nearest.normal) : Vec3((nearest.point - position).normalized());
  const Vec3 target = surface.middle_of_body(nearest.point, inward);
  const std::string where = fmt::format("{} at {} lies", name, text_of(position));
  if (is_on_surface)
    return {Severity::kError, "node-inside", fmt::format("{} on the surface{}", where, doubt),
            fmt::format("move it into the body, for example to {}, by {}", text_of(target),
                        text_of_distance((target - position).norm(), diagonal))};
  return {Severity::kError, "node-inside",
          fmt::format("{} outside the mesh, {} from its surface{}", where, text_of_distance(nearest.distance, diagonal),
                      doubt),
          fmt::format("move it by more than {:.4g} towards {}, for example on to {}, the middle of the body there",
                      nearest.distance, text_of(nearest.point), text_of(target))};
}

/// A skeleton that lies elsewhere altogether.
Finding finding_of_frame(const SurfaceProbe& surface, const std::vector<Vec3>& points) {
  const BoundingBox box = bounding_box(points);
  return {
      Severity::kError, "frame",
      fmt::format("no node of the skeleton lies in the mesh: its nodes fill the box {} to {} (diagonal {:.4g}), the "
                  "mesh has a diagonal of {:.4g}, "
                  "and its surface comes nearest to that box's centre at {}",
                  text_of(box.lower), text_of(box.upper), box.diagonal(), surface.diagonal(),
                  text_of(surface.nearest(box.centre()).point)),
      "check that mesh and skeleton share units, axes and origin"};
}

/// \return per node whether it lies outside or on the surface; nothing where the whole skeleton lies elsewhere, which
/// is told once
std::optional<std::vector<bool>> find_outside_nodes(const SurfaceProbe& surface, bool is_closed,
                                                    const Skeleton& skeleton, std::vector<Finding>& findings) {
  const auto [nodes, points] = used_nodes_of(skeleton);
  const std::vector<double> windings = surface.winding_numbers(points, is_closed);
  const char* doubt = is_closed ? "" : " (as far as a surface that is not closed has an inside)";
  std::vector<bool> is_outside(skeleton.nodes.size(), false);
  std::size_t outside = 0;
  std::vector<Finding> node_findings;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const NearestPoint nearest = surface.nearest(points[i]);
    const bool is_on_surface = nearest.distance <= 1e-6 * surface.diagonal();
    if (windings[i] > 0.5 && !is_on_surface) continue;
    is_outside[nodes[i]] = true;
    outside += !is_on_surface;
    node_findings.push_back(
        finding_of_node(surface, name_of_node(skeleton, nodes[i]), points[i], nearest, is_on_surface, doubt));
    node_findings.back().node = nodes[i];
    node_findings.back().position = points[i];
  }
  if (outside == nodes.size() && nodes.size() > 1) {
    findings.push_back(finding_of_frame(surface, points));
    return std::nullopt;
  }
  findings.insert(findings.end(), node_findings.begin(), node_findings.end());
  return is_outside;
}

std::string list_of(const std::vector<Crossing>& crossings) {
  constexpr std::size_t kMost = 8;
  std::string list;
  for (std::size_t c = 0; c < crossings.size() && c < kMost; ++c)
    list += fmt::format("{}{} at {} ({:.0f} % of the way)", c ? ", " : "", crossings[c].is_leaving ? "out" : "in",
                        text_of(crossings[c].point), 100 * crossings[c].share);
  if (crossings.size() > kMost) list += fmt::format(" and {} more", crossings.size() - kMost);
  return list;
}

/// The point of a bone outside the body that is furthest from it, among eight steps of every stretch outside.
struct Stray {
  Vec3 point = Vec3::Zero();
  NearestPoint nearest;
  double distance = -1;  ///< below 0: no stretch is outside
};

Stray furthest_stray(const SurfaceProbe& surface, const std::vector<Crossing>& crossings) {
  constexpr int kSteps = 8;
  Stray stray;
  for (std::size_t c = 0; c + 1 < crossings.size(); ++c) {
    if (!crossings[c].is_leaving || crossings[c + 1].is_leaving) continue;
    for (int step = 1; step < kSteps; ++step) {
      const Vec3 point =
          crossings[c].point + static_cast<double>(step) / kSteps * (crossings[c + 1].point - crossings[c].point);
      const NearestPoint nearest = surface.nearest(point);
      if (nearest.distance > stray.distance) stray = {point, nearest, nearest.distance};
    }
  }
  return stray;
}

std::string remedy_of(const SurfaceProbe& surface, const Skeleton& skeleton, const Bone& bone,
                      const std::vector<Crossing>& crossings, const std::vector<bool>& is_outside) {
  const Stray stray = furthest_stray(surface, crossings);
  if (stray.distance > 0)
    return fmt::format(
        "at {} shift it by more than {} towards {}: bend it with a node, for example at {}, the middle of the body "
        "there, or move its ends",
        text_of(stray.point), text_of_distance(stray.distance, surface.diagonal()), text_of(stray.nearest.point),
        text_of(surface.middle_of_body(stray.nearest.point, (stray.nearest.point - stray.point).normalized())));
  std::string ends;
  for (const NodeIndex node : {bone.head, bone.tail})
    if (is_outside[node]) ends += (ends.empty() ? "" : " and ") + name_of_node(skeleton, node);
  return ends.empty() ? "move its ends into the body, or bend it with a node in between"
                      : fmt::format("move {} into the body", ends);
}

}  // namespace

void find_between(const SurfaceProbe& surface, bool is_closed, const Skeleton& skeleton,
                  std::vector<Finding>& findings) {
  const std::optional<std::vector<bool>> is_outside = find_outside_nodes(surface, is_closed, skeleton, findings);
  if (!is_outside) return;
  for (int b = 0; b < static_cast<int>(skeleton.bones.size()); ++b) {
    const Bone& bone = skeleton.bones[b];
    const Vec3 &head = skeleton.nodes[bone.head].position, &tail = skeleton.nodes[bone.tail].position;
    if (!((tail - head).norm() > kSamePlace * surface.diagonal())) continue;
    const std::vector<Crossing> crossings = surface.crossings(head, tail);
    if (crossings.empty()) continue;
    findings.push_back(
        {Severity::kError, "bone-crossing",
         fmt::format("{} from {} to {} goes through the surface: {}", name_of_bone(skeleton, b),
                     name_of_node(skeleton, bone.head), name_of_node(skeleton, bone.tail), list_of(crossings)),
         remedy_of(surface, skeleton, bone, crossings, *is_outside)});
    findings.back().bone = b;
    findings.back().position = crossings.front().point;
  }
}

}  // namespace skeletex
