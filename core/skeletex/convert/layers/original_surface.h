// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/geometry/triangle_tree.h"
#include "skeletex/model/mesh_attributes.h"

namespace skeletex {

/// The surface that a mesh near by stands for, with its colours and normals.
struct OriginalSurface {
  TriangleMesh mesh;  ///< in the user's units
  TriangleTree tree;  ///< of the mesh
  MeshAttributes attributes;
};

}  // namespace skeletex
