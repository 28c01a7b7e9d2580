// SPDX-License-Identifier: MIT
#pragma once
#include <cstdint>
#include <string>
#include <string_view>

namespace skeletex {

/// What is wrong with bytes that are too few.
inline constexpr const char* kEndsTooEarly = "it ends too early";

/// Appends numbers to bytes: whole numbers in groups of 7 bits, the lowest first; signed ones as 0, -1, 1, -2, ...
class ByteWriter {
 public:
  void byte(int value) { bytes_.push_back(static_cast<char>(value)); }
  void count(std::uint64_t value);
  void number(std::int64_t value);
  /// Of a residual: a byte where that suffices.
  void residual(int value);
  /// 8 bytes, least significant first.
  void real(double value);
  void text(std::string_view value);
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

/// Reads them again.
class ByteReader {
 public:
  /// \param bytes  must outlive this
  explicit ByteReader(std::string_view bytes) : bytes_(bytes) {}
  /// \throw IoError at the end of the bytes, and where a number is larger than `most`
  int byte();
  std::uint64_t count(std::uint64_t most);
  std::int64_t number(std::int64_t most);
  int residual();
  double real();
  std::string text(std::size_t most);
  bool is_at_end() const { return at_ == bytes_.size(); }
  std::size_t left() const { return bytes_.size() - at_; }

 private:
  std::string_view bytes_;
  std::size_t at_ = 0;
};

/// LZMA with the settings that make these bytes smallest.
/// \return a byte with the settings, and the compressed bytes
std::string compress(std::string_view bytes);
/// \param size       of the result
/// \param is_prefix  whether the end may be missing; the result is then shorter
/// \throw IoError when the bytes are damaged
std::string decompress(std::string_view compressed, std::size_t size, bool is_prefix);

}  // namespace skeletex
