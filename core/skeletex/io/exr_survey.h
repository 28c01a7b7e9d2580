// SPDX-License-Identifier: MIT
#pragma once
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace skeletex {

/// What a part of an OpenEXR file says about itself, read without the library and without trust.
struct ExrSurvey {
  int width = 0, height = 0;
  struct Attribute {
    std::string type, value;
  };
  std::map<std::string, Attribute> attributes;
};

/// Walks through a scanline OpenEXR file of one or several parts: headers, line offset tables and the heads of all
/// chunks. OpenEXR itself would allocate whatever a damaged header asks for, and fills in for a missing end of the
/// file.
/// \param max_size  largest width and height accepted
/// \return one per part
/// \throw IoError: not OpenEXR, tiled or deep, lossy compression, absurd sizes, truncated
std::vector<ExrSurvey> survey_exr(const std::filesystem::path& path, int max_size);

}  // namespace skeletex
