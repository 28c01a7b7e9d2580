// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include "skeletex/io/mesh/mesh_builder.h"
#include "skeletex/io/mesh/text_reader.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

/// Reads "OFF", with the letters of what vertices have besides a position.
/// \return the words after it on its line
std::vector<std::string_view> read_off_header(TextReader& text, const std::string& where) {
  std::vector<std::string_view> words = text.next_words('#');
  const std::string_view header = words.empty() ? "" : words[0];
  if (!header.ends_with("OFF")) throw IoError(where + ": not an OFF file: its first word is not OFF");
  std::string_view prefix = header.substr(0, header.size() - 3);
  for (const std::string_view part : {"ST", "C", "N"})
    if (prefix.starts_with(part)) prefix.remove_prefix(part.size());
  if (!prefix.empty())
    text.fail(fmt::format("{} files are not read; OFF, COFF, NOFF and STOFF are", quoted_word(header)));
  words.erase(words.begin());
  if (!words.empty() && words[0] == "BINARY") text.fail("binary OFF is not read; save as text, or as binary PLY");
  return words;
}

}  // namespace

MeshFile read_off(std::string_view bytes, const std::string& where) {
  TextReader text(bytes, where);
  std::vector<std::string_view> words = read_off_header(text, where);
  if (words.empty()) words = text.next_words('#');
  if (words.size() < 2) text.fail("the numbers of vertices and faces are expected");
  const std::size_t vertices = text.count(words[0], "vertices"), faces = text.count(words[1], "faces");
  MeshBuilder mesh;
  for (std::size_t v = 0; v < vertices; ++v) {
    const auto& line = text.next_words('#');
    if (line.empty()) text.fail(fmt::format("the file ends after {} of {} vertices", v, vertices));
    if (line.size() < 3) text.fail("a line with a vertex's three coordinates is expected");
    mesh.add_vertex(text.point(line, 0));
  }
  std::vector<int> corners;
  for (std::size_t f = 0; f < faces; ++f) {
    const auto& line = text.next_words('#');
    if (line.empty()) text.fail(fmt::format("the file ends after {} of {} faces", f, faces));
    const std::size_t count = text.count(line[0], "corners");
    if (line.size() < count + 1)
      text.fail(fmt::format("a face of {} corners has only {} on its line", count, line.size() - 1));
    corners.clear();
    for (std::size_t i = 1; i <= count; ++i) corners.push_back(text.index(line[i], vertices));
    if (const auto fault = mesh.add_face(corners)) text.fail(*fault);
  }
  return mesh.take(where);
}

}  // namespace skeletex
