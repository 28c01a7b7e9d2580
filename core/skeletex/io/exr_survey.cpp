// SPDX-License-Identifier: MIT
#include "skeletex/io/exr_survey.h"

#include <fmt/format.h>

#include <bit>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <optional>
#include <string_view>

#include "skeletex/model/error.h"

namespace skeletex {
namespace {

constexpr int kMaxChannels = 2048;  // the three of a model, and a weight per bone
constexpr std::size_t kMaxParts = 32;
constexpr std::string_view kScanlines = "scanlineimage";
constexpr std::uintmax_t kMaxAttributeBytes = std::uintmax_t{1} << 30;

class Reader {
 public:
  explicit Reader(const std::filesystem::path& path) : where_(path.string()), file_(nullptr, std::fclose) {
    std::error_code error;
    if (std::filesystem::is_directory(path, error)) throw IoError(where_ + " is a folder, not a file");
    file_.reset(std::fopen(path.c_str(), "rb"));
    if (!file_) throw IoError(fmt::format("{}: cannot open: {}", where_, std::strerror(errno)));
    size_ = std::filesystem::file_size(path, error);
    if (error) throw IoError(fmt::format("{}: not a regular file", where_));
  }

  std::uint64_t size() const { return size_; }
  std::uint64_t position() const { return position_; }
  void seek(std::uint64_t position) {
    position_ = position;
    if (std::fseek(file_.get(), static_cast<long>(position), SEEK_SET) != 0) truncated();
  }
  std::string bytes(std::uint64_t count) {
    if (position_ > size_ || count > size_ - position_) truncated();
    std::string result(count, '\0');
    if (std::fread(result.data(), 1, count, file_.get()) != count) truncated();
    position_ += count;
    return result;
  }
  template <typename T>
  T number() {
    static_assert(std::endian::native == std::endian::little);
    T value;
    std::memcpy(&value, bytes(sizeof value).data(), sizeof value);
    return value;
  }
  /// A name in the header, which a zero byte ends.
  std::string name() {
    std::string result;
    for (char c; (c = bytes(1)[0]) != '\0'; result += c)
      if (result.size() == 255) fail("the header is damaged (a name without end)");
    return result;
  }
  [[noreturn]] void fail(const std::string& what) const { throw IoError(fmt::format("{}: {}", where_, what)); }
  [[noreturn]] void truncated() const {
    fail(fmt::format("the file ends early, after {} bytes; it was not copied or written completely", size_));
  }

 private:
  std::string where_;
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_;
  std::uint64_t size_ = 0, position_ = 0;
};

/// Rows that are compressed together; 0 for lossy and unknown kinds.
int rows_per_chunk(unsigned char compression) {
  switch (compression) {
    case 0:  // none
    case 1:  // RLE
    case 2:  // ZIPS
      return 1;
    case 3:  // ZIP
      return 16;
    case 4:  // PIZ
      return 32;
    default: return 0;
  }
}

/// The attributes of one header, up to the empty name that ends it.
ExrSurvey read_header(Reader& in) {
  ExrSurvey survey;
  for (std::string name; !(name = in.name()).empty();) {
    ExrSurvey::Attribute attribute{in.name(), {}};
    const auto size = in.number<std::int32_t>();
    if (size < 0 || static_cast<std::uintmax_t>(size) > kMaxAttributeBytes)
      in.fail(fmt::format("the header is damaged (attribute \"{}\" of {} bytes)", name, size));
    attribute.value = in.bytes(static_cast<std::uint64_t>(size));
    survey.attributes[name] = std::move(attribute);
  }
  return survey;
}

void check_preview(const Reader& in, const std::string& value) {
  std::uint32_t size[2] = {0, 0};
  if (value.size() >= 8) std::memcpy(size, value.data(), 8);
  if (size[0] > 4096 || size[1] > 4096 || value.size() != 8 + std::size_t{4} * size[0] * size[1])
    in.fail("the header is damaged (preview image)");
}

void check_channels(const Reader& in, const std::string& value) {
  int channels = 0;
  for (std::size_t at = 0; at < value.size() && value[at] != '\0'; ++channels) {
    const std::size_t end = value.find('\0', at);
    if (end == std::string::npos || value.size() - end < 17) in.fail("the header is damaged (channels)");
    std::int32_t numbers[4];  // type, two of no meaning here, steps in x and y
    std::memcpy(numbers, value.data() + end + 1, sizeof numbers);
    if (numbers[0] < 0 || numbers[0] > 2 || numbers[2] != 1 || numbers[3] != 1)
      in.fail(fmt::format("channel \"{}\" is not in full resolution, or of an unknown type",
                          printable(value.substr(at, end - at))));
    at = end + 17;
  }
  if (channels > kMaxChannels)
    in.fail(fmt::format("an image of {} channels; a model has at most {}", channels, kMaxChannels));
}

/// OpenEXR allocates by these two kinds of attribute before it looks at what follows.
void check_allocations(const Reader& in, const ExrSurvey& survey) {
  for (const auto& [name, attribute] : survey.attributes) {
    if (attribute.type == "preview") check_preview(in, attribute.value);
    if (attribute.type == "chlist") check_channels(in, attribute.value);
  }
}

/// Checks the attributes and takes the size from them.
/// \return rows per chunk
int check_header(const Reader& in, int max_size, bool is_one_of_several, ExrSurvey& survey) {
  check_allocations(in, survey);
  const auto required = [&](const char* name, const char* type, std::size_t size) -> const std::string& {
    const auto found = survey.attributes.find(name);
    if (found == survey.attributes.end() || found->second.type != type || found->second.value.size() != size)
      in.fail(fmt::format("the header is damaged (no \"{}\")", name));
    return found->second.value;
  };
  std::int32_t window[4];
  std::memcpy(window, required("dataWindow", "box2i", sizeof window).data(), sizeof window);
  const std::int64_t width = std::int64_t{window[2]} - window[0] + 1, height = std::int64_t{window[3]} - window[1] + 1;
  if (width < 1 || height < 1 || width > max_size || height > max_size)
    in.fail(fmt::format("an image of {} x {} texels; models have sides from 1 to {}", width, height, max_size));
  if (window[0] != 0 || window[1] != 0)
    in.fail("the image does not begin at (0, 0); it was cropped or moved by another program");
  survey.width = static_cast<int>(width);
  survey.height = static_cast<int>(height);
  const int rows = rows_per_chunk(static_cast<unsigned char>(required("compression", "compression", 1)[0]));
  if (rows == 0) in.fail("the image is compressed with a lossy method; save it with ZIP or PIZ");
  if (is_one_of_several) {
    if (required("type", "string", kScanlines.size()) != kScanlines)
      in.fail("a part of the file is tiled or deep; the levels of a model are scanline images");
    std::int32_t chunks;
    std::memcpy(&chunks, required("chunkCount", "int", sizeof chunks).data(), sizeof chunks);
    if (chunks != (height + rows - 1) / rows)
      in.fail(fmt::format("the header is damaged ({} chunks for {} rows)", chunks, height));
  }
  return rows;
}

/// A line of the offset table: whether the chunk at `offset` is that of the row.
void check_chunk(Reader& in, std::uint64_t offset, std::uint64_t begin, std::size_t row, std::optional<int> part) {
  const auto missing = [&] {
    in.fail(fmt::format(
        "the file ends early: texel rows from {} on are missing; it was not copied or written completely", row));
  };
  if (offset == 0 || offset > in.size()) missing();
  if (offset < begin) in.fail(fmt::format("damaged (the texel rows from {} on lie inside the header)", row));
  if (in.size() - offset < (part ? 12 : 8)) missing();
  in.seek(offset);
  if (part && in.number<std::int32_t>() != *part)
    in.fail(fmt::format("damaged (at texel row {} of part {})", row, *part));
  const auto y = in.number<std::int32_t>();
  const auto bytes = in.number<std::int32_t>();
  if (y != static_cast<std::int64_t>(row) || bytes < 0) in.fail(fmt::format("damaged (at texel row {})", row));
  if (static_cast<std::uint64_t>(bytes) > in.size() - in.position()) missing();
}

}  // namespace

std::vector<ExrSurvey> survey_exr(const std::filesystem::path& path, int max_size) {
  constexpr std::uint32_t kLongNames = 0x400, kSeveralParts = 0x1000;
  Reader in(path);
  constexpr std::string_view kMagic("\x76\x2f\x31\x01", 4);
  if (in.size() < 8 || in.bytes(4) != kMagic)
    in.fail("not an OpenEXR file, which a model is (.skx.exr); `skeletex encode` makes one of a mesh");
  const auto version = in.number<std::uint32_t>();
  if ((version & 0xff) != 2 || (version & ~(0xffu | kLongNames | kSeveralParts)) != 0)
    in.fail("a tiled or deep OpenEXR file; a model is a scanline image");
  const bool has_several = (version & kSeveralParts) != 0;

  std::vector<ExrSurvey> parts;
  std::vector<int> rows;
  do {
    ExrSurvey part = read_header(in);
    if (has_several && part.attributes.empty()) break;
    if (parts.size() == kMaxParts) in.fail(fmt::format("more than {} parts; a model has a few levels", kMaxParts));
    rows.push_back(check_header(in, max_size, has_several, part));
    parts.push_back(std::move(part));
  } while (has_several);
  if (parts.empty()) in.fail("the header is damaged (no parts)");

  std::vector<std::string> tables;
  for (std::size_t part = 0; part < parts.size(); ++part)
    tables.push_back(in.bytes(static_cast<std::uint64_t>((parts[part].height + rows[part] - 1) / rows[part]) * 8));
  const std::uint64_t begin = in.position();
  for (std::size_t part = 0; part < parts.size(); ++part)
    for (std::size_t i = 0; i < tables[part].size() / 8; ++i) {
      std::uint64_t offset;
      std::memcpy(&offset, tables[part].data() + 8 * i, 8);
      check_chunk(in, offset, begin, i * static_cast<std::size_t>(rows[part]),
                  has_several ? std::optional(static_cast<int>(part)) : std::nullopt);
    }
  return parts;
}

}  // namespace skeletex
