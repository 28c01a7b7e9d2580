// SPDX-License-Identifier: MIT
#include "picture_format.h"

#include <charconv>

#include "command.h"

namespace skeletex::cli {

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
