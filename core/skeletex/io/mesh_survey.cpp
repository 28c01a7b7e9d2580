// SPDX-License-Identifier: MIT
#include "skeletex/io/mesh_survey.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <optional>

#include "skeletex/model/error.h"

namespace skeletex {
namespace {

constexpr std::size_t kMaxCount = std::numeric_limits<std::int32_t>::max();

/// A word of the file as it may stand in a message.
std::string quoted(std::string_view word) {
  std::string text;
  for (const char c : word.substr(0, 30)) text += c >= 32 && c < 127 ? c : '?';
  return '"' + text + (word.size() > 30 ? "...\"" : "\"");
}

std::string_view without_plus(std::string_view word) {
  return word.size() > 1 && word[0] == '+' && word[1] != '-' ? word.substr(1) : word;
}

std::optional<double> number_from(std::string_view word) {
  word = without_plus(word);
  double value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (end != word.data() + word.size() || word.empty() || error == std::errc::invalid_argument) return std::nullopt;
  // Beyond the range of doubles: infinity or zero, as strtod says.
  if (error == std::errc::result_out_of_range) return std::strtod(std::string(word).c_str(), nullptr);
  return value;
}

std::optional<std::int64_t> integer_from(std::string_view word) {
  word = without_plus(word);
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size()) return std::nullopt;
  return value;
}

bool is_space(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n' || c == '\v' || c == '\f'; }

/// The lines and words of a text, counted. Lines end in LF, CR LF or CR.
class Text {
 public:
  Text(std::string_view text, const std::string& where) : text_(text), where_(where) {}

  [[noreturn]] void fail(const std::string& what) const {
    throw IoError(fmt::format("{}: line {}: {}", where_, line_, what));
  }
  bool at_end() const { return at_ >= text_.size(); }
  std::size_t position() const { return at_; }
  const std::string& where() const { return where_; }

  /// The next line; empty at the end, too. Its number is what fail() names until the next call.
  std::string_view next_line() {
    line_ += pending_;
    const std::size_t end = std::min(text_.find_first_of("\r\n", at_), text_.size());
    const std::string_view line = text_.substr(at_, end - at_);
    at_ = end;
    pending_ = 0;
    if (at_ < text_.size()) {
      pending_ = 1;
      at_ += text_[at_] == '\r' && at_ + 1 < text_.size() && text_[at_ + 1] == '\n' ? 2 : 1;
    }
    return line;
  }
  /// The words of the next line that has any, without comments from `comment` on; none at the end of the text.
  const std::vector<std::string_view>& next_words(char comment) {
    do {
      split(next_line(), comment);
    } while (words_.empty() && !at_end());
    return words_;
  }
  /// The next word wherever it stands; empty at the end.
  std::string_view next_word() {
    line_ += pending_;
    pending_ = 0;
    while (at_ < text_.size() && is_space(text_[at_])) {
      const bool is_end =
          text_[at_] == '\n' || (text_[at_] == '\r' && (at_ + 1 == text_.size() || text_[at_ + 1] != '\n'));
      line_ += is_end ? 1 : 0;
      ++at_;
    }
    const std::size_t begin = at_;
    while (at_ < text_.size() && !is_space(text_[at_])) ++at_;
    return text_.substr(begin, at_ - begin);
  }
  const std::vector<std::string_view>& split(std::string_view line, char comment) {
    words_.clear();
    line = line.substr(0, line.find(comment));
    for (std::size_t i = 0; i < line.size();) {
      while (i < line.size() && is_space(line[i])) ++i;
      const std::size_t begin = i;
      while (i < line.size() && !is_space(line[i])) ++i;
      if (i > begin) words_.push_back(line.substr(begin, i - begin));
    }
    return words_;
  }

 private:
  std::string_view text_;
  const std::string& where_;
  std::size_t at_ = 0, line_ = 1, pending_ = 0;
  std::vector<std::string_view> words_;
};

/// Appends a coordinate of the vertex that survey.vertices counts to, as OpenMesh can read it.
void append_coordinate(MeshSurvey& survey, int axis, std::string_view word, const Text& text) {
  const std::optional<double> value = number_from(word);
  if (!value) text.fail(fmt::format("a coordinate is expected, found {}", quoted(word)));
  if (std::isfinite(static_cast<float>(*value))) {
    survey.plain += without_plus(word);
  } else {
    survey.odd_coordinates.push_back({survey.vertices, axis, *value});
    survey.plain += '0';
  }
  survey.plain += axis < 2 ? ' ' : '\n';
}

std::size_t count_from(std::string_view word, const char* what, const Text& text) {
  const std::optional<std::int64_t> count = integer_from(word);
  if (!count || *count < 0) text.fail(fmt::format("the number of {} is expected, found {}", what, quoted(word)));
  if (static_cast<std::size_t>(*count) > kMaxCount)
    text.fail(fmt::format("{} {} are more than can be read ({})", *count, what, kMaxCount));
  return static_cast<std::size_t>(*count);
}

void check_index(std::string_view word, std::size_t vertices, const Text& text) {
  const std::optional<std::int64_t> index = integer_from(word);
  if (!index) text.fail(fmt::format("the index of a vertex is expected, found {}", quoted(word)));
  if (*index < 0 || static_cast<std::size_t>(*index) >= vertices)
    text.fail(fmt::format("vertex {} does not exist; the file has vertices 0 to {}", *index,
                          static_cast<std::int64_t>(vertices) - 1));
}

MeshSurvey survey_obj(std::string_view bytes, const std::string& where) {
  MeshSurvey survey;
  survey.format = MeshFormat::kObj;
  Text text(bytes, where);
  std::string joined;
  std::size_t last_vertex = 0;
  std::string last_vertex_message;
  std::vector<std::int64_t> corners, sorted;
  while (!text.at_end()) {
    std::string_view line = text.next_line();
    if (line.ends_with('\\')) {  // goes on in the next line
      joined.clear();
      while (line.ends_with('\\')) {
        joined += line.substr(0, line.size() - 1);
        joined += ' ';
        line = text.next_line();
      }
      joined += line;
      line = joined;
    }
    const std::vector<std::string_view>& words = text.split(line, '#');
    if (words.empty()) continue;
    if (words[0] == "v") {
      if (words.size() < 4) text.fail("a vertex has three coordinates");
      survey.plain += "v ";
      for (int axis = 0; axis < 3; ++axis)
        append_coordinate(survey, axis, words[static_cast<std::size_t>(axis) + 1], text);
      ++survey.vertices;
    } else if (words[0] == "f") {
      survey.plain += 'f';
      corners.clear();
      for (std::size_t i = 1; i < words.size(); ++i) {
        const std::optional<std::int64_t> given = integer_from(words[i].substr(0, words[i].find('/')));
        if (!given || *given == 0)
          text.fail(fmt::format("a vertex index (1, 2, ... or -1, -2, ...) is expected, found {}", quoted(words[i])));
        const std::int64_t index = *given > 0 ? *given : static_cast<std::int64_t>(survey.vertices) + *given + 1;
        if (index < 1)
          text.fail(fmt::format("vertex {} does not exist; {} come before this line", *given, survey.vertices));
        if (static_cast<std::size_t>(index) > kMaxCount) text.fail(fmt::format("vertex {} does not exist", *given));
        if (static_cast<std::size_t>(index) > last_vertex) {
          last_vertex = static_cast<std::size_t>(index);
          if (last_vertex > survey.vertices) {  // it may still come
            try {
              text.fail(fmt::format("vertex {} does not exist", index));
            } catch (const IoError& error) {
              last_vertex_message = error.what();
            }
          }
        }
        survey.plain += fmt::format(" {}", index);
        corners.push_back(index);
      }
      survey.plain += '\n';
      ++survey.faces;
      // OpenMesh leaves out repeated corners and then faces of fewer than three.
      corners.erase(std::unique(corners.begin(), corners.end()), corners.end());
      while (corners.size() > 1 && corners.front() == corners.back()) corners.pop_back();
      sorted = corners;
      std::sort(sorted.begin(), sorted.end());
      const bool has_repeat = std::adjacent_find(sorted.begin(), sorted.end()) != sorted.end();
      if (corners.size() < 3)
        ++survey.small_faces;
      else if (has_repeat)
        text.fail("the face runs through one of its vertices twice; split it into simple polygons");
    }
  }
  if (last_vertex > survey.vertices)
    throw IoError(fmt::format("{}; the file has {}", last_vertex_message, survey.vertices));
  return survey;
}

MeshSurvey survey_off(std::string_view bytes, const std::string& where) {
  MeshSurvey survey;
  survey.format = MeshFormat::kOff;
  Text text(bytes, where);
  std::vector<std::string_view> words = text.next_words('#');
  const std::string_view header = words.empty() ? "" : words[0];
  std::string_view prefix = header;
  if (!prefix.ends_with("OFF")) throw IoError(where + ": not an OFF file: its first word is not OFF");
  prefix.remove_suffix(3);
  for (const std::string_view part : {"ST", "C", "N"})
    if (prefix.starts_with(part)) prefix.remove_prefix(part.size());
  if (!prefix.empty()) text.fail(fmt::format("{} files are not read; OFF, COFF, NOFF and STOFF are", quoted(header)));
  words.erase(words.begin());
  if (!words.empty() && words[0] == "BINARY") text.fail("binary OFF is not read; save as text, or as binary PLY");
  if (words.empty()) words = text.next_words('#');
  if (words.size() < 2) text.fail("the numbers of vertices and faces are expected");
  const std::size_t vertices = count_from(words[0], "vertices", text), faces = count_from(words[1], "faces", text);
  survey.plain = fmt::format("OFF\n{} {} 0\n", vertices, faces);
  for (; survey.vertices < vertices; ++survey.vertices) {
    const auto& line = text.next_words('#');
    if (line.empty()) text.fail(fmt::format("the file ends after {} of {} vertices", survey.vertices, vertices));
    if (line.size() < 3) text.fail("a line with a vertex's three coordinates is expected");
    for (int axis = 0; axis < 3; ++axis) append_coordinate(survey, axis, line[static_cast<std::size_t>(axis)], text);
  }
  for (; survey.faces < faces; ++survey.faces) {
    const auto& line = text.next_words('#');
    if (line.empty()) text.fail(fmt::format("the file ends after {} of {} faces", survey.faces, faces));
    const std::size_t corners = count_from(line[0], "corners", text);
    if (line.size() < corners + 1)
      text.fail(fmt::format("a face of {} corners has only {} on its line", corners, line.size() - 1));
    survey.plain += fmt::format("{}", corners);
    for (std::size_t i = 1; i <= corners; ++i) {
      check_index(line[i], vertices, text);
      survey.plain += ' ';
      survey.plain += without_plus(line[i]);
    }
    survey.plain += '\n';
  }
  return survey;
}

struct PlyType {
  const char* name;  ///< as OpenMesh knows it for lists as well
  int size;
  bool is_float, is_signed;
};
constexpr PlyType kPlyTypes[] = {{"char", 1, false, true},    {"uchar", 1, false, false}, {"short", 2, false, true},
                                 {"ushort", 2, false, false}, {"int", 4, false, true},    {"uint", 4, false, false},
                                 {"float", 4, true, true},    {"double", 8, true, true}};
constexpr std::string_view kPlyAliases[] = {"int8",  "uint8",  "int16",   "uint16",
                                            "int32", "uint32", "float32", "float64"};

const PlyType* ply_type(std::string_view name) {
  for (std::size_t i = 0; i < std::size(kPlyTypes); ++i)
    if (name == kPlyTypes[i].name || name == kPlyAliases[i]) return &kPlyTypes[i];
  return nullptr;
}

struct PlyProperty {
  std::string name;
  const PlyType* type = nullptr;
  const PlyType* count_type = nullptr;  ///< of a list
};
struct PlyElement {
  std::string name;
  std::size_t count = 0;
  std::vector<PlyProperty> properties;
};

/// Where in a PLY file something could not be read: a line of its text, or an element of its binary part.
class PlyReader {
 public:
  PlyReader(std::string_view bytes, const std::string& where) : bytes_(bytes), where_(where), text_(bytes, where) {
    survey_.format = MeshFormat::kPly;
  }

  MeshSurvey run() {
    read_header();
    survey_.plain = fmt::format("ply\nformat {} 1.0\n", format_);
    for (const PlyElement& element : elements_) {
      if (element.name == "vertex")
        survey_.plain += fmt::format("element vertex {}\nproperty {} x\nproperty {} y\nproperty {} z\n", element.count,
                                     coordinates_[0]->name, coordinates_[1]->name, coordinates_[2]->name);
      else if (element.name == "face")
        survey_.plain += fmt::format("element face {}\nproperty list {} {} vertex_indices\n", element.count,
                                     list_count_name_, list_type_->name);
    }
    survey_.plain += "end_header\n";
    for (const PlyElement& element : elements_)
      for (std::size_t i = 0; i < (element.properties.empty() ? 0 : element.count); ++i) {
        if (element.name == "vertex")
          read_vertex(element, i);
        else if (element.name == "face")
          read_face(element, i);
        else
          skip(element, i);
      }
    return std::move(survey_);
  }

 private:
  [[noreturn]] void fail_at(const PlyElement& element, std::size_t i, const std::string& what) const {
    if (is_text_) text_.fail(what);
    throw IoError(fmt::format("{}: {} {} (of {}): {}", where_, element.name, i, element.count, what));
  }
  [[noreturn]] void fail_early(const PlyElement& element, std::size_t i) const {
    fail_at(element, i, fmt::format("the file ends after {} of {} elements \"{}\"", i, element.count, element.name));
  }

  void read_header() {
    if (text_.split(text_.next_line(), '\0') != std::vector<std::string_view>{"ply"} && !bytes_.starts_with("PLY"))
      throw IoError(where_ + ": not a PLY file: its first line is not \"ply\"");
    for (;;) {
      if (text_.at_end() || text_.position() > (1 << 20))
        text_.fail("the header does not end (\"end_header\" is missing)");
      const auto& words = text_.split(text_.next_line(), '\0');
      if (words.empty() || words[0] == "comment" || words[0] == "obj_info") continue;
      if (words[0] == "end_header") break;
      if (words[0] == "format" && words.size() >= 2) {
        format_ = words[1];
        if (format_ != "ascii" && format_ != "binary_little_endian" && format_ != "binary_big_endian")
          text_.fail(fmt::format("the format {} is not known", quoted(words[1])));
      } else if (words[0] == "element" && words.size() >= 3) {
        elements_.push_back({std::string(words[1]), count_from(words[2], "elements", text_), {}});
        if (std::count_if(elements_.begin(), elements_.end(),
                          [&](const PlyElement& e) { return e.name == elements_.back().name; }) > 1)
          text_.fail(fmt::format("the element {} comes twice", quoted(words[1])));
      } else if (words[0] == "property" && !elements_.empty() && words.size() >= (words[1] == "list" ? 5u : 3u)) {
        const bool is_list = words[1] == "list";
        PlyProperty property{std::string(words[is_list ? 4 : 2]), ply_type(words[is_list ? 3 : 1]),
                             is_list ? ply_type(words[2]) : nullptr};
        if (property.type == nullptr || (is_list && (property.count_type == nullptr || property.count_type->is_float)))
          text_.fail(fmt::format("the type of property {} is not known", quoted(property.name)));
        elements_.back().properties.push_back(std::move(property));
      } else {
        text_.fail(fmt::format("\"format\", \"element\", \"property\" or \"end_header\" is expected, found {}",
                               quoted(words[0])));
      }
    }
    if (format_.empty()) text_.fail("the header does not say the format");
    is_text_ = format_ == "ascii";
    is_swapped_ = (format_ == "binary_big_endian") != (std::endian::native == std::endian::big);
    at_ = text_.position();

    const auto vertex =
        std::find_if(elements_.begin(), elements_.end(), [](const PlyElement& e) { return e.name == "vertex"; });
    const auto face =
        std::find_if(elements_.begin(), elements_.end(), [](const PlyElement& e) { return e.name == "face"; });
    if (vertex == elements_.end() || face == elements_.end())
      text_.fail("the file has no element \"vertex\" or no element \"face\"");
    if (face < vertex) text_.fail("faces before vertices are not read");
    for (int axis = 0; axis < 3; ++axis)
      for (const PlyProperty& property : vertex->properties)
        if (property.name.size() == 1 && property.name[0] == "xyz"[axis]) {
          if (property.count_type != nullptr || (!is_text_ && !property.type->is_float))
            text_.fail("vertex coordinates must be float or double");
          if (coordinates_[axis] != nullptr) text_.fail(fmt::format("the property \"{}\" comes twice", property.name));
          coordinates_[axis] = property.type;
        }
    if (std::count(coordinates_.begin(), coordinates_.end(), nullptr) > 0) text_.fail("vertices must have x, y and z");
    for (const PlyProperty& property : face->properties)
      if (property.name == "vertex_indices" || property.name == "vertex_index") {
        if (property.count_type == nullptr || property.type->is_float || list_type_ != nullptr)
          text_.fail("\"vertex_indices\" must be one list of whole numbers");
        list_type_ = property.type;
        // The names that OpenMesh takes; a count is not negative, so the sign does not matter.
        list_count_name_ = property.count_type->size == 1 ? "uchar" : property.count_type->size == 2 ? "uint16" : "int";
      }
    if (list_type_ == nullptr) text_.fail("faces must have a list \"vertex_indices\"");
    survey_.vertices = 0;
    vertices_ = vertex->count;
  }

  /// The next value, as a word of the text or as its bytes.
  std::string_view next(const PlyType& type, const PlyElement& element, std::size_t i) {
    if (is_text_) {
      const std::string_view word = text_.next_word();
      if (word.empty()) fail_early(element, i);
      return word;
    }
    const auto size = static_cast<std::size_t>(type.size);
    if (bytes_.size() - at_ < size) fail_early(element, i);
    at_ += size;
    return bytes_.substr(at_ - size, size);
  }
  std::int64_t integer(std::string_view value, const PlyType& type, const PlyElement& element, std::size_t i) const {
    if (is_text_) {
      const std::optional<std::int64_t> number = integer_from(value);
      if (!number) fail_at(element, i, fmt::format("a whole number is expected, found {}", quoted(value)));
      return *number;
    }
    std::uint64_t bits = 0;
    for (std::size_t k = 0; k < value.size(); ++k)
      bits |= static_cast<std::uint64_t>(static_cast<unsigned char>(value[is_swapped_ ? value.size() - 1 - k : k]))
              << (8 * k);
    if (type.is_signed && (bits >> (8 * value.size() - 1)) != 0) bits |= ~std::uint64_t{0} << (8 * value.size() - 1);
    return static_cast<std::int64_t>(bits);
  }
  void skip(const PlyProperty& property, const PlyElement& element, std::size_t i) {
    if (property.count_type == nullptr) {
      next(*property.type, element, i);
      return;
    }
    const std::int64_t count = integer(next(*property.count_type, element, i), *property.count_type, element, i);
    if (count < 0) fail_at(element, i, "a list of negative length");
    for (std::int64_t k = 0; k < count; ++k) next(*property.type, element, i);
  }
  void skip(const PlyElement& element, std::size_t i) {
    for (const PlyProperty& property : element.properties) skip(property, element, i);
  }

  void read_vertex(const PlyElement& element, std::size_t i) {
    std::array<std::string_view, 3> point;
    for (const PlyProperty& property : element.properties) {
      const std::size_t axis =
          property.name.size() == 1 ? std::string_view("xyz").find(property.name[0]) : std::string_view::npos;
      if (axis < 3)
        point[axis] = next(*property.type, element, i);
      else
        skip(property, element, i);
    }
    for (int axis = 0; axis < 3; ++axis)
      if (is_text_)
        append_coordinate(survey_, axis, point[static_cast<std::size_t>(axis)], text_);
      else
        survey_.plain += point[static_cast<std::size_t>(axis)];
    ++survey_.vertices;
  }

  void read_face(const PlyElement& element, std::size_t i) {
    for (const PlyProperty& property : element.properties) {
      if (property.name != "vertex_indices" && property.name != "vertex_index") {
        skip(property, element, i);
        continue;
      }
      const std::string_view count_value = next(*property.count_type, element, i);
      const std::int64_t count = integer(count_value, *property.count_type, element, i);
      if (count < 0) fail_at(element, i, "a face with a negative number of corners");
      survey_.plain += is_text_ ? without_plus(count_value) : count_value;
      for (std::int64_t k = 0; k < count; ++k) {
        const std::string_view value = next(*property.type, element, i);
        const std::int64_t index = integer(value, *property.type, element, i);
        if (index < 0 || static_cast<std::size_t>(index) >= vertices_)
          fail_at(element, i,
                  fmt::format("vertex {} does not exist; the file has vertices 0 to {}", index,
                              static_cast<std::int64_t>(vertices_) - 1));
        if (is_text_) survey_.plain += ' ';
        survey_.plain += is_text_ ? without_plus(value) : value;
      }
      if (is_text_) survey_.plain += '\n';
    }
    ++survey_.faces;
  }

  std::string_view bytes_;
  const std::string& where_;
  Text text_;
  std::size_t at_ = 0;  ///< in the binary part
  bool is_text_ = false, is_swapped_ = false;
  std::string format_;
  std::vector<PlyElement> elements_;
  std::array<const PlyType*, 3> coordinates_{};
  const PlyType* list_type_ = nullptr;
  std::string list_count_name_;
  std::size_t vertices_ = 0;
  MeshSurvey survey_;
};

std::string lower(std::string_view word) {
  std::string result(word.substr(0, 16));
  std::transform(result.begin(), result.end(), result.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return result;
}

MeshSurvey survey_stl_ascii(std::string_view bytes, const std::string& where) {
  MeshSurvey survey;
  survey.format = MeshFormat::kStlAscii;
  survey.plain = "solid\n";
  Text text(bytes, where);
  const auto expect = [&](std::initializer_list<const char*> words) {
    for (const char* word : words) {
      const std::string_view found = text.next_word();
      if (found.empty())
        text.fail(fmt::format("the file ends in triangle {}, where \"{}\" is expected", survey.faces, word));
      if (lower(found) != word) text.fail(fmt::format("\"{}\" is expected, found {}", word, quoted(found)));
    }
  };
  const auto coordinate = [&](bool is_used) {
    const std::string_view word = text.next_word();
    const std::optional<double> value = number_from(word);
    if (!value)
      text.fail(word.empty() ? fmt::format("the file ends in triangle {}", survey.faces)
                             : fmt::format("a number is expected, found {}", quoted(word)));
    // Normals are not read; programs write NaN for those of slivers.
    if (is_used && !std::isfinite(static_cast<float>(*value)))
      text.fail(fmt::format("the coordinate {} cannot be welded; repair the file", quoted(word)));
    return word;
  };
  while (true) {
    std::string word = lower(text.next_word());
    if (word.empty()) break;
    if (word != "solid") text.fail(fmt::format("\"solid\" is expected, found {}", quoted(word)));
    text.next_line();  // a name, of any words
    while ((word = lower(text.next_word())) == "facet") {
      expect({"normal"});
      for (int i = 0; i < 3; ++i) coordinate(false);
      expect({"outer", "loop"});
      survey.plain += "outer loop\n";
      for (int corner = 0; corner < 3; ++corner) {
        expect({"vertex"});
        survey.plain += "vertex";
        for (int i = 0; i < 3; ++i) {
          survey.plain += ' ';
          survey.plain += without_plus(coordinate(true));
        }
        survey.plain += '\n';
      }
      expect({"endloop", "endfacet"});
      ++survey.faces;
    }
    if (word.empty()) text.fail(fmt::format("the file ends after {} triangles without \"endsolid\"", survey.faces));
    if (word != "endsolid") text.fail(fmt::format("\"facet\" or \"endsolid\" is expected, found {}", quoted(word)));
    text.next_line();
  }
  survey.vertices = 3 * survey.faces;
  return survey;
}

MeshSurvey survey_stl(std::string_view bytes, const std::string& where) {
  constexpr std::size_t kHeader = 84, kTriangle = 50;
  std::uint32_t triangles = 0;
  if (bytes.size() >= kHeader) std::memcpy(&triangles, bytes.data() + 80, 4);
  static_assert(std::endian::native == std::endian::little);
  const std::size_t size = kHeader + kTriangle * triangles;
  // Many binary files begin with "solid", too; what counts is whether the size fits, and then whether it is text.
  const std::string_view start = bytes.substr(0, 1024);
  const std::size_t first = start.find_first_not_of(" \t\r\n");
  const bool is_text = bytes.size() != size && first != std::string_view::npos &&
                       lower(start.substr(first, 5)) == "solid" && start.find('\0') == std::string_view::npos;
  if (is_text) return survey_stl_ascii(bytes, where);
  if (bytes.size() < kHeader)
    throw IoError(fmt::format("{}: not an STL file: {} bytes are fewer than its header has", where, bytes.size()));
  if (bytes.size() < size)
    throw IoError(fmt::format("{}: the file ends after {} of {} triangles, or is no STL file", where,
                              (bytes.size() - kHeader) / kTriangle, triangles));
  MeshSurvey survey;
  survey.format = MeshFormat::kStlBinary;
  survey.faces = triangles;
  survey.vertices = 3 * survey.faces;
  survey.plain = bytes.substr(0, size);
  for (std::size_t i = 0; i < survey.faces; ++i) {
    float corners[9];
    std::memcpy(corners, bytes.data() + kHeader + kTriangle * i + 12, sizeof corners);
    if (!std::all_of(std::begin(corners), std::end(corners), [](float x) { return std::isfinite(x); }))
      throw IoError(fmt::format(
          "{}: triangle {} (of {}) has a coordinate that is no finite number, which cannot be welded; repair the file",
          where, i, triangles));
  }
  return survey;
}

}  // namespace

MeshSurvey survey_mesh(std::string_view bytes, const std::string& extension, const std::string& where) {
  if (bytes.empty()) throw IoError(where + ": the file is empty");
  MeshSurvey survey;
  if (extension == ".obj")
    survey = survey_obj(bytes, where);
  else if (extension == ".off")
    survey = survey_off(bytes, where);
  else if (extension == ".ply")
    survey = PlyReader(bytes, where).run();
  else if (extension == ".stl")
    survey = survey_stl(bytes, where);
  else
    throw IoError(
        fmt::format("{}: meshes are read from .obj, .off, .ply and .stl files, not from \"{}\"", where, extension));
  if (survey.faces == 0)
    throw IoError(where + ": the file has no faces; it is not a mesh, or not what its ending says");
  if (survey.vertices > kMaxCount || survey.faces > kMaxCount) throw IoError(where + ": the mesh is too large");
  return survey;
}

}  // namespace skeletex
