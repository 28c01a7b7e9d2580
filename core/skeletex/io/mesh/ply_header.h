// SPDX-License-Identifier: MIT
#pragma once
#include <string>
#include <vector>

#include "skeletex/io/mesh/text_reader.h"

namespace skeletex {

struct PlyType {
  const char *name, *alias;
  int bytes;
  bool is_float, is_signed;
};

struct PlyProperty {
  enum class Use { kNone, kX, kY, kZ, kCorners };
  std::string name;
  const PlyType* type = nullptr;
  const PlyType* count_type = nullptr;  ///< of a list; else none
  Use use = Use::kNone;
};

struct PlyElement {
  std::string name;
  std::size_t count = 0;
  std::vector<PlyProperty> properties;
};

enum class PlyFormat { kNone, kText, kLittleEndian, kBigEndian };

struct PlyHeader {
  PlyFormat format = PlyFormat::kNone;
  std::vector<PlyElement> elements;  ///< a "vertex" with x, y and z, and after it a "face" with its corners
  std::size_t vertices = 0;
};

/// Reads the lines up to "end_header".
/// \throw IoError
PlyHeader read_ply_header(TextReader& text, const std::string& where);

}  // namespace skeletex
