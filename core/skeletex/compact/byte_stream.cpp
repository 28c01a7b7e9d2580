// SPDX-License-Identifier: MIT
#include "skeletex/compact/byte_stream.h"

#include <lzma.h>

#include <bit>

#include "skeletex/model/error.h"

namespace skeletex {
namespace {

/// Symbols of residuals: 0, -1, 1, -2, ...
constexpr std::uint64_t zigzag(std::int64_t value) {
  return (static_cast<std::uint64_t>(value) << 1) ^ static_cast<std::uint64_t>(value >> 63);
}
constexpr std::int64_t unzigzag(std::uint64_t value) {
  return static_cast<std::int64_t>(value >> 1) ^ -static_cast<std::int64_t>(value & 1);
}

/// LZMA looks at the highest bits of the byte before; the bits that tell small residuals apart go there.
int reversed(int byte) {
  int result = 0;
  for (int bit = 0; bit < 8; ++bit) result |= (byte >> bit & 1) << (7 - bit);
  return result;
}

constexpr std::uint32_t kDictionary = 1u << 24;

/// The decoder of a stream with literal context bits, literal position bits and position bits in a byte.
lzma_options_lzma options_of(int settings) {
  lzma_options_lzma options{};
  lzma_lzma_preset(&options, 9 | LZMA_PRESET_EXTREME);
  options.dict_size = kDictionary;
  options.lc = settings % 5;
  options.lp = settings / 5 % 5;
  options.pb = settings / 25;
  return options;
}

std::string compress_with(std::string_view bytes, int settings) {
  lzma_options_lzma options = options_of(settings);
  options.nice_len = 273;
  options.dict_size = 1u << 20;
  const lzma_filter filters[] = {{LZMA_FILTER_LZMA1, &options}, {LZMA_VLI_UNKNOWN, nullptr}};
  std::string out(bytes.size() + bytes.size() / 2 + 1024, '\0');
  std::size_t size = 0;
  if (lzma_raw_buffer_encode(filters, nullptr, reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size(),
                             reinterpret_cast<std::uint8_t*>(out.data()), &size, out.size()) != LZMA_OK)
    throw IoError("LZMA cannot compress the model: out of memory");
  out.resize(size);
  return out;
}

}  // namespace

void ByteWriter::count(std::uint64_t value) {
  for (; value >= 128; value >>= 7) byte(static_cast<int>(value & 127) | 128);
  byte(static_cast<int>(value));
}
void ByteWriter::number(std::int64_t value) { count(zigzag(value)); }
void ByteWriter::residual(int value) {
  const std::uint64_t symbol = zigzag(value);
  if (symbol < 255) {
    byte(reversed(static_cast<int>(symbol)));
  } else {
    byte(255);
    count(symbol - 255);
  }
}
void ByteWriter::real(double value) {
  const auto bits = std::bit_cast<std::uint64_t>(value);
  for (int i = 0; i < 8; ++i) byte(static_cast<int>(bits >> (8 * i) & 255));
}
void ByteWriter::text(std::string_view value) {
  count(value.size());
  bytes_.append(value);
}

int ByteReader::byte() {
  if (at_ >= bytes_.size()) throw IoError(kEndsTooEarly);
  return static_cast<unsigned char>(bytes_[at_++]);
}
std::uint64_t ByteReader::count(std::uint64_t most) {
  std::uint64_t value = 0;
  for (int shift = 0;; shift += 7) {
    const int part = byte();
    if (shift > 56) throw IoError("a number is too large");
    value |= static_cast<std::uint64_t>(part & 127) << shift;
    if (part < 128) break;
  }
  if (value > most) throw IoError("a number is too large");
  return value;
}
std::int64_t ByteReader::number(std::int64_t most) { return unzigzag(count(2 * static_cast<std::uint64_t>(most))); }
int ByteReader::residual() {
  const int symbol = byte();
  constexpr std::uint64_t kMost = 1u << 24;
  return static_cast<int>(unzigzag(symbol < 255 ? static_cast<std::uint64_t>(reversed(symbol)) : 255 + count(kMost)));
}
double ByteReader::real() {
  std::uint64_t bits = 0;
  for (int i = 0; i < 8; ++i) bits |= static_cast<std::uint64_t>(byte()) << (8 * i);
  return std::bit_cast<double>(bits);
}
std::string ByteReader::text(std::size_t most) {
  const std::size_t size = count(most);
  if (size > left()) throw IoError(kEndsTooEarly);
  at_ += size;
  return std::string(bytes_.substr(at_ - size, size));
}

std::string compress(std::string_view bytes) {
  std::string best;
  for (int lc = 0; lc <= 4; ++lc) {  // lp and pb are 0: the bytes do not come in groups
    std::string packed = static_cast<char>(lc) + compress_with(bytes, lc);
    if (!best.empty() && packed.size() >= best.size()) break;  // more bits are worse still
    best = std::move(packed);
  }
  return best;
}

std::string decompress(std::string_view compressed, std::size_t size, bool is_prefix) {
  if (compressed.empty()) throw IoError(kEndsTooEarly);
  const int settings = static_cast<unsigned char>(compressed[0]);
  if (settings % 5 + settings / 5 % 5 > 4 || settings / 25 > 4) throw IoError("its settings of LZMA do not exist");
  lzma_options_lzma options = options_of(settings);
  const lzma_filter filters[] = {{LZMA_FILTER_LZMA1, &options}, {LZMA_VLI_UNKNOWN, nullptr}};
  lzma_stream stream = LZMA_STREAM_INIT;
  if (lzma_raw_decoder(&stream, filters) != LZMA_OK) throw IoError("LZMA has not enough memory");
  std::string bytes(size, '\0');
  stream.next_in = reinterpret_cast<const std::uint8_t*>(compressed.data() + 1);
  stream.avail_in = compressed.size() - 1;
  stream.next_out = reinterpret_cast<std::uint8_t*>(bytes.data());
  stream.avail_out = size;
  lzma_ret state = LZMA_OK;
  while (state == LZMA_OK && (stream.avail_in > 0 || stream.avail_out > 0)) {
    const std::size_t before = stream.avail_in + stream.avail_out;
    state = lzma_code(&stream, LZMA_RUN);
    if (state == LZMA_OK && stream.avail_in + stream.avail_out == before) break;
  }
  bytes.resize(size - stream.avail_out);
  const bool is_whole = state == LZMA_STREAM_END && stream.avail_in == 0;
  lzma_end(&stream);
  if (!is_prefix && (!is_whole || bytes.size() != size)) throw IoError("its compressed part is damaged");
  return bytes;
}

}  // namespace skeletex
