// SPDX-License-Identifier: MIT
#pragma once
#include <string>
#include <vector>

#include "skeletex/cl/context.h"
#include "skeletex/model/mesh.h"
#include "skeletex/model/skeleton.h"

namespace skeletex {

enum class Severity { kNote, kWarning, kError };

struct Finding {
  Severity severity = Severity::kError;
  std::string rule;     ///< "closed", "manifold", "components", "orientation", "finite", "node-inside", "bone-crossing", ...
  std::string message;  ///< what is wrong and where
  std::string remedy;   ///< what to do
};

/// Everything that is wrong with a mesh and a skeleton, all at once, each with its place and remedy. A mesh that is
/// inside out is turned, and said so in a note; self-intersections of a closed manifold are a warning with the count.
/// When all else is right the segmentation is tried, so that walls that cross inside the body are found too.
std::vector<Finding> validate_input(ClContext& context, TriangleMesh& mesh, const Skeleton& skeleton);
bool has_errors(const std::vector<Finding>& findings);

}  // namespace skeletex
