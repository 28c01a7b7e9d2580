// SPDX-License-Identifier: MIT
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "skeletex/device/context.h"
#include "skeletex/geometry/mesh.h"
#include "skeletex/geometry/triangle_tree.h"
#include "skeletex/skeleton/skeleton.h"

namespace skeletex {

enum class Severity { kNote, kWarning, kError };

struct Finding {
  Severity severity = Severity::kError;
  /// What kind it is. Mesh: "empty", "finite", "degenerate", "closed", "manifold", "components", "orientation",
  /// "volume", "area" (warning), "unreferenced" (warning), "self-intersection" (warning). Skeleton: "empty",
  /// "bone-node", "finite", "bone-length", "bone-angle", "bone-duplicate", "bone-direction", "bone-contact",
  /// "node-duplicate", "node-unused" (warning), "connected", "size". Both: "frame", "node-inside", "bone-crossing",
  /// "genus", "separation-planes", "segmentation".
  std::string rule;
  std::string message;  ///< what is wrong and where: names or numbers, and coordinates
  std::string remedy;   ///< what to do, with an amount where something is to be moved
  NodeIndex node;       ///< of the skeleton, where one is meant; else -1
  BoneIndex bone;
  std::optional<Vec3> position{};  ///< where it is, if it has a place
};

/// Everything that is wrong with a mesh and a skeleton, all at once, each with its place and remedy; empty when nothing
/// is. A mesh that is inside out is turned, and said so in a note; self-intersections of a closed manifold are a
/// warning with the count. When all else is right the segmentation is tried; where it fails, every bone whose
/// separation planes cross inside the body is told (bone_margins). Accepts any input, NaN and bad indices included.
std::vector<Finding> validate_input(ClContext& context, TriangleMesh& mesh, const Skeleton& skeleton);
/// The same without that trial, for callers that segment next anyway (and catch what it throws).
/// \param tree  out: of the mesh's triangles, for what is next; not of one with errors
std::vector<Finding> validate_before_segmentation(TriangleMesh& mesh, const Skeleton& skeleton,
                                                  std::optional<TriangleTree>* tree = nullptr);
/// What is wrong with a mesh by itself; it is turned as above.
std::vector<Finding> validate_mesh(TriangleMesh& mesh, std::optional<TriangleTree>* tree = nullptr);
bool has_errors(const std::vector<Finding>& findings);

}  // namespace skeletex
