// SPDX-License-Identifier: MIT
// Models in OpenEXR files, whatever their checksum: what another program has changed is read too.
#include "fuzz.h"
#include "skeletex/io/model_file.h"
#include "skeletex/io/model_json.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace skeletex;
  const fuzz::MemoryFile file(fuzz::text_of(data, size));
  return fuzz::read_or_refuse([&] {
    const int levels = static_cast<int>(read_model_levels(file.path()).size());
    for (int level = 0; level < levels; ++level) {
      const SkeletexModel model = read_model(file.path(), level, ChecksumRule::kIgnore);
      model_to_json(model, "again");
    }
  });
}
