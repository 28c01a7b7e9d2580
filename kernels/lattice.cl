// SPDX-License-Identifier: MIT
// The decoder's triangles over points per texel, while texels still move. A quad is that to the right of and above its
// texel, between inner rows; see quad_diagonal.h for its diagonals.
#include "quad_diagonal.h"
#include "row_group.h"
#include "skeletex_structs.h"
#include "texel_structs.h"

#define BAND_LINE (BAND_COLUMNS + 2)

// left, right, beyond: the columns of the 4 x 4 vertices around the quad beside the texel's own, from this one.
// is_smooth: the rule, known to the compiler.
__attribute__((always_inline)) int second_diagonal(int texel, int left, int right, int beyond, int texture_width,
                                                   int has_before, int has_after, int is_smooth, Planes points) {
  const int before = has_before ? -texture_width : 0, above = texture_width,
            after = (has_after ? 2 : 1) * texture_width;
  const int at[4][4] = {{texel + before + left, texel + before, texel + before + right, texel + before + beyond},
                        {texel + left, texel, texel + right, texel + beyond},
                        {texel + above + left, texel + above, texel + above + right, texel + above + beyond},
                        {texel + after + left, texel + after, texel + after + right, texel + after + beyond}};
  return is_smooth ? takes_second_if_smoother(at, has_before, has_after, points)
                   : takes_second_if_nearer(at, has_before, has_after, points);
}

// The same of any column: they wrap round. Compiled once.
__attribute__((noinline)) int second_diagonal_at(int texel, int column, int width, int texture_width, int has_before,
                                                 int has_after, int is_smooth, Planes points) {
  return second_diagonal(texel, column > 0 ? -1 : width - 1, column + 1 < width ? 1 : 1 - width,
                         column + 2 < width ? 2 : 2 - width, texture_width, has_before, has_after, is_smooth, points);
}

__attribute__((always_inline)) void keep_normal(local float* restrict kept, Normal n) {
  kept[0] = n.x, kept[BAND_LINE] = n.y, kept[2 * BAND_LINE] = n.z;
}

__attribute__((always_inline)) Normal kept_normal(local const float* restrict kept) {
  const Normal n = {kept[0], kept[BAND_LINE], kept[2 * BAND_LINE]};
  return n;
}

// Smoother diagonals of columns of a band of rows, -1 where neither is. Normals of each quad are worked out once, and
// kept of three rows: twelve numbers each, one after the other for all quads of a row.
__attribute__((always_inline)) void choose_smoother(const int column, const int count, const int first_row,
                                                    const int rows, const int texture_width, const int one,
                                                    global const PatchRecord* restrict patch,
                                                    local float* restrict kept, Planes points,
                                                    global int* restrict diagonals) {
  const int height = patch->height, a = 1, b = 3 * BAND_LINE + 1, c = 6 * BAND_LINE + 1, d = 9 * BAND_LINE + 1;
  for (int line = max(first_row - 1, 1); line <= first_row + rows; ++line) {
    const int above = (patch->y + line) * texture_width + patch->x + column;
    local float* restrict own = kept + line % 3 * 12 * BAND_LINE;
    for (int i = get_local_id(0); i < (line < height - 2 ? count + 2 : 0); i += ROW_ITEMS) {
      const int texel = above + i - 1;
      const QuadNormals q =
          normals_of_quad(texel, texel + one, texel + texture_width, texel + texture_width + one, points);
      keep_normal(own + i, q.a), keep_normal(own + 3 * BAND_LINE + i, q.b);
      keep_normal(own + 6 * BAND_LINE + i, q.c), keep_normal(own + 9 * BAND_LINE + i, q.d);
    }
    WAIT_FOR_GROUP(CLK_LOCAL_MEM_FENCE);
    // The row before has now all neighbours.
    const int row = line - 1, texel = above - texture_width, has_before = row > 1, has_after = line < height - 2;
    local const float* restrict before = kept + (has_before ? row - 1 : row) % 3 * 12 * BAND_LINE;
    local const float* restrict here = kept + row % 3 * 12 * BAND_LINE;
    local const float* restrict after = kept + (has_after ? line : row) % 3 * 12 * BAND_LINE;
    for (int i = get_local_id(0); i < (row < first_row ? 0 : count); i += ROW_ITEMS) {
      const QuadNormals q = {kept_normal(here + a + i), kept_normal(here + b + i), kept_normal(here + c + i),
                             kept_normal(here + d + i)};
      diagonals[texel + i] =
          smoother_of(q, kept_normal(before + b + i), kept_normal(before + d + i), kept_normal(after + a + i),
                      kept_normal(after + c + i), kept_normal(here + b + i + one), kept_normal(here + c + i + one),
                      kept_normal(here + a + i - one), kept_normal(here + d + i - one), has_before, has_after,
                      texel + i, texel + i + texture_width + one, points);
    }
    WAIT_FOR_GROUP(CLK_LOCAL_MEM_FENCE);
  }
}

// NDRange: one work-group of ROW_ITEMS per band of rows and BAND_COLUMNS of the widest one's columns: many, so that
// none is behind for long.
// in   lattice_rows: rows that quads begin at, of each patch in order; band: how many of them a group takes
// out  diagonals: per texel of these rows 1 for the second
kernel void choose_diagonals(const DiagonalParameters p, global const int* restrict lattice_rows,
                             global const PatchRecord* restrict patches, global const float* restrict points,
                             global int* restrict diagonals) {
  local float kept[36 * BAND_LINE];
  const Planes from = planes_of(points, p.texel_count);
  const int band_end = min((int)(get_group_id(0) + 1) * p.band, p.row_count),
            column = 1 + BAND_COLUMNS * get_group_id(1);
  for (int begin = get_group_id(0) * p.band, end; begin < band_end; begin = end) {
    for (end = begin + 1; end < band_end && lattice_rows[4 * end] == lattice_rows[4 * begin] &&
                          lattice_rows[4 * end + 1] == lattice_rows[4 * begin + 1] + end - begin;)
      ++end;
    global const PatchRecord* restrict patch = patches + lattice_rows[4 * begin];
    const int first_row = lattice_rows[4 * begin + 1], rows = end - begin, width = patch->width,
              column_end = min(column + BAND_COLUMNS, width - 2);
    // What wraps round apart from the rest, whose loads are contiguous. Distances are not written as the numbers that
    // they are, or the compiler pairs loads next to each other and then no longer vectorises the loop.
    const int one = min(width, 1);
    if (p.is_smooth && column < column_end)
      choose_smoother(column, column_end - column, first_row, rows, p.texture_width, one, patch, kept, from, diagonals);
    WAIT_FOR_GROUP(CLK_GLOBAL_MEM_FENCE);
    for (int row = first_row; row < first_row + rows; ++row) {
      const int texel = (patch->y + row) * p.texture_width + patch->x, has_before = row > 1,
                has_after = row + 2 < patch->height - 1;
      for (int j = column + get_local_id(0); j < column_end; j += ROW_ITEMS) {
        const int smoother = diagonals[texel + j];
        const int nearer =
            second_diagonal(texel + j, -one, one, 2 * one, p.texture_width, has_before, has_after, 0, from);
        diagonals[texel + j] = !p.is_smooth ? nearer : smoother < 0 ? nearer : smoother;
      }
      for (int j = max(1, width - 2) + get_local_id(0); get_group_id(1) == 0 && j <= width; j += ROW_ITEMS) {
        const int at_end = j < width ? j : 0;
        diagonals[texel + at_end] = second_diagonal_at(texel + at_end, at_end, width, p.texture_width, has_before,
                                                       has_after, p.is_smooth, from);
      }
    }
  }
}
