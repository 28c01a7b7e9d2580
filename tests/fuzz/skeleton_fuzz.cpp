// SPDX-License-Identifier: MIT
#include "fuzz.h"
#include "skeletex/io/json_file.h"
#include "skeletex/io/skeleton_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace skeletex;
  return fuzz::read_or_refuse([&] {
    const Skeleton skeleton = skeleton_from_json(parse_json(fuzz::text_of(data, size), "input"), "input");
    // What is read is written, and read again as the same.
    const nlohmann::json json = skeleton_to_json(skeleton);
    fuzz::require(skeleton_to_json(skeleton_from_json(parse_json(json.dump(), "again"), "again")) == json);
  });
}
