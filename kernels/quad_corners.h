// SPDX-License-Identifier: MIT
// The corners of a texel's quad, 0 (the texel) to 3, counter-clockwise, and of its two triangles, and the places of its
// samples; see fit.cl.
#include "patch_texels.h"
#include "skeletex_structs.h"

// Where the samples of a quad are in its cell.
float sample_s(int i) { return i & 1 ? 0.75f : 0.25f; }
float sample_t(int i) { return i & 2 ? 0.75f : 0.25f; }

// Corner k, 0 to 2, of triangle t of a quad.
int corner_of(int is_second, int t, int k) {
  return is_second ? (t == 0 ? (k == 2 ? 3 : k) : k + 1) : (t == 0 ? k : (k == 0 ? 0 : k + 1));
}
int corner_right(int c) { return c == 1 || c == 2; }
int corner_up(int c) { return c >= 2; }

void corners_of_quad(global const PatchRecord* restrict p, int texture_width, int column, int row, int at[4]) {
  at[0] = texel_at(p, texture_width, column, row);
  at[1] = texel_at(p, texture_width, column + 1, row);
  at[2] = at[1] + texture_width;
  at[3] = at[0] + texture_width;
}
