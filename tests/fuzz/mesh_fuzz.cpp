// SPDX-License-Identifier: MIT
// OBJ, OFF, PLY and STL: the first byte, '0' to '3', says which.
#include <array>

#include "skeletex/io/mesh/mesh_builder.h"
#include "surface.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace skeletex;
  if (size == 0) return 0;
  constexpr std::array kReaders{read_obj, read_off, read_ply, read_stl};
  const auto read = kReaders[data[0] % kReaders.size()];
  return fuzz::read_or_refuse([&] {
    const MeshFile file = read(fuzz::text_of(data + 1, size - 1), "input");
    fuzz::require(file.triangles == static_cast<int>(file.mesh.triangles.size()));
    fuzz::require_complete(file.mesh, file.attributes);
  });
}
