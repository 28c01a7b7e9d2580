// SPDX-License-Identifier: MIT
// Compact models. A prefix needs no checksum, so that bytes that were changed reach the decoder.
#include "fuzz.h"
#include "skeletex/io/compact/compact_model_file.h"
#include "skeletex/io/model_json.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace skeletex;
  const fuzz::MemoryFile file(fuzz::text_of(data, size));
  fuzz::read_or_refuse([&] { read_compact_model(file.path()); });
  return fuzz::read_or_refuse([&] {
    const SkeletexModel model = read_compact_model(file.path(), {.bytes = size, .size = 64});
    model_to_json(model, "again");
  });
}
