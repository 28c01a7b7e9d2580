// SPDX-License-Identifier: MIT
#include "skeletex/render/colours.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace skeletex {
namespace {

unsigned char to_byte(double value) {
  return static_cast<unsigned char>(std::lround(255 * std::clamp(value, 0.0, 1.0)));
}

/// Oklab (Ottosson 2020) to sRGB.
VertexColour from_oklch(double lightness, double chroma, double hue_rad) {
  const double a = chroma * std::cos(hue_rad), b = chroma * std::sin(hue_rad);
  const double l = std::pow(lightness + 0.3963377774 * a + 0.2158037573 * b, 3);
  const double m = std::pow(lightness - 0.1055613458 * a - 0.0638541728 * b, 3);
  const double s = std::pow(lightness - 0.0894841775 * a - 1.2914855480 * b, 3);
  const auto gamma = [](double x) { return x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055; };
  return {to_byte(gamma(4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s)),
          to_byte(gamma(-1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s)),
          to_byte(gamma(-0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s))};
}

}  // namespace

VertexColour bone_colour(BoneIndex bone) {
  // Hues by the golden angle never come close again; three lightnesses set neighbours in hue apart.
  constexpr std::array<double, 3> kLightness{0.72, 0.58, 0.84};
  const double hue = 0.5 + 2 * std::numbers::pi * 0.6180339887498949 * bone;
  return from_oklch(kLightness[bone % 3], 0.13, hue);
}

VertexColour viridis(double value) {
  constexpr std::array<VertexColour, 11> kAnchors{{{68, 1, 84},
                                                   {72, 36, 117},
                                                   {65, 68, 135},
                                                   {53, 95, 141},
                                                   {42, 120, 142},
                                                   {33, 145, 140},
                                                   {34, 168, 132},
                                                   {68, 191, 112},
                                                   {122, 209, 81},
                                                   {189, 223, 38},
                                                   {253, 231, 37}}};
  const double at = std::clamp(value, 0.0, 1.0) * (kAnchors.size() - 1);
  const std::size_t i = std::min(static_cast<std::size_t>(at), kAnchors.size() - 2);
  const double t = at - static_cast<double>(i);
  const auto mix = [t](unsigned char a, unsigned char b) { return to_byte(((1 - t) * a + t * b) / 255); };
  return {mix(kAnchors[i].r, kAnchors[i + 1].r), mix(kAnchors[i].g, kAnchors[i + 1].g),
          mix(kAnchors[i].b, kAnchors[i + 1].b)};
}

std::string hex(VertexColour colour) { return fmt::format("#{:02x}{:02x}{:02x}", colour.r, colour.g, colour.b); }

}  // namespace skeletex
