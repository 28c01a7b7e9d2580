// SPDX-License-Identifier: MIT
#include "skeletex/model/error.h"

namespace skeletex {

std::string printable(std::string_view text) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string result;
  const auto escape = [&](unsigned char byte) {
    result += "\\x";
    result += kDigits[byte >> 4];
    result += kDigits[byte & 15];
  };
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto byte = static_cast<unsigned char>(text[i]);
    const bool has_next = i + 1 < text.size();
    // The control characters from U+0080 on are two bytes in UTF-8, and terminals obey them as well.
    if (byte == 0xc2 && has_next && static_cast<unsigned char>(text[i + 1]) < 0xa0)
      escape(byte), escape(static_cast<unsigned char>(text[++i]));
    else if ((byte < 0x20 && byte != '\n' && byte != '\t') || byte == 0x7f)
      escape(byte);
    else
      result += text[i];
  }
  return result;
}

}  // namespace skeletex
