// SPDX-License-Identifier: MIT
// The library's colours (core/skeletex/render/colours.cpp), as bytes.

const byte = (x) => Math.round(255 * Math.min(1, Math.max(0, x)));

/** The i-th bone's colour: hues by the golden angle in Oklab, three lightnesses. */
export function boneColour(bone) {
  const lightness = [0.72, 0.58, 0.84][bone % 3], hue = 0.5 + 2 * Math.PI * 0.6180339887498949 * bone;
  const a = 0.13 * Math.cos(hue), b = 0.13 * Math.sin(hue);
  const l = (lightness + 0.3963377774 * a + 0.2158037573 * b) ** 3;
  const m = (lightness - 0.1055613458 * a - 0.0638541728 * b) ** 3;
  const s = (lightness - 0.0894841775 * a - 1.291485548 * b) ** 3;
  const gamma = (x) => (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055);
  return [byte(gamma(4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s)),
          byte(gamma(-1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s)),
          byte(gamma(-0.0041960863 * l - 0.7034186147 * m + 1.707614701 * s))];
}

const VIRIDIS = [[68, 1, 84], [72, 36, 117], [65, 68, 135], [53, 95, 141], [42, 120, 142], [33, 145, 140], [34, 168, 132],
                 [68, 191, 112], [122, 209, 81], [189, 223, 38], [253, 231, 37]];

export function viridis(value) {
  const at = Math.min(1, Math.max(0, value)) * (VIRIDIS.length - 1), i = Math.min(Math.floor(at), VIRIDIS.length - 2);
  return VIRIDIS[i].map((x, k) => Math.round(x + (at - i) * (VIRIDIS[i + 1][k] - x)));
}

export const css = ([r, g, b]) => `rgb(${r} ${g} ${b})`;
