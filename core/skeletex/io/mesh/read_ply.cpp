// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

#include "skeletex/io/mesh/mesh_builder.h"
#include "skeletex/io/mesh/ply_header.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

/// The values after the header, as words or as bytes.
class PlyReader {
 public:
  PlyReader(std::string_view bytes, const std::string& where)
      : bytes_(bytes), where_(where), text_(bytes, where), header_(read_ply_header(text_, where)) {
    is_text_ = header_.format == PlyFormat::kText;
    is_swapped_ = (header_.format == PlyFormat::kBigEndian) != (std::endian::native == std::endian::big);
    at_ = text_.position();
  }

  MeshFile read() {
    for (const PlyElement& element : header_.elements) {
      if (element.properties.empty()) continue;
      element_ = &element;
      for (number_ = 0; number_ < element.count; ++number_) read_element();
    }
    return mesh_.take(where_);
  }

 private:
  /// \throw IoError with the line, or the element that is read
  [[noreturn]] void fail(const std::string& what) const {
    if (is_text_) text_.fail(what);
    throw IoError(fmt::format("{}: {} {} (of {}): {}", where_, element_->name, number_, element_->count, what));
  }

  void read_element() {
    Vec3 point = Vec3::Zero();
    corners_.clear();
    for (const PlyProperty& property : element_->properties) {
      const auto axis = static_cast<int>(property.use) - static_cast<int>(PlyProperty::Use::kX);
      if (property.use == PlyProperty::Use::kCorners)
        read_corners(property);
      else if (property.use == PlyProperty::Use::kNone)
        skip(property);
      else
        point[axis] = number(*property.type);
    }
    if (element_->name == "vertex") mesh_.add_vertex(point);
    if (element_->name != "face") return;
    if (const auto fault = mesh_.add_face(corners_)) fail(*fault);
  }

  void read_corners(const PlyProperty& property) {
    const std::int64_t count = integer(*property.count_type);
    if (count < 0) fail("a face with a negative number of corners");
    for (std::int64_t k = 0; k < count; ++k) {
      const std::int64_t index = integer(*property.type);
      if (index < 0 || static_cast<std::size_t>(index) >= header_.vertices)
        fail(fmt::format("vertex {} does not exist; the file has vertices 0 to {}", index,
                         static_cast<std::int64_t>(header_.vertices) - 1));
      corners_.push_back(static_cast<int>(index));
    }
  }

  void skip(const PlyProperty& property) {
    const std::int64_t count = property.count_type == nullptr ? 1 : integer(*property.count_type);
    if (count < 0) fail("a list of negative length");
    for (std::int64_t k = 0; k < count; ++k) next(*property.type);
  }

  /// The next value, as a word of the text or as its bytes, the lowest first.
  std::string_view next(const PlyType& type) {
    std::string_view value;
    if (is_text_) {
      value = text_.next_word();
    } else {
      value = bytes_.substr(at_, static_cast<std::size_t>(type.bytes));
      at_ += value.size();
      if (value.size() < static_cast<std::size_t>(type.bytes)) value = {};
    }
    if (value.empty())
      fail(fmt::format("the file ends after {} of {} elements \"{}\"", number_, element_->count, element_->name));
    if (!is_swapped_ || is_text_) return value;
    std::reverse_copy(value.begin(), value.end(), swapped_.begin());
    return {swapped_.data(), value.size()};
  }
  double number(const PlyType& type) {
    const std::string_view value = next(type);
    if (is_text_) return text_.coordinate(value);
    return type.bytes == 4 ? static_cast<double>(from_bytes<float>(value)) : from_bytes<double>(value);
  }
  std::int64_t integer(const PlyType& type) {
    const std::string_view value = next(type);
    if (is_text_) {
      const std::optional<std::int64_t> number = integer_from(value);
      if (!number) fail(fmt::format("a whole number is expected, found {}", quoted_word(value)));
      return *number;
    }
    switch (type.bytes) {
      case 1: return type.is_signed ? from_bytes<std::int8_t>(value) : from_bytes<std::uint8_t>(value);
      case 2: return type.is_signed ? from_bytes<std::int16_t>(value) : from_bytes<std::uint16_t>(value);
      default: return type.is_signed ? from_bytes<std::int32_t>(value) : from_bytes<std::uint32_t>(value);
    }
  }
  template <class T>
  static T from_bytes(std::string_view bytes) {
    T value;
    std::memcpy(&value, bytes.data(), sizeof value);
    return value;
  }

  std::string_view bytes_;
  const std::string& where_;
  TextReader text_;
  PlyHeader header_;
  bool is_text_ = false, is_swapped_ = false;
  std::size_t at_ = 0;  ///< in the binary part
  std::array<char, 8> swapped_{};
  const PlyElement* element_ = nullptr;
  std::size_t number_ = 0;  ///< of the element
  MeshBuilder mesh_;
  std::vector<int> corners_;
};

}  // namespace

MeshFile read_ply(std::string_view bytes, const std::string& where) { return PlyReader(bytes, where).read(); }

}  // namespace skeletex
