// SPDX-License-Identifier: MIT
#pragma once
#include <filesystem>
#include <string>
#include <string_view>

#include "skeletex/model/mesh_attributes.h"

namespace skeletex {

/// Longest side of a picture that is read or written, pixels.
inline constexpr int kMaxImageSize = 16384;

/// Reads a PNG or JPEG picture, whichever its first bytes say.
/// \throw IoError
ColourImage read_image(const std::filesystem::path& path);
/// The same of a file's bytes.
/// \param where  its name in messages
ColourImage decode_image(std::string_view bytes, const std::string& where);
/// Writes a PNG file. Atomic.
/// \throw IoError
void write_image(const std::filesystem::path& path, const ColourImage& image);
/// The bytes of a PNG file.
/// \throw IoError
std::string encode_png(const ColourImage& image, const std::string& where);

}  // namespace skeletex
