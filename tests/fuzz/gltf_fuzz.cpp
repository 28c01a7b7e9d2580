// SPDX-License-Identifier: MIT
#include "fuzz.h"
#include "skeletex/io/gltf/gltf_surface.h"
#include "skeletex/io/gltf/read_gltf.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace skeletex;
  const fuzz::MemoryFile file(fuzz::text_of(data, size));
  return fuzz::read_or_refuse([&] {
    const GltfSurface surface = gltf_surface(read_gltf(file.path()), "input");
    const int vertices = static_cast<int>(surface.mesh.positions.size());
    for (const Triangle& triangle : surface.mesh.triangles)
      for (const int vertex : triangle) fuzz::require(vertex >= 0 && vertex < vertices);
  });
}
