// SPDX-License-Identifier: MIT
#pragma once
#include "fuzz.h"
#include "skeletex/model/mesh_attributes.h"

namespace skeletex::fuzz {

/// Corners name values that there are; without corners, each vertex has a value, or none has.
template <class T>
void require_complete(const CornerValues<T>& list, const TriangleMesh& mesh) {
  if (list.corners.empty()) return require(list.empty() || list.values.size() == mesh.positions.size());
  require(list.corners.size() == mesh.triangles.size());
  for (const Triangle& triangle : list.corners)
    for (const int value : triangle) require(value >= -1 && value < static_cast<int>(list.values.size()));
}

/// Every index of a mesh and its attributes names something that there is.
inline void require_complete(const TriangleMesh& mesh, const MeshAttributes& attributes) {
  const int vertices = static_cast<int>(mesh.positions.size());
  for (const Triangle& triangle : mesh.triangles)
    for (const int vertex : triangle) require(vertex >= 0 && vertex < vertices);
  require_complete(attributes.normals, mesh);
  require_complete(attributes.colours, mesh);
  require_complete(attributes.texture_coordinates, mesh);
  const std::vector<int>& materials = attributes.triangle_materials;
  require(materials.empty() || materials.size() == mesh.triangles.size());
  for (const int material : materials)
    require(material >= -1 && material < static_cast<int>(attributes.materials.size()));
  for (const VertexNumbers& numbers : attributes.numbers) require(numbers.values.size() == mesh.positions.size());
}

}  // namespace skeletex::fuzz
