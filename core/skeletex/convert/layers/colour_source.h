// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/geometry/triangle_tree.h"
#include "skeletex/model/mesh_attributes.h"

namespace skeletex {

/// A surface whose colours are those of a mesh near by: of the nearest point.
struct ColourSource {
  TriangleMesh mesh;  ///< in the user's units
  TriangleTree tree;  ///< of the mesh
  MeshAttributes attributes;
};

}  // namespace skeletex
