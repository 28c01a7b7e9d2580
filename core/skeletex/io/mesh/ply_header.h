// SPDX-License-Identifier: MIT
#pragma once
#include <optional>
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
  /// Up to kAlpha the uses are numbers of a vertex, each at most once.
  enum class Use {
    kX,
    kY,
    kZ,
    kNormalX,
    kNormalY,
    kNormalZ,
    kTextureU,
    kTextureV,
    kRed,
    kGreen,
    kBlue,
    kAlpha,
    kNumber,             ///< any other number of a vertex
    kCorners,            ///< the list of a face's vertices
    kTextureCoordinates  ///< the list u, v, u, v, .. of a face's corners
  };
  std::string name;
  const PlyType* type = nullptr;
  const PlyType* count_type = nullptr;  ///< of a list; else none
  std::optional<Use> use = std::nullopt;
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
  std::string image_file;  ///< that a comment names
};

/// Reads the lines up to "end_header".
/// \throw IoError
PlyHeader read_ply_header(TextReader& text, const std::string& where);

}  // namespace skeletex
