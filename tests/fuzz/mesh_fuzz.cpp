// SPDX-License-Identifier: MIT
// OBJ, OFF, PLY and STL: the first byte, '0' to '3', says which.
#include <array>

#include "fuzz.h"
#include "skeletex/io/mesh/mesh_builder.h"

/// Corners name values that there are; without corners, each vertex has one, or none has.
template <class T>
void require_complete(const skeletex::CornerValues<T>& list, const skeletex::TriangleMesh& mesh) {
  using skeletex::fuzz::require;
  if (list.corners.empty()) return require(list.empty() || list.values.size() == mesh.positions.size());
  require(list.corners.size() == mesh.triangles.size());
  for (const skeletex::Triangle& triangle : list.corners)
    for (const int value : triangle) require(value < static_cast<int>(list.values.size()));
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace skeletex;
  if (size == 0) return 0;
  constexpr std::array kReaders{read_obj, read_off, read_ply, read_stl};
  const auto read = kReaders[data[0] % kReaders.size()];
  return fuzz::read_or_refuse([&] {
    const MeshFile file = read(fuzz::text_of(data + 1, size - 1), "input");
    const int vertices = static_cast<int>(file.mesh.positions.size());
    fuzz::require(file.triangles == static_cast<int>(file.mesh.triangles.size()));
    for (const Triangle& triangle : file.mesh.triangles)
      for (const int vertex : triangle) fuzz::require(vertex >= 0 && vertex < vertices);
    require_complete(file.attributes.normals, file.mesh);
    require_complete(file.attributes.colours, file.mesh);
    require_complete(file.attributes.texture_coordinates, file.mesh);
  });
}
