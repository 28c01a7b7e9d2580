// SPDX-License-Identifier: MIT
#pragma once
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>

namespace skeletex {

/// What an OpenEXR file says about itself, read without the library and without trust.
struct ExrSurvey {
  int width = 0, height = 0;
  struct Attribute {
    std::string type, value;
  };
  std::map<std::string, Attribute> attributes;
};

/// Walks through a single-part scanline OpenEXR file: header, line offset table and the heads of all chunks. OpenEXR
/// itself would allocate whatever a damaged header asks for, and fills in for a missing end of the file.
/// \param max_size        largest width and height accepted
/// \param is_header_only  read no further than the header
/// \throw IoError: not OpenEXR, tiled or of several parts, lossy compression, absurd sizes, truncated
ExrSurvey survey_exr(const std::filesystem::path& path, int max_size, bool is_header_only);

}  // namespace skeletex
