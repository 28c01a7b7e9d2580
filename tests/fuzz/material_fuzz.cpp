// SPDX-License-Identifier: MIT
// The material file of an OBJ, beside which there is no picture.
#include "fuzz.h"
#include "skeletex/io/mesh_file.h"
#include "support/corrupted.h"
#include "support/scratch.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace skeletex;
  static const ScratchFolder folder;
  write_bytes(folder / "body.mtl", std::string(fuzz::text_of(data, size)));
  return fuzz::read_or_refuse([&] {
    MeshFile file;
    file.material_files = {"body.mtl"};
    file.attributes.materials = {{"skin"}, {"cloth"}};
    read_materials(folder / "body.obj", file);
  });
}
