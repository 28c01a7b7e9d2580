// SPDX-License-Identifier: MIT
#include "skeletex/io/image_file.h"

#include <fmt/format.h>
#include <png.h>
#include <turbojpeg.h>

#include <memory>

#include "skeletex/io/atomic_file.h"
#include "skeletex/io/read_file.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

constexpr std::string_view kPng("\x89PNG\r\n\x1a\n", 8), kJpeg("\xff\xd8\xff", 3);

void check_size(std::int64_t width, std::int64_t height, const std::string& where) {
  if (width < 1 || height < 1 || width > kMaxImageSize || height > kMaxImageSize)
    throw IoError(fmt::format("{}: a picture of {} x {} pixels; sides from 1 to {} are read", where, width, height,
                              kMaxImageSize));
}

/// libpng's simplified interface, whose state must be freed whatever happens.
struct PngState {
  png_image image{};
  PngState() { image.version = PNG_IMAGE_VERSION; }
  ~PngState() { png_image_free(&image); }
  PngState(const PngState&) = delete;
  PngState& operator=(const PngState&) = delete;
};

ColourImage decode_png(std::string_view bytes, const std::string& where) {
  PngState png;
  const auto fail = [&] { throw IoError(fmt::format("{}: cannot read this PNG: {}", where, png.image.message)); };
  if (png_image_begin_read_from_memory(&png.image, bytes.data(), bytes.size()) == 0) fail();
  check_size(png.image.width, png.image.height, where);
  png.image.format = PNG_FORMAT_RGBA;
  ColourImage image{static_cast<int>(png.image.width), static_cast<int>(png.image.height), {}};
  image.rgba.resize(PNG_IMAGE_SIZE(png.image));
  if (png_image_finish_read(&png.image, nullptr, image.rgba.data(), 0, nullptr) == 0) fail();
  return image;
}

ColourImage decode_jpeg(std::string_view bytes, const std::string& where) {
  const std::unique_ptr<void, int (*)(tjhandle)> jpeg(tjInitDecompress(), tjDestroy);
  const auto* const data = reinterpret_cast<const unsigned char*>(bytes.data());
  const auto fail = [&] {
    throw IoError(fmt::format("{}: cannot read this JPEG: {}", where, tjGetErrorStr2(jpeg.get())));
  };
  int width = 0, height = 0, subsampling = 0, space = 0;
  if (!jpeg || tjDecompressHeader3(jpeg.get(), data, bytes.size(), &width, &height, &subsampling, &space) != 0) fail();
  check_size(width, height, where);
  ColourImage image{width, height, std::vector<std::uint8_t>(std::size_t{4} * width * height)};
  // What libjpeg calls a warning, such as bytes after the end, leaves a picture.
  if (tjDecompress2(jpeg.get(), data, bytes.size(), image.rgba.data(), width, 0, height, TJPF_RGBA,
                    TJFLAG_ACCURATEDCT) != 0 &&
      tjGetErrorCode(jpeg.get()) == TJERR_FATAL)
    fail();
  return image;
}

}  // namespace

ColourImage decode_image(std::string_view bytes, const std::string& where) {
  if (bytes.starts_with(kPng)) return decode_png(bytes, where);
  if (bytes.starts_with(kJpeg)) return decode_jpeg(bytes, where);
  throw IoError(where + ": neither a PNG nor a JPEG picture; convert it to one of them");
}

ColourImage read_image(const std::filesystem::path& path) { return decode_image(read_file(path), path.string()); }

std::string encode_png(const ColourImage& image, const std::string& where) {
  check_size(image.width, image.height, where);
  PngState png;
  png.image.width = static_cast<png_uint_32>(image.width);
  png.image.height = static_cast<png_uint_32>(image.height);
  png.image.format = PNG_FORMAT_RGBA;
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(png.image);
  std::string bytes(size, '\0');
  if (png_image_write_to_memory(&png.image, bytes.data(), &size, 0, image.rgba.data(), 0, nullptr) == 0)
    throw IoError(fmt::format("{}: cannot write this PNG: {}", where, png.image.message));
  bytes.resize(size);
  return bytes;
}

void write_image(const std::filesystem::path& path, const ColourImage& image) {
  write_text_atomically(path, encode_png(image, path.string()));
}

}  // namespace skeletex
