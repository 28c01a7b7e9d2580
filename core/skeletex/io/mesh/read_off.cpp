// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <algorithm>

#include "skeletex/io/mesh/mesh_builder.h"
#include "skeletex/io/mesh/text_reader.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

/// What the lines of vertices have besides a position, by the letters before "OFF".
struct OffHeader {
  bool has_texture = false, has_colours = false, has_normals = false;
  std::vector<std::string_view> words;  ///< after the first one on its line
};
OffHeader read_off_header(TextReader& text, const std::string& where) {
  OffHeader header;
  header.words = text.next_words('#');
  const std::string_view word = header.words.empty() ? "" : header.words[0];
  if (!word.ends_with("OFF")) throw IoError(where + ": not an OFF file: its first word is not OFF");
  std::string_view prefix = word.substr(0, word.size() - 3);
  const auto take = [&prefix](std::string_view part) {
    const bool is_there = prefix.starts_with(part);
    if (is_there) prefix.remove_prefix(part.size());
    return is_there;
  };
  header.has_texture = take("ST");
  header.has_colours = take("C");
  header.has_normals = take("N");
  if (!prefix.empty())
    text.fail(fmt::format("{} files are not read; OFF, COFF, NOFF and STOFF are", quoted_word(word)));
  header.words.erase(header.words.begin());
  if (!header.words.empty() && header.words[0] == "BINARY")
    text.fail("binary OFF is not read; save as text, or as binary PLY");
  return header;
}

/// Reads the normal and the colour behind a vertex's coordinates, in this order, as far as they are there.
void add_attributes(const TextReader& text, const OffHeader& header, const std::vector<std::string_view>& line,
                    MeshAttributes& attributes) {
  std::size_t at = 3;
  if (header.has_normals && line.size() >= at + 3) {
    attributes.normals.values.push_back(text.point(line, at));
    at += 3;
  }
  if (!header.has_colours || line.size() < at + 3) return;
  Colour colour = Colour::Ones();
  const std::size_t count = std::min<std::size_t>(4, line.size() - at - (header.has_texture ? 2 : 0));
  for (std::size_t i = 0; i < count; ++i)
    colour[static_cast<int>(i)] = static_cast<float>(text.coordinate(line[at + i]));
  attributes.colours.values.push_back(colour);
}

/// Colours are numbers from 0 to 1, or whole numbers up to 255. Where a vertex lacks its own, none count.
void complete_attributes(std::size_t vertices, MeshAttributes& attributes) {
  if (attributes.normals.values.size() != vertices) attributes.normals.values.clear();
  std::vector<Colour>& colours = attributes.colours.values;
  if (colours.size() != vertices) colours.clear();
  const bool has_bytes =
      std::any_of(colours.begin(), colours.end(), [](const Colour& c) { return c.head<3>().maxCoeff() > 1; });
  for (Colour& colour : colours) {
    if (has_bytes)
      colour = colour[3] == 1 ? Colour(colour[0] / 255, colour[1] / 255, colour[2] / 255, 1) : Colour(colour / 255);
    for (int i = 0; i < 3; ++i) colour[i] = linear_from_srgb(colour[i]);
  }
}

}  // namespace

MeshFile read_off(std::string_view bytes, const std::string& where) {
  TextReader text(bytes, where);
  const OffHeader header = read_off_header(text, where);
  std::vector<std::string_view> words = header.words;
  if (words.empty()) words = text.next_words('#');
  if (words.size() < 2) text.fail("the numbers of vertices and faces are expected");
  const std::size_t vertices = text.count(words[0], "vertices"), faces = text.count(words[1], "faces");
  MeshBuilder mesh;
  for (std::size_t v = 0; v < vertices; ++v) {
    const auto& line = text.next_words('#');
    if (line.empty()) text.fail(fmt::format("the file ends after {} of {} vertices", v, vertices));
    if (line.size() < 3) text.fail("a line with a vertex's three coordinates is expected");
    mesh.add_vertex(text.point(line, 0));
    add_attributes(text, header, line, mesh.attributes());
  }
  complete_attributes(vertices, mesh.attributes());
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
