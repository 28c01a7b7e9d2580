// SPDX-License-Identifier: MIT
#include "skeletex/io/mesh/text_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>

#include "skeletex/model/error.h"

namespace skeletex {
namespace {

bool is_space(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n' || c == '\v' || c == '\f'; }

std::string_view without_plus(std::string_view word) {
  return word.size() > 1 && word[0] == '+' && word[1] != '-' ? word.substr(1) : word;
}

/// What a number beyond the range of doubles rounds to.
double beyond_range(std::string_view word) {
  const std::size_t exponent = word.find_first_of("eE");
  const bool is_negative = word.starts_with('-');
  const std::string_view digits = word.substr(is_negative ? 1 : 0);
  const bool is_tiny = exponent == std::string_view::npos ? digits.starts_with("0.") || digits.starts_with('.')
                                                          : word.substr(exponent + 1).starts_with('-');
  const double size = is_tiny ? 0 : std::numeric_limits<double>::infinity();
  return is_negative ? -size : size;
}

}  // namespace

std::string quoted_word(std::string_view word) {
  std::string text;
  for (const char c : word.substr(0, 30)) text += c >= 32 && c < 127 ? c : '?';
  return '"' + text + (word.size() > 30 ? "...\"" : "\"");
}

std::string lower_case(std::string_view word) {
  std::string result(word);
  std::transform(result.begin(), result.end(), result.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return result;
}

std::string_view without_byte_order_mark(std::string_view text) {
  constexpr std::string_view kMark = "\xef\xbb\xbf";
  return text.starts_with(kMark) ? text.substr(kMark.size()) : text;
}

std::optional<double> number_from(std::string_view word) {
  word = without_plus(word);
  double value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (end != word.data() + word.size() || error == std::errc::invalid_argument) return std::nullopt;
  return error == std::errc::result_out_of_range ? beyond_range(word) : value;
}

std::optional<std::int64_t> integer_from(std::string_view word) {
  word = without_plus(word);
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size()) return std::nullopt;
  return value;
}

void TextReader::fail(const std::string& what) const {
  throw IoError(fmt::format("{}: line {}: {}", where_, line_, what));
}

std::string_view TextReader::next_line() {
  line_ += pending_;
  const std::size_t end = std::min(text_.find_first_of("\r\n", at_), text_.size());
  const std::string_view line = text_.substr(at_, end - at_);
  at_ = end;
  pending_ = 0;
  if (at_ < text_.size()) {
    pending_ = 1;
    at_ += text_.substr(at_).starts_with("\r\n") ? 2 : 1;
  }
  return line;
}

const std::vector<std::string_view>& TextReader::next_words(char comment) {
  do {
    split(next_line(), comment);
  } while (words_.empty() && !at_end());
  return words_;
}

std::string_view TextReader::next_word() {
  line_ += pending_;
  pending_ = 0;
  for (; at_ < text_.size() && is_space(text_[at_]); ++at_)
    if (text_[at_] == '\n' || (text_[at_] == '\r' && !text_.substr(at_ + 1).starts_with('\n'))) ++line_;
  const std::size_t begin = at_;
  while (at_ < text_.size() && !is_space(text_[at_])) ++at_;
  return text_.substr(begin, at_ - begin);
}

const std::vector<std::string_view>& TextReader::split(std::string_view line, char comment) {
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

double TextReader::coordinate(std::string_view word) const {
  const std::optional<double> value = number_from(word);
  if (!value) fail(fmt::format("a coordinate is expected, found {}", quoted_word(word)));
  return *value;
}

Vec3 TextReader::point(const std::vector<std::string_view>& words, std::size_t first) const {
  return {coordinate(words[first]), coordinate(words[first + 1]), coordinate(words[first + 2])};
}

std::size_t TextReader::count(std::string_view word, const char* what) const {
  const std::optional<std::int64_t> count = integer_from(word);
  if (!count || *count < 0) fail(fmt::format("the number of {} is expected, found {}", what, quoted_word(word)));
  if (static_cast<std::size_t>(*count) > kMostElements)
    fail(fmt::format("{} {} are more than can be read ({})", *count, what, kMostElements));
  return static_cast<std::size_t>(*count);
}

int TextReader::index(std::string_view word, std::size_t vertices) const {
  const std::optional<std::int64_t> index = integer_from(word);
  if (!index) fail(fmt::format("the index of a vertex is expected, found {}", quoted_word(word)));
  if (*index < 0 || static_cast<std::size_t>(*index) >= vertices)
    fail(fmt::format("vertex {} does not exist; the file has vertices 0 to {}", *index,
                     static_cast<std::int64_t>(vertices) - 1));
  return static_cast<int>(*index);
}

}  // namespace skeletex
