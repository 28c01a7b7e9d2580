// SPDX-License-Identifier: MIT
#include "skeletex/page/pack.h"

#include <zlib.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

#include "skeletex/model/error.h"

namespace skeletex {
namespace {

static_assert(std::endian::native == std::endian::little);

std::string base64(std::span<const unsigned char> bytes) {
  constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) group = group << 8 | (k < count ? bytes[i + k] : 0U);
    for (std::size_t k = 0; k < 4; ++k) text += k <= count ? kDigits[group >> (18 - 6 * k) & 63U] : '=';
  }
  return text;
}

/// One channel of one patch in whole steps, as differences from left + above - above left; small ones of either sign
/// become small numbers.
void append_differences(std::span<const std::uint16_t> steps, int width, std::vector<std::uint16_t>& differences) {
  const auto at = [&](int row, int column) -> int {
    return row < 0 || column < 0 ? 0 : steps[static_cast<std::size_t>(row) * width + column];
  };
  const int height = static_cast<int>(steps.size()) / width;
  for (int row = 0; row < height; ++row)
    for (int column = 0; column < width; ++column) {
      const int guess = row == 0      ? at(row, column - 1)
                        : column == 0 ? at(row - 1, column)
                                      : at(row, column - 1) + at(row - 1, column) - at(row - 1, column - 1);
      const auto difference = static_cast<std::int16_t>(at(row, column) - guess);
      differences.push_back(static_cast<std::uint16_t>(difference < 0 ? -2 * difference - 1 : 2 * difference));
    }
}

}  // namespace

nlohmann::ordered_json PageArrays::add(const char* type, const void* values, std::size_t count, std::size_t size) {
  bytes_.resize((bytes_.size() + 7) / 8 * 8);
  const std::size_t begin = bytes_.size();
  bytes_.resize(begin + count * size);
  if (count > 0) std::memcpy(bytes_.data() + begin, values, count * size);
  return {type, begin, count};
}

nlohmann::ordered_json PageArrays::add(std::span<const float> values) {
  return add("float", values.data(), values.size(), sizeof(float));
}
nlohmann::ordered_json PageArrays::add(std::span<const int> values) {
  return add("int", values.data(), values.size(), sizeof(int));
}
nlohmann::ordered_json PageArrays::add(std::span<const unsigned char> values) {
  return add("byte", values.data(), values.size(), 1);
}

void PageArrays::end_part() { part_ends_.push_back(bytes_.size()); }

std::vector<std::string> PageArrays::texts() const {
  std::vector<std::string> texts;
  std::size_t begin = 0;
  for (const std::size_t end : part_ends_) {
    texts.push_back(compressed_text(std::span(bytes_).subspan(begin, end - begin)));
    begin = end;
  }
  return texts;
}

std::string compressed_text(std::span<const unsigned char> bytes) {
  uLongf size = compressBound(bytes.size());
  std::vector<unsigned char> compressed(size);
  if (compress2(compressed.data(), &size, bytes.data(), bytes.size(), Z_BEST_COMPRESSION) != Z_OK)
    throw Error("zlib cannot compress the page's data; there is too little memory");
  return base64(std::span(compressed).first(size));
}

nlohmann::ordered_json add_steps(PageArrays& arrays, std::span<const float> values, double step,
                                 std::vector<int>& before) {
  const std::size_t count = values.size();
  before.resize(count, 0);
  std::vector<unsigned char> bytes(4 * count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto steps = static_cast<int>(std::clamp(std::round(values[i] / step), -1e9, 1e9));
    const std::int64_t difference = static_cast<std::int64_t>(steps) - before[i];
    const auto code = static_cast<std::uint32_t>(difference < 0 ? -2 * difference - 1 : 2 * difference);
    for (std::size_t k = 0; k < 4; ++k) bytes[k * count + i] = static_cast<unsigned char>(code >> 8 * k & 255U);
    before[i] = steps;
  }
  return {{"step", step}, {"differences", arrays.add(bytes)}};
}

nlohmann::ordered_json add_texels(PageArrays& arrays, const DisplacementTexture& texture,
                                  const std::vector<Patch>& patches, double step) {
  std::vector<std::uint16_t> differences, steps;
  std::vector<float> scales;
  for (const Patch& patch : patches) {
    const Rectangle& r = patch.rectangle;
    const int width = r.width, height = r.height;
    for (const std::vector<float>* plane : {&texture.along, &texture.around, &texture.out}) {
      const auto value = [&](int row, int column) {
        return (*plane)[static_cast<std::size_t>(r.y + row) * texture.width + r.x + column];
      };
      float lowest = std::numeric_limits<float>::max(), highest = std::numeric_limits<float>::lowest();
      for (int row = 0; row < height; ++row)
        for (int column = 0; column < width; ++column) {
          lowest = std::min(lowest, value(row, column));
          highest = std::max(highest, value(row, column));
        }
      const auto own_step = static_cast<float>(std::max((static_cast<double>(highest) - lowest) / 65535, step));
      scales.insert(scales.end(), {lowest, own_step});
      steps.clear();
      for (int row = 0; row < height; ++row)
        for (int column = 0; column < width; ++column)
          steps.push_back(static_cast<std::uint16_t>(
              std::clamp(std::lround((static_cast<double>(value(row, column)) - lowest) / own_step), 0L, 65535L)));
      append_differences(steps, width, differences);
    }
  }
  std::vector<unsigned char> bytes;
  for (const std::uint16_t difference : differences) bytes.push_back(static_cast<unsigned char>(difference & 255U));
  for (const std::uint16_t difference : differences) bytes.push_back(static_cast<unsigned char>(difference >> 8U));
  return {{"texels", arrays.add(bytes)}, {"scales", arrays.add(scales)}};
}

}  // namespace skeletex
