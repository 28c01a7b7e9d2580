// SPDX-License-Identifier: MIT
#include "skeletex/render/image.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfStdIO.h>
#include <cairo.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>

#include "skeletex/io/atomic_file.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

float from_srgb(float x) { return x <= 0.04045f ? x / 12.92f : std::pow((x + 0.055f) / 1.055f, 2.4f); }
float to_srgb(float x) {
  x = std::clamp(x, 0.0f, 1.0f);
  return x <= 0.0031308f ? 12.92f * x : 1.055f * std::pow(x, 1 / 2.4f) - 0.055f;
}
unsigned to_byte(float x) { return static_cast<unsigned>(std::lround(255 * std::clamp(x, 0.0f, 1.0f))); }

using Surface = std::unique_ptr<cairo_surface_t, decltype(&cairo_surface_destroy)>;

/// cairo's premultiplied ARGB in sRGB. Its blending is not linear, which only text edges would show.
Surface to_cairo(const Image& image) {
  Surface surface(cairo_image_surface_create(CAIRO_FORMAT_ARGB32, image.width, image.height), cairo_surface_destroy);
  if (cairo_surface_status(surface.get()) != CAIRO_STATUS_SUCCESS)
    throw InputError("there is no memory for a picture of this size");
  unsigned char* data = cairo_image_surface_get_data(surface.get());
  const int stride = cairo_image_surface_get_stride(surface.get());
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) {
      const float* p = image.at(x, y);
      const float alpha = std::clamp(p[3], 0.0f, 1.0f);
      unsigned packed = to_byte(alpha) << 24;
      for (int c = 0; c < 3; ++c) packed |= to_byte(alpha > 0 ? alpha * to_srgb(p[c] / alpha) : 0) << (16 - 8 * c);
      reinterpret_cast<unsigned*>(data + static_cast<std::ptrdiff_t>(y) * stride)[x] = packed;
    }
  cairo_surface_mark_dirty(surface.get());
  return surface;
}

/// Draws with cairo on a clear layer of the picture's size, which then goes on top of it.
void draw_with_cairo(Image& image, const std::function<void(cairo_t*)>& draw) {
  Surface surface(cairo_image_surface_create(CAIRO_FORMAT_ARGB32, image.width, image.height), cairo_surface_destroy);
  std::unique_ptr<cairo_t, decltype(&cairo_destroy)> cairo(cairo_create(surface.get()), cairo_destroy);
  cairo_select_font_face(cairo.get(), "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
  draw(cairo.get());
  cairo_surface_flush(surface.get());
  const unsigned char* data = cairo_image_surface_get_data(surface.get());
  const int stride = cairo_image_surface_get_stride(surface.get());
  Image layer = make_image(image.width, image.height);
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) {
      const unsigned packed = reinterpret_cast<const unsigned*>(data + static_cast<std::ptrdiff_t>(y) * stride)[x];
      const float alpha = static_cast<float>(packed >> 24) / 255;
      float* p = layer.at(x, y);
      for (int c = 0; c < 3; ++c)
        p[c] = alpha > 0
                   ? alpha * from_srgb(std::min(1.0f, static_cast<float>(packed >> (16 - 8 * c) & 255) / (255 * alpha)))
                   : 0;
      p[3] = alpha;
    }
  blend_over(image, layer);
}

void show_text(cairo_t* cairo, double x, double y, const std::string& text, const TextStyle& style) {
  cairo_set_font_size(cairo, style.size);
  cairo_set_source_rgb(cairo, style.colour[0], style.colour[1], style.colour[2]);
  cairo_text_extents_t extents;
  cairo_text_extents(cairo, text.c_str(), &extents);
  cairo_move_to(cairo, style.is_centred ? x - 0.5 * extents.x_advance : x, y);
  cairo_show_text(cairo, text.c_str());
}

/// About n + 1 round numbers from lowest to highest.
std::vector<double> ticks(double lowest, double highest, int n) {
  const double raw = (highest - lowest) / n, power = std::pow(10, std::floor(std::log10(raw)));
  double step = power;
  for (const double factor : {1.0, 2.0, 2.5, 5.0, 10.0}) {
    step = factor * power;
    if (step >= raw * 0.999) break;
  }
  std::vector<double> list;
  for (double x = std::ceil(lowest / step - 1e-9) * step; x <= highest + 1e-9 * step; x += step) list.push_back(x);
  return list;
}

}  // namespace

Image make_image(int width, int height) {
  return {width, height, std::vector<float>(4 * static_cast<std::size_t>(width) * height, 0.0f)};
}

LinearRgb to_linear(const VertexColour& srgb) {
  return {from_srgb(static_cast<float>(srgb.r) / 255), from_srgb(static_cast<float>(srgb.g) / 255),
          from_srgb(static_cast<float>(srgb.b) / 255)};
}

void blend_over(Image& under, const Image& over, double opacity) {
  const auto k = static_cast<float>(opacity);
  for (std::size_t i = 0; i < under.rgba.size(); i += 4) {
    const float rest = 1 - k * over.rgba[i + 3];
    for (std::size_t c = 0; c < 4; ++c) under.rgba[i + c] = rest * under.rgba[i + c] + k * over.rgba[i + c];
  }
}

void fill_background(Image& image, const LinearRgb& colour) {
  for (std::size_t i = 0; i < image.rgba.size(); i += 4) {
    const float rest = 1 - image.rgba[i + 3];
    for (std::size_t c = 0; c < 3; ++c) image.rgba[i + c] += rest * colour[c];
    image.rgba[i + 3] = 1;
  }
}

Image tile(std::span<const Image> images, int columns) {
  int cell_width = 0, cell_height = 0;
  for (const Image& image : images) {
    cell_width = std::max(cell_width, image.width);
    cell_height = std::max(cell_height, image.height);
  }
  const int count = static_cast<int>(images.size());
  columns = std::clamp(columns, 1, std::max(count, 1));
  Image result = make_image(columns * cell_width, (count + columns - 1) / columns * cell_height);
  for (int i = 0; i < count; ++i) {
    const int left = i % columns * cell_width + (cell_width - images[i].width) / 2,
              top = i / columns * cell_height + (cell_height - images[i].height) / 2;
    for (int y = 0; y < images[i].height; ++y)
      std::copy_n(images[i].at(0, y), 4 * static_cast<std::size_t>(images[i].width), result.at(left, top + y));
  }
  return result;
}

void write_png(const std::filesystem::path& path, const Image& image) {
  const Surface surface = to_cairo(image);
  write_atomically(path, [&](const std::filesystem::path& temporary) {
    OutputFile file(temporary, path);
    const auto write = [](void* closure, const unsigned char* data, unsigned length) {
      static_cast<OutputFile*>(closure)->write({reinterpret_cast<const char*>(data), length});
      return CAIRO_STATUS_SUCCESS;
    };
    const cairo_status_t status = cairo_surface_write_to_png_stream(surface.get(), write, &file);
    if (status != CAIRO_STATUS_SUCCESS)
      throw IoError(fmt::format("{}: {}", path.string(), cairo_status_to_string(status)));
    file.close();
  });
}

void write_exr_image(const std::filesystem::path& path, const Image& image) {
  // By way of memory: OpenEXR's own files lose write errors of their last bytes.
  Imf::StdOSStream stream;
  write_atomically(path, [&](const std::filesystem::path& temporary) {
    try {
      Imf::Header header(image.width, image.height);
      header.compression() = Imf::ZIP_COMPRESSION;
      Imf::FrameBuffer frame;
      constexpr const char* kNames[] = {"R", "G", "B", "A"};
      for (int c = 0; c < 4; ++c) {
        header.channels().insert(kNames[c], Imf::Channel(Imf::FLOAT));
        frame.insert(kNames[c],
                     Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(const_cast<float*>(image.rgba.data() + c)),
                                4 * sizeof(float), 4 * sizeof(float) * static_cast<std::size_t>(image.width)));
      }
      Imf::OutputFile exr(stream, header);
      exr.setFrameBuffer(frame);
      exr.writePixels(image.height);
    } catch (const std::exception& error) {
      throw IoError(fmt::format("{}: {}", path.string(), error.what()));
    }
    OutputFile file(temporary, path);
    file.write(stream.str());
    file.close();
  });
}

void draw_text(Image& image, double x, double y, const std::string& text, const TextStyle& style) {
  draw_with_cairo(image, [&](cairo_t* cairo) { show_text(cairo, x, y, text, style); });
}

void draw_scale(Image& image, std::span<const VertexColour> colours, double lowest, double highest,
                const std::string& title, const std::array<double, 3>& ink) {
  const double unit = std::min(image.width, image.height) / 40.0, width = 1.2 * unit, height = 0.5 * image.height;
  const double x = image.width - 7 * unit, top = 0.5 * (image.height - height);
  draw_with_cairo(image, [&](cairo_t* cairo) {
    const auto count = static_cast<double>(colours.size());
    for (std::size_t i = 0; i < colours.size(); ++i) {
      cairo_set_source_rgb(cairo, colours[i].r / 255.0, colours[i].g / 255.0, colours[i].b / 255.0);
      const double bottom = top + height * (1 - static_cast<double>(i) / count);
      cairo_rectangle(cairo, x, bottom - height / count - 0.5, width, height / count + 0.5);
      cairo_fill(cairo);
    }
    cairo_set_source_rgb(cairo, ink[0], ink[1], ink[2]);
    cairo_set_line_width(cairo, std::max(1.0, 0.06 * unit));
    cairo_rectangle(cairo, x, top, width, height);
    cairo_stroke(cairo);
    for (const double value : ticks(lowest, highest, 4)) {
      const double y = top + height * (1 - (value - lowest) / (highest - lowest));
      cairo_move_to(cairo, x + width, y);
      cairo_line_to(cairo, x + width + 0.4 * unit, y);
      cairo_stroke(cairo);
      show_text(cairo, x + width + 0.6 * unit, y + 0.35 * unit, value == 0 ? "0" : fmt::format("{:.2g}", value),
                {.size = unit, .colour = ink});
    }
    show_text(cairo, x + 0.5 * width, top - 0.8 * unit, title, {.size = unit, .colour = ink, .is_centred = true});
  });
}

}  // namespace skeletex
