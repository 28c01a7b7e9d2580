// SPDX-License-Identifier: MIT
// The decoder's triangles over points per texel, while texels still move. A quad is that to the right of and above its texel, between
// inner rows; see quad_diagonal.h for its diagonals.
//   choose_diagonals         of all quads
//   choose_listed_diagonals  of some
#include "skeletex_structs.h"
#include "quad_diagonal.h"

// left, right, beyond: the columns of the 4 x 4 vertices around the quad beside the texel's own, from this one. is_smooth: the rule, known to the compiler.
__attribute__((always_inline)) int second_diagonal(int texel, int left, int right, int beyond, int texture_width, int has_before, int has_after,
                                                   int is_smooth, global const float* x, global const float* y,
                                                   global const float* z) {
  const int before = has_before ? -texture_width : 0, above = texture_width, after = (has_after ? 2 : 1) * texture_width;
  const int at[4][4] = {{texel + before + left, texel + before, texel + before + right, texel + before + beyond},
                        {texel + left, texel, texel + right, texel + beyond},
                        {texel + above + left, texel + above, texel + above + right, texel + above + beyond},
                        {texel + after + left, texel + after, texel + after + right, texel + after + beyond}};
  return is_smooth ? takes_second_if_smoother(at, has_before, has_after, x, y, z) : takes_second_if_nearer(at, has_before, has_after, x, y, z);
}

// The same of any column: they wrap round. Compiled once.
__attribute__((noinline)) int second_diagonal_at(int texel, int column, int width, int texture_width, int has_before, int has_after, int is_smooth, global const float* restrict x,
                       global const float* restrict y, global const float* restrict z) {
  return second_diagonal(texel, column > 0 ? -1 : width - 1, column + 1 < width ? 1 : 1 - width, column + 2 < width ? 2 : 2 - width, texture_width,
                         has_before, has_after, is_smooth, x, y, z);
}

// NDRange: one work-group of ROW_ITEMS per row, as in reconstruct.cl; lattice_rows: the rows that quads begin at.
// out  diagonals: per texel 1 for the second
kernel void choose_diagonals(const int row_count, const int texture_width, const int is_smooth, global const int* restrict lattice_rows,
                             global const PatchRecord* restrict patches, global const float* restrict x, global const float* restrict y,
                             global const float* restrict z, global int* restrict diagonals) {
  const int k = get_group_id(0);
  if (k >= row_count) return;
  global const PatchRecord* restrict patch = patches + lattice_rows[4 * k];
  const int row = lattice_rows[4 * k + 1], width = patch->width;
  const int texel = (patch->y + row) * texture_width + patch->x;
  const int has_before = row > 1, has_after = row + 2 < patch->height - 1;
  // What wraps round apart from the rest, whose loads are contiguous. Distances are not written as the numbers that they are, or
  // the compiler pairs loads next to each other and then no longer vectorises the loop.
  const int one = min(width, 1), two = 2 * one;
  if (is_smooth) {
    for (int j = 1 + get_local_id(0); j < width - 2; j += ROW_ITEMS)
      diagonals[texel + j] = second_diagonal(texel + j, -one, one, two, texture_width, has_before, has_after, 1, x, y, z);
  } else {
    for (int j = 1 + get_local_id(0); j < width - 2; j += ROW_ITEMS)
      diagonals[texel + j] = second_diagonal(texel + j, -one, one, two, texture_width, has_before, has_after, 0, x, y, z);
  }
  for (int j = max(1, width - 2) + get_local_id(0); j <= width; j += ROW_ITEMS) {
    const int column = j < width ? j : 0;
    diagonals[texel + column] = second_diagonal_at(texel + column, column, width, texture_width, has_before, has_after, is_smooth, x, y, z);
  }
}

// NDRange (count). out  diagonals, at their places; listed_diagonals: the same one after the other
kernel void choose_listed_diagonals(const int count, const int texture_width, const int is_smooth, global const int* restrict listed,
                                    global const int* restrict listed_patches, global const PatchRecord* restrict patches,
                                    global const float* restrict x, global const float* restrict y, global const float* restrict z,
                                    global int* restrict diagonals, global int* restrict listed_diagonals) {
  const int i = (int)get_global_id(0);
  if (i >= count) return;
  global const PatchRecord* restrict p = patches + listed_patches[i];
  const int texel = listed[i], line = texel / texture_width, row = line - p->y;
  const int is_second =
      second_diagonal_at(texel, texel - line * texture_width - p->x, p->width, texture_width, row > 1, row + 2 < p->height - 1, is_smooth, x, y, z);
  diagonals[texel] = is_second;
  listed_diagonals[i] = is_second;
}
