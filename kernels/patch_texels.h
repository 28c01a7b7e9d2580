// SPDX-License-Identifier: MIT
// Texels of a patch and their neighbours.
#include "skeletex_structs.h"

// The texel at (column, row) of a patch; a column may be beyond either end by less than the width, it wraps round.
int texel_at(global const PatchRecord* restrict p, int texture_width, int column, int row) {
  const int wrapped = column < 0 ? column + p->width : column >= p->width ? column - p->width : column;
  return (p->y + row) * texture_width + p->x + wrapped;
}

// Colours 0 to 5: texels of one colour are two cells apart or more, also where an odd width wraps round.
int colour_of(int column, int row, int width) {
  return 3 * (row & 1) + ((width & 1) && column == width - 1 ? 2 : column & 1);
}
