// SPDX-License-Identifier: MIT
#include "skeletex/io/gltf/gltf_surface.h"
#include "skeletex/io/gltf/read_gltf.h"
#include "surface.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace skeletex;
  const fuzz::MemoryFile file(fuzz::text_of(data, size));
  return fuzz::read_or_refuse([&] {
    const GltfSurface surface = gltf_surface(read_gltf(file.path()), "input");
    fuzz::require_complete(surface.mesh, surface.attributes);
  });
}
