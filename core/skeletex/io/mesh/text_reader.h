// SPDX-License-Identifier: MIT
#pragma once
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// Most vertices and faces that a mesh may have.
inline constexpr std::size_t kMostElements = std::numeric_limits<std::int32_t>::max();

/// A word of a file as it may stand in a message.
std::string quoted_word(std::string_view word);
std::string lower_case(std::string_view word);
/// Text without the mark that some programs begin UTF-8 with.
std::string_view without_byte_order_mark(std::string_view text);
/// Whole words as numbers, with or without a plus, whatever the locale. Beyond the range of doubles they are infinite
/// or zero. Nothing: it is no number.
std::optional<double> number_from(std::string_view word);
std::optional<std::int64_t> integer_from(std::string_view word);

/// The lines and words of a text, counted. Lines end in LF, CR LF or CR.
class TextReader {
 public:
  /// \param where  name of the file in messages; it must outlive the reader, as the text must
  TextReader(std::string_view text, const std::string& where)
      : text_(text), where_(where), at_(text.size() - without_byte_order_mark(text).size()) {}

  /// \throw IoError with file and line
  [[noreturn]] void fail(const std::string& what) const;
  bool at_end() const { return at_ >= text_.size(); }
  std::size_t position() const { return at_; }
  std::size_t line_number() const { return line_; }

  /// The next line; empty at the end, too. Its number is what fail() names until the next call.
  std::string_view next_line();
  /// The words of the next line that has any, without comments from `comment` on; none at the end of the text.
  const std::vector<std::string_view>& next_words(char comment);
  /// The next word wherever it stands; empty at the end.
  std::string_view next_word();
  /// The words of a line. Valid until the next call that returns words.
  const std::vector<std::string_view>& split(std::string_view line, char comment);

  /// \throw IoError unless the word is one
  double coordinate(std::string_view word) const;
  /// The point of three words, from the one at `first` on.
  Vec3 point(const std::vector<std::string_view>& words, std::size_t first) const;
  std::size_t count(std::string_view word, const char* what) const;
  int index(std::string_view word, std::size_t vertices) const;

 private:
  std::string_view text_;
  const std::string& where_;
  std::size_t at_ = 0, line_ = 1, pending_ = 0;
  std::vector<std::string_view> words_;
};

}  // namespace skeletex
