// SPDX-License-Identifier: MIT
// PNG and JPEG.
#include "fuzz.h"
#include "skeletex/io/image_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace skeletex;
  return fuzz::read_or_refuse([&] {
    const ColourImage image = decode_image(fuzz::text_of(data, size), "input");
    fuzz::require(image.rgba.size() == std::size_t{4} * image.width * image.height);
  });
}
