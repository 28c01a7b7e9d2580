// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include "skeletex/io/mesh/mesh_builder.h"
#include "skeletex/io/mesh/text_reader.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

class ObjReader {
 public:
  ObjReader(std::string_view bytes, const std::string& where) : bytes_(bytes), text_(bytes, where), where_(where) {}

  MeshFile read() {
    while (!text_.at_end()) {
      // Files that were put together have a mark inside.
      const std::vector<std::string_view>& words = text_.split(without_byte_order_mark(next_line()), '#');
      is_face_last_ = false;
      if (words.empty()) continue;
      if (words[0] == "v") {
        if (words.size() < 4) text_.fail("a vertex has three coordinates");
        mesh_.add_vertex(text_.point(words, 1));
      } else if (words[0] == "f") {
        corners_.clear();
        for (std::size_t i = 1; i < words.size(); ++i) corners_.push_back(corner(words[i]));
        if (corners_.size() < 3)
          text_.fail(fmt::format("a face has three corners or more, this one {}{}", corners_.size(),
                                 text_.at_end() ? "; the file ends here and may have been cut" : ""));
        is_face_last_ = true;
        if (const auto fault = mesh_.add_face(corners_)) text_.fail(*fault);
      } else if (static_cast<unsigned char>(words[0][0]) >= 0x80) {
        text_.fail(fmt::format("{} is no keyword of OBJ; save the file as plain text", quoted_word(words[0])));
      }
    }
    if (last_corner_ >= mesh_.vertex_count())
      throw IoError(fmt::format("{}: line {}: vertex {} does not exist; the file has {}", where_, last_corner_line_,
                                last_corner_ + 1, mesh_.vertex_count()));
    MeshFile file = mesh_.take(where_);
    file.ends_in_face = is_face_last_ && !bytes_.ends_with('\n') && !bytes_.ends_with('\r');
    return file;
  }

 private:
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

  std::string_view bytes_;
  TextReader text_;
  const std::string& where_;
  MeshBuilder mesh_;
  std::string joined_;
  std::vector<int> corners_;
  int last_corner_ = -1;
  std::size_t last_corner_line_ = 0;
  bool is_face_last_ = false;
};

}  // namespace

MeshFile read_obj(std::string_view bytes, const std::string& where) { return ObjReader(bytes, where).read(); }

}  // namespace skeletex
