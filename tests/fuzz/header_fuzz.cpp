// SPDX-License-Identifier: MIT
// The JSON in a model's header.
#include "fuzz.h"
#include "skeletex/io/json_file.h"
#include "skeletex/io/model_json.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace skeletex;
  return fuzz::read_or_refuse([&] {
    const nlohmann::json header = parse_json(fuzz::text_of(data, size), "input");
    const SkeletexModel model = model_from_json(header, "input");
    weight_channels(header, model.skeleton.bones.size(), "input");
    layer_channels(layers_from_json(header, "input").layers);
    // What is read is written, and read again as the same.
    const nlohmann::json json = model_to_json(model, "again");
    fuzz::require(model_to_json(model_from_json(parse_json(json.dump(), "again"), "again"), "again") == json);
  });
}
