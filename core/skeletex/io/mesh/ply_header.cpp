// SPDX-License-Identifier: MIT
#include "skeletex/io/mesh/ply_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <initializer_list>
#include <utility>

#include "skeletex/model/error.h"

namespace skeletex {
namespace {

constexpr PlyType kTypes[] = {{"char", "int8", 1, false, true},    {"uchar", "uint8", 1, false, false},
                              {"short", "int16", 2, false, true},  {"ushort", "uint16", 2, false, false},
                              {"int", "int32", 4, false, true},    {"uint", "uint32", 4, false, false},
                              {"float", "float32", 4, true, true}, {"double", "float64", 8, true, true}};

const PlyType* type_named(std::string_view name) {
  const auto found = std::find_if(std::begin(kTypes), std::end(kTypes),
                                  [&](const PlyType& t) { return name == t.name || name == t.alias; });
  return found == std::end(kTypes) ? nullptr : found;
}

PlyFormat format_named(std::string_view name, const TextReader& text) {
  if (name == "ascii") return PlyFormat::kText;
  if (name == "binary_little_endian") return PlyFormat::kLittleEndian;
  if (name == "binary_big_endian") return PlyFormat::kBigEndian;
  text.fail(fmt::format("the format {} is not known", quoted_word(name)));
}

void add_element(const std::vector<std::string_view>& words, PlyHeader& header, const TextReader& text) {
  for (const PlyElement& element : header.elements)
    if (element.name == words[1]) text.fail(fmt::format("the element {} comes twice", quoted_word(words[1])));
  header.elements.push_back({std::string(words[1]), text.count(words[2], "elements"), {}});
}

void add_property(const std::vector<std::string_view>& words, PlyElement& element, const TextReader& text) {
  const bool is_list = words[1] == "list";
  PlyProperty property{std::string(words[is_list ? 4 : 2]), type_named(words[is_list ? 3 : 1]),
                       is_list ? type_named(words[2]) : nullptr};
  if (property.type == nullptr || (is_list && (property.count_type == nullptr || property.count_type->is_float)))
    text.fail(fmt::format("the type of property {} is not known", quoted_word(property.name)));
  element.properties.push_back(std::move(property));
}

/// Reads a line of the header.
/// \return false at its end
bool read_header_line(TextReader& text, PlyHeader& header) {
  const auto& words = text.split(text.next_line(), '\0');
  if (!words.empty() && words[0] == "comment" && words.size() >= 3 && words[1] == "TextureFile")
    header.image_file = words[2];
  if (words.empty() || words[0] == "comment" || words[0] == "obj_info") return true;
  if (words[0] == "end_header") return false;
  if (words[0] == "format" && words.size() >= 2)
    header.format = format_named(words[1], text);
  else if (words[0] == "element" && words.size() >= 3)
    add_element(words, header, text);
  else if (words[0] == "property" && !header.elements.empty() && words.size() >= (words[1] == "list" ? 5u : 3u))
    add_property(words, header.elements.back(), text);
  else
    text.fail(fmt::format("\"format\", \"element\", \"property\" or \"end_header\" is expected, found {}",
                          quoted_word(words[0])));
  return true;
}

void find_coordinates(PlyElement& vertex, bool is_text, const TextReader& text) {
  constexpr std::string_view kAxes[] = {"x", "y", "z"};
  constexpr PlyProperty::Use kUses[] = {PlyProperty::Use::kX, PlyProperty::Use::kY, PlyProperty::Use::kZ};
  for (int axis = 0; axis < 3; ++axis) {
    int found = 0;
    for (PlyProperty& property : vertex.properties) {
      if (property.name != kAxes[axis]) continue;
      if (property.count_type != nullptr || (!is_text && !property.type->is_float))
        text.fail("vertex coordinates must be float or double");
      property.use = kUses[axis];
      if (++found > 1) text.fail(fmt::format("the property \"{}\" comes twice", property.name));
    }
    if (found == 0) text.fail("vertices must have x, y and z");
  }
}

/// What a vertex has beside its coordinates. A property whose name comes twice counts once.
void find_attributes(PlyElement& vertex) {
  using Use = PlyProperty::Use;
  constexpr std::pair<std::string_view, Use> kNames[] = {{"nx", Use::kNormalX},
                                                         {"ny", Use::kNormalY},
                                                         {"nz", Use::kNormalZ},
                                                         {"red", Use::kRed},
                                                         {"green", Use::kGreen},
                                                         {"blue", Use::kBlue},
                                                         {"alpha", Use::kAlpha},
                                                         {"diffuse_red", Use::kRed},
                                                         {"r", Use::kRed},
                                                         {"g", Use::kGreen},
                                                         {"b", Use::kBlue},
                                                         {"a", Use::kAlpha},
                                                         {"diffuse_green", Use::kGreen},
                                                         {"diffuse_blue", Use::kBlue},
                                                         {"s", Use::kTextureU},
                                                         {"t", Use::kTextureV},
                                                         {"u", Use::kTextureU},
                                                         {"v", Use::kTextureV},
                                                         {"texture_u", Use::kTextureU},
                                                         {"texture_v", Use::kTextureV}};
  const auto has = [&](std::initializer_list<Use> uses) {
    return std::all_of(uses.begin(), uses.end(), [&](Use use) {
      return std::any_of(vertex.properties.begin(), vertex.properties.end(),
                         [use](const PlyProperty& p) { return p.use == use; });
    });
  };
  for (PlyProperty& property : vertex.properties) {
    if (property.use || property.count_type != nullptr) continue;
    const auto named = std::find_if(std::begin(kNames), std::end(kNames),
                                    [&](const auto& known) { return known.first == property.name; });
    property.use = named == std::end(kNames) || has({named->second}) ? Use::kNumber : named->second;
  }
  // A part of a colour or of a normal is a number like others.
  const auto drop_unless_whole = [&](std::initializer_list<Use> whole, std::initializer_list<Use> with) {
    if (has(whole)) return;
    for (PlyProperty& property : vertex.properties)
      for (const Use use : with)
        if (property.use == use) property.use = Use::kNumber;
  };
  drop_unless_whole({Use::kNormalX, Use::kNormalY, Use::kNormalZ}, {Use::kNormalX, Use::kNormalY, Use::kNormalZ});
  drop_unless_whole({Use::kRed, Use::kGreen, Use::kBlue}, {Use::kRed, Use::kGreen, Use::kBlue, Use::kAlpha});
  drop_unless_whole({Use::kTextureU, Use::kTextureV}, {Use::kTextureU, Use::kTextureV});
}

void find_corners(PlyElement& face, const TextReader& text) {
  int found = 0;
  for (PlyProperty& property : face.properties) {
    if (property.name != "vertex_indices" && property.name != "vertex_index") continue;
    if (property.count_type == nullptr || property.type->is_float || ++found > 1)
      text.fail("\"vertex_indices\" must be one list of whole numbers");
    property.use = PlyProperty::Use::kCorners;
  }
  if (found == 0) text.fail("faces must have a list \"vertex_indices\"");
  const auto texture = std::find_if(face.properties.begin(), face.properties.end(), [](const PlyProperty& p) {
    return p.name == "texcoord" && p.count_type != nullptr && p.type->is_float;
  });
  if (texture != face.properties.end()) texture->use = PlyProperty::Use::kTextureCoordinates;
}

}  // namespace

PlyHeader read_ply_header(TextReader& text, const std::string& where) {
  constexpr std::size_t kLongest = 1 << 20;
  const auto& first = text.split(text.next_line(), '\0');
  if (first.size() != 1 || lower_case(first[0].substr(0, 3)) != "ply" || first[0].size() > 3)
    throw IoError(where + ": not a PLY file: its first line is not \"ply\"");
  PlyHeader header;
  do {
    if (text.at_end() || text.position() > kLongest) text.fail("the header does not end (\"end_header\" is missing)");
  } while (read_header_line(text, header));
  if (header.format == PlyFormat::kNone) text.fail("the header does not say the format");
  const auto named = [&](const char* name) {
    return std::find_if(header.elements.begin(), header.elements.end(),
                        [&](const PlyElement& e) { return e.name == name; });
  };
  const auto vertex = named("vertex"), face = named("face");
  if (vertex == header.elements.end() || face == header.elements.end())
    text.fail("the file has no element \"vertex\" or no element \"face\"");
  if (face < vertex) text.fail("faces before vertices are not read");
  find_coordinates(*vertex, header.format == PlyFormat::kText, text);
  find_attributes(*vertex);
  find_corners(*face, text);
  header.vertices = vertex->count;
  return header;
}

}  // namespace skeletex
