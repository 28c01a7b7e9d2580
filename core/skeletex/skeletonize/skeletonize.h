// SPDX-License-Identifier: MIT
#pragma once
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "skeletex/device/context.h"
#include "skeletex/geometry/mesh.h"
#include "skeletex/geometry/triangle_tree.h"
#include "skeletex/skeleton/skeleton.h"

namespace skeletex {

enum class SkeletonPurpose {
  kPose,  ///< every limb keeps a bone, where that does not make the error more than three times as large
  kSize,  ///< only the error of the model counts, down to a single bone
};

struct SkeletonizeOptions {
  SkeletonPurpose purpose = SkeletonPurpose::kPose;
  std::optional<int> most_bones;  ///< as many bones as work, up to so many
  std::optional<double> detail;   ///< 0: the body and its longest limbs, 1: fingers and ears; without, tried
  /// Called with the share of work done; returning false cancels by throwing Error.
  std::function<bool(const std::string& stage, double done)> progress;
};

/// A skeleton that was tried.
struct SkeletonCandidate {
  std::string name;     ///< "detail 0.5", "single bone"
  int bones = 0;        ///< those that are left
  int limbs = 0;        ///< tips that a bone reaches
  double error = 0;     ///< symmetric surface mean of its model at 128 x 128, divided by the diagonal; where accepted
  std::string refusal;  ///< why it cannot be used; empty where it is accepted
};

struct SkeletonizeResult {
  Skeleton skeleton;
  std::vector<SkeletonCandidate> candidates;
  int chosen = 0;
  int genus = 0, limbs = 0;  ///< limbs: tips that were found
};

/// Makes a skeleton for a mesh that encode_model accepts (docs/steps/skeletonize.md). The same on every machine with
/// the same device.
/// \param tree  of the mesh
/// \pre the mesh is closed, oriented outwards, 2-manifold and connected
/// \throw TopologyError saying what stands in the way, when no skeleton was accepted
SkeletonizeResult skeletonize(ClContext& context, const TriangleMesh& mesh, const TriangleTree& tree,
                              const SkeletonizeOptions& options = {});

}  // namespace skeletex
