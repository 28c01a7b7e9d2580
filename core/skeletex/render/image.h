// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "skeletex/io/mesh_file.h"

namespace skeletex {

using LinearRgb = std::array<float, 3>;

/// A picture: linear colour, premultiplied by coverage, four floats per pixel, rows from the top.
struct Image {
  int width = 0, height = 0;
  std::vector<float> rgba;
  float* at(int x, int y) { return rgba.data() + 4 * (static_cast<std::size_t>(y) * width + x); }
  const float* at(int x, int y) const { return rgba.data() + 4 * (static_cast<std::size_t>(y) * width + x); }
};
Image make_image(int width, int height);

LinearRgb to_linear(const VertexColour& srgb);
/// `over` with the given opacity on top of `under`.
/// \pre same size
void blend_over(Image& under, const Image& over, double opacity = 1);
void fill_background(Image& image, const LinearRgb& colour);
/// Pictures side by side in rows of at most `columns`, each in the middle of its cell.
Image tile(std::span<const Image> images, int columns);

/// 8 bit sRGB with straight alpha. Atomic.
/// \throw IoError
void write_png(const std::filesystem::path& path, const Image& image);
/// Linear float channels R, G, B, A (premultiplied, as EXR has it). Atomic.
/// \throw IoError
void write_exr_image(const std::filesystem::path& path, const Image& image);

/// Text, 8 bit sRGB colour; (x, y) is the baseline's left end, or its middle.
struct TextStyle {
  double size = 16;  ///< pixels
  std::array<double, 3> colour{0.1, 0.1, 0.1};
  bool is_centred = false;
};
void draw_text(Image& image, double x, double y, const std::string& text, const TextStyle& style);
/// A vertical bar of a colour map at the right margin, with numbers from 0 to `highest` (or lowest to highest) and a
/// title.
void draw_scale(Image& image, std::span<const VertexColour> colours, double lowest, double highest,
                const std::string& title, const std::array<double, 3>& ink);

}  // namespace skeletex
