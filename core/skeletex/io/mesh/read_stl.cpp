// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <unordered_map>

#include "skeletex/io/mesh/mesh_builder.h"
#include "skeletex/io/mesh/text_reader.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

/// Merges corners that are equal in single precision, which is what STL files hold.
class Welder {
 public:
  void add_triangle(const std::array<Vec3, 3>& points) {
    std::array<int, 3> corners{};
    for (int i = 0; i < 3; ++i) {
      const auto [found, is_new] = numbers_.try_emplace(key_of(points[i]), mesh_.vertex_count());
      if (is_new) mesh_.add_vertex(points[i]);
      corners[i] = found->second;
    }
    mesh_.add_face(corners);
  }
  int triangle_count() const { return mesh_.face_count(); }
  MeshFile take(const std::string& where) {
    MeshFile file = mesh_.take(where);
    if (static_cast<std::size_t>(file.faces_in_file) > kMostElements / 3)
      throw IoError(where + ": the mesh is too large");
    file.vertices_in_file = 3 * file.faces_in_file;
    file.merged_vertices = file.vertices_in_file - static_cast<int>(file.mesh.positions.size());
    return file;
  }

 private:
  using Key = std::array<float, 3>;
  struct Hash {
    std::size_t operator()(const Key& key) const {
      std::uint64_t hash = 0;
      for (const float x : key) hash = (hash ^ std::bit_cast<std::uint32_t>(x)) * 0x9e3779b97f4a7c15u;
      return hash ^ (hash >> 32);
    }
  };
  /// Adding 0 makes -0 to 0.
  static Key key_of(const Vec3& p) {
    return {static_cast<float>(p[0]) + 0.0f, static_cast<float>(p[1]) + 0.0f, static_cast<float>(p[2]) + 0.0f};
  }

  MeshBuilder mesh_;
  std::unordered_map<Key, int, Hash> numbers_;
};

class StlTextReader {
 public:
  StlTextReader(std::string_view bytes, const std::string& where) : text_(bytes, where), where_(where) {}

  MeshFile read() {
    for (;;) {
      std::string word = lower_case(text_.next_word());
      if (word.empty()) return triangles_.take(where_);
      if (word != "solid") text_.fail(fmt::format("\"solid\" is expected, found {}", quoted_word(word)));
      text_.next_line();  // a name, of any words
      while ((word = lower_case(text_.next_word())) == "facet") read_facet();
      if (word.empty())
        text_.fail(fmt::format("the file ends after {} triangles without \"endsolid\"", triangles_.triangle_count()));
      if (word != "endsolid")
        text_.fail(fmt::format("\"facet\" or \"endsolid\" is expected, found {}", quoted_word(word)));
      text_.next_line();
    }
  }

 private:
  void read_facet() {
    expect({"normal"});
    for (int i = 0; i < 3; ++i) number();  // any: programs write NaN for the normals of slivers
    expect({"outer", "loop"});
    std::array<Vec3, 3> points;
    for (Vec3& point : points) {
      expect({"vertex"});
      for (double& x : point) x = coordinate();
    }
    expect({"endloop", "endfacet"});
    triangles_.add_triangle(points);
  }
  void expect(std::initializer_list<const char*> words) {
    for (const char* word : words) {
      const std::string_view found = text_.next_word();
      if (found.empty())
        text_.fail(
            fmt::format("the file ends in triangle {}, where \"{}\" is expected", triangles_.triangle_count(), word));
      if (lower_case(found) != word) text_.fail(fmt::format("\"{}\" is expected, found {}", word, quoted_word(found)));
    }
  }
  double number() {
    const std::string_view word = text_.next_word();
    const std::optional<double> value = number_from(word);
    if (!value)
      text_.fail(word.empty() ? fmt::format("the file ends in triangle {}", triangles_.triangle_count())
                              : fmt::format("a number is expected, found {}", quoted_word(word)));
    return *value;
  }
  double coordinate() {
    const double value = number();
    if (!std::isfinite(static_cast<float>(value)))
      text_.fail(fmt::format("the coordinate {} cannot be welded; repair the file", value));
    return value;
  }

  TextReader text_;
  const std::string& where_;
  Welder triangles_;
};

constexpr std::size_t kHeaderBytes = 84, kTriangleBytes = 50;

MeshFile read_stl_binary(std::string_view bytes, std::uint32_t count, const std::string& where) {
  if (bytes.size() < kHeaderBytes)
    throw IoError(fmt::format("{}: not an STL file: {} bytes are fewer than its header has", where, bytes.size()));
  if (bytes.size() < kHeaderBytes + kTriangleBytes * count)
    throw IoError(fmt::format("{}: the file ends after {} of {} triangles, or is no STL file", where,
                              (bytes.size() - kHeaderBytes) / kTriangleBytes, count));
  Welder triangles;
  for (std::uint32_t i = 0; i < count; ++i) {
    constexpr std::size_t kNormalBytes = 12;
    std::array<float, 9> x{};
    std::memcpy(x.data(), bytes.data() + kHeaderBytes + kTriangleBytes * i + kNormalBytes, sizeof x);
    if (!std::all_of(x.begin(), x.end(), [](float value) { return std::isfinite(value); }))
      throw IoError(fmt::format(
          "{}: triangle {} (of {}) has a coordinate that is no finite number, which cannot be welded; repair the file",
          where, i, count));
    triangles.add_triangle({Vec3(x[0], x[1], x[2]), Vec3(x[3], x[4], x[5]), Vec3(x[6], x[7], x[8])});
  }
  return triangles.take(where);
}

}  // namespace

MeshFile read_stl(std::string_view bytes, const std::string& where) {
  static_assert(std::endian::native == std::endian::little);
  std::uint32_t count = 0;
  if (bytes.size() >= kHeaderBytes) std::memcpy(&count, bytes.data() + 80, sizeof count);
  // Many binary files begin with "solid", too; what counts is whether the size fits, and then whether it is text.
  const std::string_view start = without_byte_order_mark(bytes.substr(0, 1024));
  const std::size_t first = start.find_first_not_of(" \t\r\n");
  const bool is_text = bytes.size() != kHeaderBytes + kTriangleBytes * count && first != std::string_view::npos &&
                       lower_case(start.substr(first, 5)) == "solid" && start.find('\0') == std::string_view::npos;
  return is_text ? StlTextReader(bytes, where).read() : read_stl_binary(bytes, count, where);
}

}  // namespace skeletex
