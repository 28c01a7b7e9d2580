// SPDX-License-Identifier: MIT
// The tangent frame's foot W and its axis `out`, from the tables (model/frame.h).
#include "skeletex_structs.h"

// An entry of the column table, four planes of `count` floats.
__attribute__((always_inline)) ColumnRecord column_at(global const float* columns, int count, int i) {
  const ColumnRecord column = {columns[i], columns[count + i], columns[2 * count + i], columns[3 * count + i]};
  return column;
}

void frame_of(global const PatchRecord* restrict p, RowRecord row, ColumnRecord column, float foot[3], float out[3]) {
  const float slope = (1.0f - row.axial) * column.slope_head + row.axial * column.slope_tail;
  const float o = row.cap_cos * slope + row.cap_sin;
  const float scale = rsqrt(row.cap_cos * row.cap_cos + o * o);
  for (int i = 0; i < 3; ++i) {
    const float radial = column.cosine * p->s[i] + column.sine * p->b[i];
    foot[i] = p->head[i] + row.axial * p->length * p->axis[i];
    out[i] = (row.cap_cos * radial + o * p->axis[i]) * scale;
  }
}
