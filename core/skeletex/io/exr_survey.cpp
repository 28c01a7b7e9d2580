// SPDX-License-Identifier: MIT
#include "skeletex/io/exr_survey.h"

#include <fmt/format.h>

#include <bit>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>

#include "skeletex/model/error.h"

namespace skeletex {
namespace {

constexpr int kMaxChannels = 16;
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
  [[noreturn]] void truncated() const { fail(fmt::format("the file ends early, after {} bytes; it was not copied or written completely", size_)); }

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
    default:
      return 0;
  }
}

}  // namespace

ExrSurvey survey_exr(const std::filesystem::path& path, int max_size, bool is_header_only) {
  Reader in(path);
  constexpr std::string_view kMagic("\x76\x2f\x31\x01", 4);
  if (in.size() < 8 || in.bytes(4) != kMagic) in.fail("not an OpenEXR file, which a model is (.skx.exr)");
  const auto version = in.number<std::uint32_t>();
  if ((version & 0xff) != 2 || (version & ~0x4ffu) != 0) in.fail("a tiled, deep or multi-part OpenEXR file; a model is a single scanline image");

  ExrSurvey survey;
  for (std::string name; !(name = in.name()).empty();) {
    ExrSurvey::Attribute attribute{in.name(), {}};
    const auto size = in.number<std::int32_t>();
    if (size < 0 || static_cast<std::uintmax_t>(size) > kMaxAttributeBytes) in.fail(fmt::format("the header is damaged (attribute \"{}\" of {} bytes)", name, size));
    attribute.value = in.bytes(static_cast<std::uint64_t>(size));
    survey.attributes[name] = std::move(attribute);
  }
  const auto required = [&](const char* name, const char* type, std::size_t size) -> const std::string& {
    const auto found = survey.attributes.find(name);
    if (found == survey.attributes.end() || found->second.type != type || found->second.value.size() != size) in.fail(fmt::format("the header is damaged (no \"{}\")", name));
    return found->second.value;
  };
  // OpenEXR allocates by these two kinds of attribute before it looks at what follows.
  for (const auto& [name, attribute] : survey.attributes) {
    const std::string& value = attribute.value;
    if (attribute.type == "preview") {
      std::uint32_t size[2] = {0, 0};
      if (value.size() >= 8) std::memcpy(size, value.data(), 8);
      if (size[0] > 4096 || size[1] > 4096 || value.size() != 8 + std::size_t{4} * size[0] * size[1]) in.fail("the header is damaged (preview image)");
    } else if (attribute.type == "chlist") {
      int channels = 0;
      for (std::size_t at = 0; at < value.size() && value[at] != '\0'; ++channels) at = value.find('\0', at) == std::string::npos ? value.size() : value.find('\0', at) + 17;
      if (channels > kMaxChannels) in.fail(fmt::format("an image of {} channels; a model has three", channels));
    }
  }
  std::int32_t window[4];
  std::memcpy(window, required("dataWindow", "box2i", sizeof window).data(), sizeof window);
  const std::int64_t width = std::int64_t{window[2]} - window[0] + 1, height = std::int64_t{window[3]} - window[1] + 1;
  if (width < 1 || height < 1 || width > max_size || height > max_size)
    in.fail(fmt::format("an image of {} x {} texels; models have sides from 1 to {}", width, height, max_size));
  if (window[0] != 0 || window[1] != 0) in.fail("the image does not begin at (0, 0); it was cropped or moved by another program");
  survey.width = static_cast<int>(width);
  survey.height = static_cast<int>(height);
  const int rows = rows_per_chunk(static_cast<unsigned char>(required("compression", "compression", 1)[0]));
  if (rows == 0) in.fail("the image is compressed with a lossy method; save it with ZIP or PIZ");
  if (is_header_only) return survey;

  const std::int64_t chunks = (height + rows - 1) / rows;
  const std::string table = in.bytes(static_cast<std::uint64_t>(chunks) * 8);
  const std::uint64_t begin = in.position();
  for (std::int64_t i = 0; i < chunks; ++i) {
    std::uint64_t offset;
    std::memcpy(&offset, table.data() + 8 * i, 8);
    const auto missing = [&] { in.fail(fmt::format("the file ends early: texel rows from {} on are missing; it was not copied or written completely", i * rows)); };
    if (offset == 0 || offset > in.size()) missing();
    if (offset < begin) in.fail(fmt::format("damaged (the texel rows from {} on lie inside the header)", i * rows));
    if (in.size() - offset < 8) missing();
    in.seek(offset);
    const auto y = in.number<std::int32_t>();
    const auto bytes = in.number<std::int32_t>();
    if (y != i * rows || bytes < 0) in.fail(fmt::format("damaged (at texel row {})", i * rows));
    if (static_cast<std::uint64_t>(bytes) > in.size() - in.position()) missing();
  }
  return survey;
}

}  // namespace skeletex
