// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include "skeletex/analysis/bone_margin.h"
#include "skeletex/analysis/findings.h"

namespace skeletex {
namespace {

/// What would part the planes: a longer bone, or bones that bend less at its ends.
std::string remedy_of(const Skeleton& skeleton, BoneIndex bone, const BoneMargin& margin) {
  const double length = bone_length(skeleton, bone), factor = (1 - margin.margin) / (1 - kEnoughMargin);
  return fmt::format(
      "make the bone {:.3g} times as long ({:.4g} instead of {:.4g}), straighten the bones at its ends, or move its "
      "nodes into a thinner place; skeletex validate --repair finds places",
      factor, factor * length, length);
}

}  // namespace

void find_crossing_planes(const Skeleton& skeleton, const TriangleMesh& mesh, const TriangleTree& tree,
                          std::vector<Finding>& findings) {
  const std::vector<BoneMargin> margins = bone_margins(mesh, tree, skeleton, 48);
  std::vector<int> order(margins.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return margins[a].margin < margins[b].margin; });
  for (const int b : order) {
    const BoneMargin& margin = margins[b];
    if (margin.margin >= 0) break;
    const Bone& bone = skeleton.bones[b];
    Finding finding{Severity::kError, "separation-planes",
                    fmt::format("{}: the separation planes at {} and {} cross inside the body, {:.0f} % of the way to "
                                "the surface at {}",
                                name_of_bone(skeleton, b), name_of_node(skeleton, bone.head),
                                name_of_node(skeleton, bone.tail), 100 / (1 - margin.margin), text_of(margin.point)),
                    remedy_of(skeleton, b, margin)};
    finding.bone = b;
    finding.node = margin.end == BoneEnd::kHead ? bone.head : bone.tail;
    finding.position = margin.point;
    findings.push_back(std::move(finding));
  }
}

}  // namespace skeletex
