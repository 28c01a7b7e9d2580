// SPDX-License-Identifier: MIT
#pragma once
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "skeletex/model/texture.h"

namespace skeletex {

/// Arrays behind each other, as the page's script finds them: little-endian, each from a multiple of 8 bytes on. They
/// are cut into parts, so that the page can show a coarse level before the finer ones are loaded.
class PageArrays {
 public:
  /// \return what the script finds the array by: [type, first byte, number of values]
  nlohmann::ordered_json add(std::span<const float> values);
  nlohmann::ordered_json add(std::span<const int> values);
  nlohmann::ordered_json add(std::span<const unsigned char> values);
  /// Ends a part: the arrays that were added since the last one.
  void end_part();
  std::size_t size() const { return bytes_.size(); }
  /// The parts in their order, each compressed (zlib) and in base64.
  std::vector<std::string> texts() const;

 private:
  nlohmann::ordered_json add(const char* type, const void* values, std::size_t count, std::size_t size);
  std::vector<unsigned char> bytes_;
  std::vector<std::size_t> part_ends_;
};

/// Text or bytes compressed (zlib), in base64.
std::string compressed_text(std::span<const unsigned char> bytes);

/// Adds numbers as whole steps, as differences from the array before: from one key of a morph to the next they are
/// small.
/// \param before  the steps of the array before, of any length, which become this one's; empty: none
/// \return {"step", "differences"}: bytes 0 to 3 of each, plane by plane; small ones of either sign as small numbers
nlohmann::ordered_json add_steps(PageArrays& arrays, std::span<const float> values, double step,
                                 std::vector<int>& before);

/// Adds the texels of all patches with 16 bits a channel, in steps of at most 1/65535 of a patch's range or `step`,
/// whichever is larger. Texels are stored as differences from the plane through three neighbours, which compresses.
/// \param step  world units
/// \return {"texels", "scales"}: low bytes and high bytes; per patch and channel the lowest value and the step
nlohmann::ordered_json add_texels(PageArrays& arrays, const DisplacementTexture& texture,
                                  const std::vector<Patch>& patches, double step);

}  // namespace skeletex
