// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <algorithm>

#include "skeletex/io/mesh/mesh_builder.h"
#include "skeletex/io/mesh/text_reader.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

class ObjReader {
 public:
  ObjReader(std::string_view bytes, const std::string& where) : bytes_(bytes), text_(bytes, where), where_(where) {}

  MeshFile read() {
    while (!text_.at_end()) read_line();
    if (last_corner_ >= mesh_.vertex_count())
      throw IoError(fmt::format("{}: line {}: vertex {} does not exist; the file has {}", where_, last_corner_line_,
                                last_corner_ + 1, mesh_.vertex_count()));
    MeshAttributes& attributes = mesh_.attributes();
    drop_missing(attributes.normals.values.size(), attributes.normals.corners);
    drop_missing(attributes.texture_coordinates.values.size(), attributes.texture_coordinates.corners);
    if (!attributes.colours.empty())
      attributes.colours.values.resize(static_cast<std::size_t>(mesh_.vertex_count()), Colour::Ones());
    MeshFile file = mesh_.take(where_, std::move(material_files_));
    file.ends_in_face = is_face_last_ && !ends_with_line_break();
    return file;
  }

 private:
  void read_line() {
    const std::string_view line = without_byte_order_mark(next_line());  // files that were put together have it inside
    const std::vector<std::string_view>& words = text_.split(line, '#');
    is_face_last_ = !words.empty() && words[0] == "f";
    if (words.empty()) return;
    MeshAttributes& attributes = mesh_.attributes();
    if (words[0] == "v") {
      if (words.size() < 4) text_.fail("a vertex has three coordinates");
      mesh_.add_vertex(text_.point(words, 1));
      if (words.size() >= 7) add_colour(words);
    } else if (words[0] == "vn" && words.size() >= 4) {
      attributes.normals.values.push_back(text_.point(words, 1));
    } else if (words[0] == "vt" && words.size() >= 2) {
      attributes.texture_coordinates.values.emplace_back(
          static_cast<float>(text_.coordinate(words[1])),
          words.size() > 2 ? static_cast<float>(text_.coordinate(words[2])) : 0.f);
    } else if (words[0] == "f") {
      read_face(words);
    } else if (words[0] == "usemtl") {
      use_material(words.size() > 1 ? rest_of(line, words[1]) : "");
    } else if (words[0] == "mtllib" && words.size() > 1) {
      material_files_.push_back(rest_of(line, words[1]));
    } else if (static_cast<unsigned char>(words[0][0]) >= 0x80) {
      text_.fail(fmt::format("{} is no keyword of OBJ; save the file as plain text", quoted_word(words[0])));
    }
  }

  /// Names of files and materials may contain spaces.
  static std::string rest_of(std::string_view line, std::string_view first_word) {
    std::string rest(line.substr(static_cast<std::size_t>(first_word.data() - line.data())));
    while (!rest.empty() && (rest.back() == ' ' || rest.back() == '\t')) rest.pop_back();
    return rest;
  }

  /// A line with those that a backslash at its end joins to it.
  std::string_view next_line() {
    std::string_view line = text_.next_line();
    if (!line.ends_with('\\')) return line;
    joined_.clear();
    for (; line.ends_with('\\'); line = text_.next_line()) {
      joined_ += line.substr(0, line.size() - 1);
      joined_ += ' ';
    }
    return joined_ += line;
  }

  /// The three numbers that many programs write behind the coordinates.
  void add_colour(const std::vector<std::string_view>& words) {
    std::vector<Colour>& colours = mesh_.attributes().colours.values;
    colours.resize(static_cast<std::size_t>(mesh_.vertex_count()), Colour::Ones());
    for (int i = 0; i < 3; ++i)
      colours.back()[i] =
          linear_from_srgb(static_cast<float>(text_.coordinate(words[4 + static_cast<std::size_t>(i)])));
  }

  void use_material(const std::string& name) {
    std::vector<Material>& materials = mesh_.attributes().materials;
    const auto found =
        std::find_if(materials.begin(), materials.end(), [&](const Material& m) { return m.name == name; });
    material_ = static_cast<int>(found - materials.begin());
    if (found == materials.end()) {
      materials.emplace_back();
      materials.back().name = name;
    }
  }

  void read_face(const std::vector<std::string_view>& words) {
    const MeshAttributes& attributes = mesh_.attributes();
    corners_.clear();
    texture_.clear();
    normals_.clear();
    bool has_texture = false, has_normals = false;
    for (std::size_t i = 1; i < words.size(); ++i) {
      corners_.push_back(corner(words[i]));
      texture_.push_back(other_index(words[i], 1, attributes.texture_coordinates.values.size()));
      normals_.push_back(other_index(words[i], 2, attributes.normals.values.size()));
      has_texture = has_texture || texture_.back() >= 0;
      has_normals = has_normals || normals_.back() >= 0;
    }
    if (corners_.size() < 3 && text_.at_end() && !ends_with_line_break())
      text_.fail(
          fmt::format("the file ends within a face, after {} of its corners; it was not copied or written completely",
                      corners_.size()));
    const auto given = [](bool is_given, const std::vector<int>& indices) {
      return is_given ? std::span<const int>(indices) : std::span<const int>();
    };
    if (const auto fault =
            mesh_.add_face({corners_, given(has_normals, normals_), given(has_texture, texture_), material_}))
      text_.fail(*fault);
  }

  /// The vertex of "7", "7/1", "7/1/2" or "-1//3", counted from 0. It may come after the face.
  int corner(std::string_view word) {
    const std::optional<std::int64_t> given = integer_from(word.substr(0, word.find('/')));
    if (!given || *given == 0)
      text_.fail(fmt::format("a vertex index (1, 2, ... or -1, -2, ...) is expected, found {}", quoted_word(word)));
    if (*given < -mesh_.vertex_count())
      text_.fail(fmt::format("vertex {} does not exist; {} come before this line", *given, mesh_.vertex_count()));
    const std::int64_t index = *given > 0 ? *given - 1 : mesh_.vertex_count() + *given;
    if (index >= static_cast<std::int64_t>(kMostElements)) text_.fail(fmt::format("vertex {} does not exist", *given));
    if (index > last_corner_) {
      last_corner_ = static_cast<int>(index);
      last_corner_line_ = text_.line_number();
    }
    return static_cast<int>(index);
  }

  /// The index of a corner's texture coordinates (part 1) or normal (part 2), counted from 0; -1: there is none.
  static int other_index(std::string_view word, int part, std::size_t count) {
    for (; part > 0; --part) {
      const std::size_t slash = word.find('/');
      if (slash == std::string_view::npos) return -1;
      word = word.substr(slash + 1);
    }
    const std::optional<std::int64_t> given = integer_from(word.substr(0, word.find('/')));
    if (!given || *given == 0 || *given > static_cast<std::int64_t>(kMostElements)) return -1;
    return static_cast<int>(
        std::max<std::int64_t>(*given > 0 ? *given - 1 : static_cast<std::int64_t>(count) + *given, -1));
  }

  /// Files that name normals or texture coordinates that they do not have are common.
  static void drop_missing(std::size_t count, std::vector<Triangle>& corners) {
    for (Triangle& triangle : corners)
      for (int& corner : triangle)
        if (corner >= static_cast<int>(count)) corner = -1;
  }

  bool ends_with_line_break() const { return bytes_.ends_with('\n') || bytes_.ends_with('\r'); }

  std::string_view bytes_;
  TextReader text_;
  const std::string& where_;
  MeshBuilder mesh_;
  std::string joined_;
  std::vector<std::string> material_files_;
  std::vector<int> corners_, texture_, normals_;
  int material_ = -1;
  int last_corner_ = -1;
  std::size_t last_corner_line_ = 0;
  bool is_face_last_ = false;
};

}  // namespace

MeshFile read_obj(std::string_view bytes, const std::string& where) { return ObjReader(bytes, where).read(); }

}  // namespace skeletex
