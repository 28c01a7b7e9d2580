// SPDX-License-Identifier: MIT
#include "picture_format.h"

#include <charconv>

#include "command.h"

namespace skeletex::cli {

std::array<int, 2> parse_picture_size(const std::string& text) {
  std::array<int, 2> size{0, 0};
  const char* const end = text.data() + text.size();
  const auto first = std::from_chars(text.data(), end, size[0]);
  bool is_good = first.ec == std::errc() && first.ptr != end && (*first.ptr == 'x' || *first.ptr == 'X');
  if (is_good) {
    const auto second = std::from_chars(first.ptr + 1, end, size[1]);
    is_good = second.ec == std::errc() && second.ptr == end;
  }
  if (!is_good || size[0] < 16 || size[1] < 16 || size[0] > 8192 || size[1] > 8192)
    throw CLI::ValidationError(
        "--size", "\"" + text + "\" is no picture size; give WIDTHxHEIGHT, 16 to 8192 pixels, e.g. 1200x900");
  return size;
}

std::optional<LinearRgb> parse_background(const std::string& text) {
  if (text == "transparent") return std::nullopt;
  if (text == "white") return LinearRgb{1, 1, 1};
  if (text == "black") return LinearRgb{0, 0, 0};
  unsigned value = 0;
  const char* const end = text.data() + text.size();
  const bool is_hex = text.size() == 7 && text[0] == '#';
  if (is_hex) {
    const auto [rest, code] = std::from_chars(text.data() + 1, end, value, 16);
    if (code == std::errc() && rest == end)
      return to_linear({static_cast<unsigned char>(value >> 16), static_cast<unsigned char>(value >> 8 & 255),
                        static_cast<unsigned char>(value & 255)});
  }
  throw CLI::ValidationError("--background",
                             "\"" + text + "\" is no background; give white, black, transparent or #rrggbb");
}

}  // namespace skeletex::cli
