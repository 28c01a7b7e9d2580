// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <filesystem>

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
      is_vertex_ = element.name == "vertex";
      if (is_vertex_) begin_vertices();
      for (number_ = 0; number_ < element.count; ++number_) read_element();
    }
    MeshAttributes& attributes = mesh_.attributes();
    if (!header_.image_file.empty() && !attributes.texture_coordinates.empty()) {
      attributes.materials.emplace_back().image_file = std::filesystem::path(where_).parent_path() / header_.image_file;
      attributes.triangle_materials.assign(static_cast<std::size_t>(mesh_.triangle_count()), 0);
    }
    return mesh_.take(where_);
  }

 private:
  /// \throw IoError with the line, or the element that is read
  [[noreturn]] void fail(const std::string& what) const {
    if (is_text_) text_.fail(what);
    throw IoError(fmt::format("{}: {} {} (of {}): {}", where_, element_->name, number_, element_->count, what));
  }

  using Use = PlyProperty::Use;
  static constexpr std::size_t kUses = static_cast<std::size_t>(Use::kAlpha) + 1;

  void begin_vertices() {
    for (const PlyProperty& property : element_->properties) {
      if (!property.use) continue;
      if (*property.use == Use::kNumber)
        mesh_.attributes().numbers.push_back({property.name, {}});
      else
        has_[static_cast<std::size_t>(*property.use)] = true;
      if (*property.use == Use::kRed)
        brightest_ = property.type->is_float ? 1 : property.type->bytes == 1 ? 255 : 65535;
    }
  }

  void read_element() {
    std::array<double, kUses> values{};
    values[static_cast<std::size_t>(Use::kAlpha)] = brightest_;
    std::size_t numbers = 0;
    corners_.clear();
    texture_.clear();
    for (const PlyProperty& property : element_->properties) {
      if (!property.use)
        skip(property);
      else if (*property.use == Use::kCorners)
        read_corners(property);
      else if (*property.use == Use::kTextureCoordinates)
        read_texture_coordinates(property);
      else if (*property.use == Use::kNumber)
        mesh_.attributes().numbers[numbers++].values.push_back(static_cast<float>(number(*property.type)));
      else
        values[static_cast<std::size_t>(*property.use)] = number(*property.type);
    }
    if (is_vertex_) add_vertex(values);
    if (element_->name != "face") return;
    const bool has_texture = texture_.size() == corners_.size();
    if (const auto fault =
            mesh_.add_face({corners_, {}, has_texture ? std::span<const int>(texture_) : std::span<const int>()}))
      fail(*fault);
  }

  void add_vertex(const std::array<double, kUses>& values) {
    const auto value = [&](Use use, int i = 0) {
      return values[static_cast<std::size_t>(use) + static_cast<std::size_t>(i)];
    };
    const auto has = [&](Use use) { return has_[static_cast<std::size_t>(use)]; };
    MeshAttributes& attributes = mesh_.attributes();
    mesh_.add_vertex({value(Use::kX), value(Use::kY), value(Use::kZ)});
    if (has(Use::kNormalX))
      attributes.normals.values.emplace_back(value(Use::kNormalX), value(Use::kNormalY), value(Use::kNormalZ));
    if (has(Use::kTextureU))
      attributes.texture_coordinates.values.emplace_back(static_cast<float>(value(Use::kTextureU)),
                                                         static_cast<float>(value(Use::kTextureV)));
    if (!has(Use::kRed)) return;
    Colour colour;
    for (int i = 0; i < 4; ++i) colour[i] = static_cast<float>(value(Use::kRed, i) / brightest_);
    for (int i = 0; i < 3; ++i) colour[i] = linear_from_srgb(colour[i]);
    attributes.colours.values.push_back(colour);
  }

  /// Of corners: pairs of u and v. Those of vertices do not count beside them.
  void read_texture_coordinates(const PlyProperty& property) {
    const std::int64_t count = integer(*property.count_type);
    if (count < 0) fail("a list of negative length");
    CornerValues<Eigen::Vector2f>& coordinates = mesh_.attributes().texture_coordinates;
    if (number_ == 0) coordinates.values.clear();
    for (std::int64_t k = 0; k + 1 < count; k += 2) {
      texture_.push_back(static_cast<int>(coordinates.values.size()));
      const auto u = static_cast<float>(number(*property.type)), v = static_cast<float>(number(*property.type));
      coordinates.values.emplace_back(u, v);
    }
    if (count % 2 != 0) next(*property.type);
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
    if (!type.is_float) return static_cast<double>(whole(type, value));
    return type.bytes == 4 ? static_cast<double>(from_bytes<float>(value)) : from_bytes<double>(value);
  }
  std::int64_t integer(const PlyType& type) {
    const std::string_view value = next(type);
    if (is_text_) {
      const std::optional<std::int64_t> number = integer_from(value);
      if (!number) fail(fmt::format("a whole number is expected, found {}", quoted_word(value)));
      return *number;
    }
    return whole(type, value);
  }
  static std::int64_t whole(const PlyType& type, std::string_view value) {
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
  std::vector<int> corners_, texture_;  ///< of the face that is read
  bool is_vertex_ = false;
  std::array<bool, kUses> has_{};
  double brightest_ = 1;  ///< what full colour is
};

}  // namespace

MeshFile read_ply(std::string_view bytes, const std::string& where) { return PlyReader(bytes, where).read(); }

}  // namespace skeletex
