// SPDX-License-Identifier: MIT
// Vertex-sampling-maximizing maps of all charts together (design: docs/parameterization.md).
//
// Vertices of all charts lie in one list: each chart has a block that begins at a multiple of VSM_SLICE and holds its
// inner vertices first, then its fixed ones. A vertex's map (u, v) is the sum of two floats each: (x, y) + (z, w) of map[vertex].
// Rows of the sparse systems are the inner vertices. Their entries, one per neighbour, lie in slices of VSM_SLICE rows,
// column-major inside a slice: entry k of row i is slice_begin[i / VSM_SLICE] + k * VSM_SLICE + i % VSM_SLICE.
// A row's neighbours that are eliminated later come first, then fixed ones, then those that are eliminated before it.
// Per entry: column (the neighbour), jump (lifted v of the neighbour = v + jump; VSM_POLE: the neighbour is a pole,
// which acts through u only), weight = mantissa * 2^exponent. Both directions of an edge carry the same weight bits.

#include "vsm_structs.h"

#ifndef VSM_SLICE
#define VSM_SLICE 32
#endif
#define VSM_POLE (-128)

int entry_index(global const int* restrict slice_begin, int row, int k) {
  return slice_begin[row / VSM_SLICE] + k * VSM_SLICE + row % VSM_SLICE;
}

// From vertex a to b in u and v; v's is (b - a) + jump. Rounded once, relative to the result: the rounding
// error of the first parts' difference is kept, because across the cut jump cancels nearly all of it.
float2 lifted_difference(float4 a, float4 b, float jump) {
  const float2 difference = b.xy - a.xy;
  const float2 part = difference - b.xy;
  const float2 error = (b.xy - (difference - part)) - (a.xy + part);
  return (difference + (float2)(0.0f, jump)) + (error + (b.zw - a.zw));
}

// Texture area of each triangle, in (v, u); for a pole's triangle that of the trapezoid between its opposite edge and
// the pole's line. A pole is always corner 0. Never below a rounding error's worth, so that weights stay positive.
// In: corners (3 planes of `count` vertices), jumps (2 planes: corners 1 and 2 against corner 0; with a pole the first
// is VSM_POLE and the second that of corner 2 against corner 1). Out: areas. NDRange: triangles.
kernel void measure_areas(int count, global const int* restrict corners, global const char* restrict jumps, global const float4* restrict map,
                          global float* restrict areas) {
  const int t = get_global_id(0);
  if (t >= count) return;
  const float4 a = map[corners[t]], b = map[corners[count + t]], c = map[corners[2 * count + t]];
  const int jump_b = jumps[t], jump_c = jumps[count + t];
  float first, second;
  if (jump_b == VSM_POLE) {
    const float2 across = lifted_difference(b, c, jump_c);
    first = across.y * (-0.5f * (lifted_difference(a, b, 0.0f).x + lifted_difference(a, c, 0.0f).x));
    second = 0.0f;
  } else {
    const float2 to_b = lifted_difference(a, b, jump_b), to_c = lifted_difference(a, c, jump_c);
    first = 0.5f * to_b.y * to_c.x;
    second = 0.5f * to_c.y * to_b.x;
  }
  areas[t] = fmax(first - second, fmax(1e-7f * (fabs(first) + fabs(second)), 1e-36f));
}

// A positive float as mantissa in [0.5, 1) and exponent; 0 where it is below all normal ones. frexp() and ldexp() are calls that no compiler makes
// vector instructions of.
float split_float(float value, int* exponent) {
  const int bits = as_int(value);
  *exponent = (bits >> 23) - 126;
  return as_float((bits & 0x7fffff) | 0x3f000000);
}
float power_of_two(int exponent) { return as_float(clamp(exponent + 127, 0, 254) << 23); }

// VSM_SINGLE: groups of one work-item, which need no barriers; CPU compilers turn each barrier in a loop into a
// loop over work-items, which takes them seconds to tens of seconds.
#if ROW_ITEMS == 1 && !defined(VSM_BARRIERS)
#define VSM_SINGLE
#endif

#ifdef VSM_SINGLE
#define VSM_GROUP __attribute__((reqd_work_group_size(1, 1, 1)))
#define VSM_BARRIER()
#define VSM_ITEM 0
#define VSM_ITEMS 1
#define VSM_ONCE __attribute__((noinline))  // PoCL makes three copies of a kernel with all that is inlined in it, and compiles each
#define VSM_LANES VSM_SLICE  // rows of a slice that a work-item takes side by side: loops over them become vector instructions
#else
#define VSM_GROUP
#define VSM_BARRIER() barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE)
#define VSM_ITEM ((int)get_local_id(0))
#define VSM_ITEMS ((int)get_local_size(0))
#define VSM_ONCE
#define VSM_LANES 1
#endif

// Raises a chart's value to the largest of a slice, which one group takes; slices belong to one chart.
void raise_to_largest(local int* values, const int* own, global int* target) {
  int value = own[0];
  for (int i = 1; i < VSM_LANES; ++i) value = max(value, own[i]);
#ifndef VSM_SINGLE
  values[get_local_id(0)] = value;
  barrier(CLK_LOCAL_MEM_FENCE);
  if (get_local_id(0) > 0) return;
  for (int k = 1; k < VSM_SLICE; ++k) value = max(value, values[k]);
#endif
  atomic_max(target, value);
}

// The longest of a work-item's rows: what entries of shorter ones there are, up to it, is padding.
int longest_row(global const int* restrict row_length, int first) {
  int longest = 0;
  for (int i = 0; i < VSM_LANES; ++i) longest = max(longest, row_length[first + i]);
  return longest;
}

// Multiplies each entry's weight by (A_left + A_right) * factor, where factor = 1 / A3^alpha, unless the row's slice is
// frozen (first solve, or a chart that has stopped: weights as they are). Then sums each row: d = 4^half_exponent / inverse_root^2,
// poles included.
// In: frozen (per slice), triangles (2 planes of `entries`: the two at the edge), factors. In and out: mantissas, exponents.
// Out: weights in units of 4^half_exponent; inverse_roots, half_exponents; largest (per chart, INT_MIN before), the largest of these.
// NDRange: slices, in groups of VSM_SLICE / VSM_LANES.
kernel VSM_GROUP void weigh_rows(int entries, global const int* restrict frozen, global const int* restrict slice_chart,
                                 global const int* restrict slice_begin, global const int* restrict row_length, global const int* restrict triangles,
                                 global const float* restrict factors, global const float* restrict areas, global float* restrict mantissas,
                                 global int* restrict exponents, global float* restrict weights, global float* restrict inverse_roots,
                                 global int* restrict half_exponents, global int* restrict largest) {
  const int slice = get_group_id(0), first = slice * VSM_SLICE + get_local_id(0), longest = longest_row(row_length, first);
  int half_exponent[VSM_LANES];
  for (int i = 0; i < VSM_LANES; ++i) half_exponent[i] = INT_MIN;
  for (int k = 0; k < longest; ++k) {
    const int begin = entry_index(slice_begin, first, k);
    if (!frozen[slice])
      for (int i = 0; i < VSM_LANES; ++i) {
        const int e = begin + i;
        int shift, exponent;
        // A common factor of all weights does not count; this one keeps the smallest areas away from a float's end.
        const float grown = split_float((areas[triangles[e]] + areas[triangles[entries + e]]) * (0x1p40f * factors[e]), &shift);
        mantissas[e] = split_float(mantissas[e] * grown, &exponent);
        exponents[e] += shift + exponent;
      }
    for (int i = 0; i < VSM_LANES; ++i) half_exponent[i] = k < row_length[first + i] ? max(half_exponent[i], exponents[begin + i]) : half_exponent[i];
  }
  float sum[VSM_LANES];
  for (int i = 0; i < VSM_LANES; ++i) {
    half_exponent[i] = half_exponent[i] == INT_MIN ? INT_MIN : (half_exponent[i] + 1) >> 1;
    sum[i] = 0.0f;
  }
  for (int k = 0; k < longest; ++k) {
    const int begin = entry_index(slice_begin, first, k);
    for (int i = 0; i < VSM_LANES; ++i) {
      const int is_entry = k < row_length[first + i];
      const float weight = is_entry ? mantissas[begin + i] * power_of_two(exponents[begin + i] - 2 * half_exponent[i]) : 0.0f;
      weights[begin + i] = weight;
      sum[i] += weight;
    }
  }
  for (int i = 0; i < VSM_LANES; ++i) {
    inverse_roots[first + i] = 1.0f / sqrt(sum[i]);
    half_exponents[first + i] = half_exponent[i];
  }
  local int values[VSM_SLICE];
  raise_to_largest(values, half_exponent, largest + slice_chart[slice]);
}

// From vertex a to b as lifted_difference, of one coordinate.
float difference_of(float a, float a_rest, float b, float b_rest, float jump) {
  const float difference = b - a;
  const float part = difference - b;
  const float error = (b - (difference - part)) - (a + part);
  return (difference + jump) + (error + (b_rest - a_rest));
}

// How far each inner vertex is from the weighted mean of its neighbours, from differences of neighbours, so that it is accurate relative to them
// however small they are.
// Out: roots_i = sqrt(d_i) in units of about the chart's largest; residual, of the system that these scale to a unit diagonal;
// ratios (per chart, 0 before): the largest |x_i - mean| / mean |x_i - x_j|, as bits of a float, which order like integers.
// NDRange: slices, in groups of VSM_SLICE / VSM_LANES.
kernel VSM_GROUP void form_residual(global const int* restrict slice_chart, global const int* restrict slice_begin, global const int* restrict row_length,
                                    global const int* restrict column, global const char* restrict jumps, global const float* restrict weights,
                                    global const float* restrict inverse_roots, global const int* restrict half_exponents,
                                    global const int* restrict largest, global const float* restrict map, global float* restrict roots,
                                    global float* restrict residual, global int* restrict ratios) {
  const int slice = get_group_id(0), first = slice * VSM_SLICE + get_local_id(0), longest = longest_row(row_length, first), chart = slice_chart[slice];
  float sum_u[VSM_LANES], sum_v[VSM_LANES], total_u[VSM_LANES], total_v[VSM_LANES];
  for (int i = 0; i < VSM_LANES; ++i) sum_u[i] = sum_v[i] = total_u[i] = total_v[i] = 0.0f;
  for (int k = 0; k < longest; ++k) {
    const int begin = entry_index(slice_begin, first, k);
    for (int i = 0; i < VSM_LANES; ++i) {
      const int e = begin + i, jump = jumps[e];
      global const float* own = map + 4 * (first + i);
      global const float* other = map + 4 * column[e];
      // Weights of padding are 0.
      const float weight_u = weights[e], weight_v = jump == VSM_POLE ? 0.0f : weight_u;
      const float u = weight_u * difference_of(own[0], own[2], other[0], other[2], 0.0f);
      const float v = weight_v * difference_of(own[1], own[3], other[1], other[3], (float)jump);
      sum_u[i] += u, sum_v[i] += v;
      total_u[i] += fabs(u), total_v[i] += fabs(v);
    }
  }
  int ratio[VSM_LANES];
  for (int i = 0; i < VSM_LANES; ++i) {
    const int row = first + i, is_inner = row_length[row] > 0;
    const float inverse_root = is_inner ? inverse_roots[row] : 1.0f;
    // In the middle of a float's range: 2^65 to 2^-65.
    const float root = power_of_two((is_inner ? max(half_exponents[row] - largest[chart], -130) : 0) + 65) / inverse_root;
    const float over = inverse_root * inverse_root, u = sum_u[i] * over, v = sum_v[i] * over;
    roots[row] = root;
    residual[2 * row] = u * root;
    residual[2 * row + 1] = v * root;
    const float ratio_u = fabs(u) / (total_u[i] * over + 1e-13f), ratio_v = fabs(v) / (total_v[i] * over + 1e-13f);
    ratio[i] = max(as_int(ratio_u), as_int(ratio_v));
  }
  local int values[VSM_SLICE];
  raise_to_largest(values, ratio, ratios + chart);
}

// Elimination. To eliminate vertex k of the scaled system is to join its neighbours i and j by a_ik a_kj / d_k more (a star becomes a mesh), where
// d_k, the diagonal entry then, is the sum of a_kj root_j / root_k over all j that are left, the fixed vertices among them. Nothing is
// ever subtracted (Grassmann, Taksar and Heyman 1985), so every entry is accurate to a few rounding errors of its own, however far apart weights
// are, and single precision will do.
// Vertices are eliminated by fronts (Duff and Reid 1983). A front is a dense matrix of its pivots and its boundary, the sum of entries of the
// system and of what its children have left between their boundaries. It keeps its pivots' rows, of which columns up to a row's own
// are 0; its boundary's rows go to its parent. Of these only tiles on and above the diagonal are kept.
//
// A task is a run of fronts that one work-group takes one by one: a subtree. Tasks of one stage are independent; parents are in the same task or in a
// later stage.

#ifdef VSM_SINGLE
float8 sums_of_pairs(float8 a, float8 b) { return (float8)(a.even + a.odd, b.even + b.odd); }
#else
float sum8(float8 x) { return ((x.s0 + x.s1) + (x.s2 + x.s3)) + ((x.s4 + x.s5) + (x.s6 + x.s7)); }
#endif

// target[k] (0 if `is_new`) += row k of a tile's rows times x, both from `begin` to `end`.
void multiply_rows(global const float* rows, int width, int begin, int end, global const float* x, int is_new, global float* target) {
#ifdef VSM_SINGLE
  float8 sum0 = 0.0f, sum1 = 0.0f, sum2 = 0.0f, sum3 = 0.0f, sum4 = 0.0f, sum5 = 0.0f, sum6 = 0.0f, sum7 = 0.0f;
  for (int column = begin; column < end; column += VSM_TILE) {
    global const float* from = rows + column;
    const float8 by = vload8(0, x + column);
    sum0 += vload8(0, from) * by;
    sum1 += vload8(0, from + width) * by;
    sum2 += vload8(0, from + 2 * width) * by;
    sum3 += vload8(0, from + 3 * width) * by;
    sum4 += vload8(0, from + 4 * width) * by;
    sum5 += vload8(0, from + 5 * width) * by;
    sum6 += vload8(0, from + 6 * width) * by;
    sum7 += vload8(0, from + 7 * width) * by;
  }
  const float8 low = sums_of_pairs(sums_of_pairs(sum0, sum1), sums_of_pairs(sum2, sum3));
  const float8 high = sums_of_pairs(sums_of_pairs(sum4, sum5), sums_of_pairs(sum6, sum7));
  const float8 sums = sums_of_pairs(low, high);
  vstore8(is_new ? sums : vload8(0, target) + sums, 0, target);
#else
  for (int k = VSM_ITEM; k < VSM_TILE; k += VSM_ITEMS) {
    float8 sum = 0.0f;
    for (int column = begin; column < end; column += VSM_TILE) sum += vload8(0, rows + k * width + column) * vload8(0, x + column);
    target[k] = is_new ? sum8(sum) : target[k] + sum8(sum);
  }
#endif
}

// The next task of a queue, the same for all work-items of a group: any number of groups will do and none waits for another. Which group takes which
// task has no influence on results.
int take_task(global int* queue, local int* taken) {
  VSM_BARRIER();
  if (VSM_ITEM == 0) *taken = atomic_inc(queue);
  VSM_BARRIER();
  return *taken;
}

int padded(int count) { return (count + VSM_TILE - 1) / VSM_TILE * VSM_TILE; }

// Where column 0 of a row of the boundary's matrix would be: rows begin at their diagonal tile.
int rest_row(int width, int row) {
  const int above = row / VSM_TILE * VSM_TILE;
  return above * width - above / 2 * (above - VSM_TILE) + (row - above) * (width - above) - above;
}

// target, a tile, += what the elimination of `pivots` vertices joins its rows and columns by. rows: the pivots' rows, from the first column on.
void update_tile(global const float* rows, int width, global const float* inverse, int pivots, int row, int column, global float* target, int stride) {
  float8 sum0 = vload8(0, target), sum1 = vload8(0, target + stride), sum2 = vload8(0, target + 2 * stride), sum3 = vload8(0, target + 3 * stride),
         sum4 = vload8(0, target + 4 * stride), sum5 = vload8(0, target + 5 * stride), sum6 = vload8(0, target + 6 * stride),
         sum7 = vload8(0, target + 7 * stride);
  for (int k = 0; k < pivots; ++k) {
    global const float* from = rows + k * width + row;
    const float8 to = vload8(0, rows + k * width + column) * inverse[k];
    sum0 += from[0] * to;
    sum1 += from[1] * to;
    sum2 += from[2] * to;
    sum3 += from[3] * to;
    sum4 += from[4] * to;
    sum5 += from[5] * to;
    sum6 += from[6] * to;
    sum7 += from[7] * to;
  }
  vstore8(sum0, 0, target);
  vstore8(sum1, 0, target + stride);
  vstore8(sum2, 0, target + 2 * stride);
  vstore8(sum3, 0, target + 3 * stride);
  vstore8(sum4, 0, target + 4 * stride);
  vstore8(sum5, 0, target + 5 * stride);
  vstore8(sum6, 0, target + 6 * stride);
  vstore8(sum7, 0, target + 7 * stride);
}

// A front's matrix and its four vectors.
typedef struct FrontView {
  int pivots, boundary, width;  // padded
  global float* rows;           // of the pivots
  global float* rest;           // rows of the boundary, see rest_row
  global float* root;           // of the columns: roots; 1 for the fixed column
  global float* u;              // residual, what is carried up, or solution
  global float* v;
  global float* inverse;        // 1 / d of the pivots
} FrontView;

FrontView view_front(global const FrontRecord* front, global float* matrices, global float* vectors) {
  FrontView view;
  view.pivots = padded(front->pivots);
  view.boundary = padded(front->boundary);
  view.width = view.pivots + view.boundary;
  view.rows = matrices + (size_t)front->rows * VSM_TILE;
  view.rest = matrices + (size_t)front->rest * VSM_TILE;
  view.root = vectors + (size_t)front->vectors * VSM_TILE;
  view.u = view.root + view.width;
  view.v = view.u + view.width;
  view.inverse = view.v + view.width;
  return view;
}

// Adds what a child has left between its boundary's vertices.
VSM_ONCE void add_child(FrontView to, FrontView from, int boundary, global const int* columns) {
  for (int i = VSM_ITEM; i < boundary - 1; i += VSM_ITEMS) {
    global const float* source = from.rest + rest_row(from.boundary, i);
    global float* row = columns[i] < to.pivots ? to.rows + columns[i] * to.width : to.rest + rest_row(to.boundary, columns[i] - to.pivots) - to.pivots;
    for (int j = i + 1; j < boundary; ++j) row[columns[j]] += source[j];
  }
}

// Eliminates the pivots, a tile's rows at a time.
VSM_ONCE void factor(FrontView front) {
  const int lane = VSM_ITEM, lanes = VSM_ITEMS, width = front.width;
  global float* root = front.root;
  global float* inverse = front.inverse;
  global float* after = front.u;
  for (int block = 0; block < front.pivots; block += VSM_TILE) {
    global float* tile = front.rows + block * width + block;
    for (int column = block + lane * VSM_TILE; column < width; column += lanes * VSM_TILE)
      update_tile(front.rows, width, inverse, block, block, column, front.rows + block * width + column, width);
    VSM_BARRIER();
    // What joins a row to all columns after the tile's acts as one more column of the tile.
    multiply_rows(tile, width, VSM_TILE, width - block, root + block, 1, after + block);
    VSM_BARRIER();
    // Below the diagonal the tile gets a_ki / d_k.
    if (lane == 0)
      for (int k = 0; k < VSM_TILE; ++k) {
        float left = after[block + k];
        for (int j = k + 1; j < VSM_TILE; ++j) left += tile[k * width + j] * root[block + j];
        // Nothing is left of padding, and of the last vertex where nothing is fixed: its value may be any.
        const float over = left > 0.0f ? root[block + k] / left : 0.0f;
        inverse[block + k] = over;
        for (int i = k + 1; i < VSM_TILE; ++i) {
          const float factor = tile[k * width + i] * over;
          tile[i * width + k] = factor;
          after[block + i] += factor * after[block + k];
          for (int j = i + 1; j < VSM_TILE; ++j) tile[i * width + j] += factor * tile[k * width + j];
        }
      }
    VSM_BARRIER();
    for (int column = (1 + lane) * VSM_TILE; column < width - block; column += lanes * VSM_TILE) {
      float8 values[VSM_TILE];
#pragma unroll
      for (int i = 0; i < VSM_TILE; ++i) {
        values[i] = vload8(0, tile + i * width + column);
#pragma unroll
        for (int k = 0; k < i; ++k) values[i] += tile[i * width + k] * values[k];
        vstore8(values[i], 0, tile + i * width + column);
      }
    }
    VSM_BARRIER();
  }
  const int tiles = front.boundary / VSM_TILE;
  for (int t = lane; t < tiles * tiles; t += lanes) {
    const int i = t / tiles * VSM_TILE, j = t % tiles * VSM_TILE;
    if (i <= j)
      update_tile(front.rows, width, inverse, front.pivots, front.pivots + i, front.pivots + j, front.rest + rest_row(front.boundary, i) + j,
                  front.boundary - i);
  }
}

// Carries the pivots' residuals to the boundary.
VSM_ONCE void carry_up(FrontView front) {
  const int lane = VSM_ITEM, lanes = VSM_ITEMS;
  for (int block = 0; block < front.pivots; block += VSM_TILE) {
    global const float* rows = front.rows + block * front.width;
    global float* u = front.u + block;
    global float* v = front.v + block;
    global const float* inverse = front.inverse + block;
    if (lane == 0)
      for (int k = 0; k < VSM_TILE; ++k)
        for (int j = k + 1; j < VSM_TILE; ++j) {
          const float factor = rows[j * front.width + block + k];
          u[j] += factor * u[k];
          v[j] += factor * v[k];
        }
    VSM_BARRIER();
    for (int column = block + (1 + lane) * VSM_TILE; column < front.width; column += lanes * VSM_TILE) {
      float8 sum_u = vload8(0, front.u + column), sum_v = vload8(0, front.v + column);
      for (int k = 0; k < VSM_TILE; ++k) {
        const float8 values = vload8(0, rows + k * front.width + column) * inverse[k];
        sum_u += values * u[k];
        sum_v += values * v[k];
      }
      vstore8(sum_u, 0, front.u + column);
      vstore8(sum_v, 0, front.v + column);
    }
    VSM_BARRIER();
  }
}

// Factors fronts (if `is_new`: the weights have changed) and carries the residual up from children to parents, for the charts whose ratio is
// above `tolerance`.
// In: tasks (first front and end, 2 ints each), from begin to end; queue, the one of `queues` to take them from (0); fronts and children (see vsm_structs.h); boundary_rows (the last of
// a front, the fixed column, has none); parent_columns, the columns of the parent; later_end, fixed_end: entries of a row whose neighbours are
// eliminated later, and these and fixed ones; entry_columns: of the first, the column in the front of its row.
// In and out: matrices; vectors, 4 rows per front (see FrontView). NDRange: any number of work-groups.
kernel VSM_GROUP void eliminate_fronts(int is_new, float tolerance, int task_begin, int task_end, global const int* restrict tasks, int queue,
                                       global int* restrict queues, global const FrontRecord* restrict fronts, global const int* restrict children,
                                       global const int* restrict boundary_rows, global const int* restrict parent_columns,
                                       global const int* restrict slice_begin, global const int* restrict later_end,
                                       global const int* restrict fixed_end, global const int* restrict neighbour,
                                       global const char* restrict jumps, global const int* restrict entry_columns,
                                       global const float* restrict mantissas, global const int* restrict exponents,
                                       global const float* restrict weights, global const float* restrict inverse_roots,
                                       global const int* restrict half_exponents, global const float* restrict roots,
                                       global const float2* restrict residual, global const int* restrict ratios, global float* restrict matrices,
                                       global float* restrict vectors) {
  const int lane = VSM_ITEM, lanes = VSM_ITEMS;
  local int taken;
  for (int task = task_begin + take_task(queues + queue, &taken); task < task_end; task = task_begin + take_task(queues + queue, &taken))
    for (int f = tasks[2 * task]; f < tasks[2 * task + 1]; ++f) {
      global const FrontRecord* record = fronts + f;
      if (as_float(ratios[record->chart]) <= tolerance) continue;
      const FrontView front = view_front(record, matrices, vectors);
      const int first = record->first, pivots = record->pivots, fixed_column = front.pivots + record->boundary - 1;
      if (is_new) {
        for (int k = lane; k < front.pivots * front.width / VSM_TILE; k += lanes) vstore8(0.0f, k, front.rows);
        for (int k = lane; k < front.boundary / VSM_TILE * (front.boundary + VSM_TILE) / 2; k += lanes) vstore8(0.0f, k, front.rest);
        for (int j = lane; j < front.width; j += lanes) {
          const int i = j - front.pivots;
          front.root[j] = j < pivots ? roots[first + j] : j == fixed_column ? 1.0f : i >= 0 && j < fixed_column ? roots[boundary_rows[record->list + i]] : 0.0f;
        }
        VSM_BARRIER();
        for (int k = lane; k < pivots; k += lanes) {
          const int row = first + k;
          const float inverse_root = inverse_roots[row];
          float fixed = 0.0f;
          int n = 0;
          for (; n < later_end[row]; ++n) {
            // Not from weights, of which one row's may be too small for a float.
            const int e = entry_index(slice_begin, row, n), j = neighbour[e];
            front.rows[k * front.width + entry_columns[e]] =
                mantissas[e] * (inverse_root * inverse_roots[j]) * power_of_two(exponents[e] - half_exponents[row] - half_exponents[j]);
          }
          for (; n < fixed_end[row]; ++n) {
            const int e = entry_index(slice_begin, row, n);
            fixed += record->axes == 2 && jumps[e] == VSM_POLE ? 0.0f : weights[e];
          }
          front.rows[k * front.width + fixed_column] = fixed * (inverse_root * inverse_root) * front.root[k];
        }
        VSM_BARRIER();
        for (int c = record->child_begin; c < record->child_end; ++c) {
          global const FrontRecord* child = fronts + children[c];
          add_child(front, view_front(child, matrices, vectors), child->boundary, parent_columns + child->list);
          VSM_BARRIER();
        }
        factor(front);
        VSM_BARRIER();
      }
      for (int j = lane; j < front.width; j += lanes) {
        const float2 value = j < pivots ? residual[first + j] : (float2)0.0f;
        front.u[j] = value.x;
        front.v[j] = value.y;
      }
      VSM_BARRIER();
      for (int c = record->child_begin; c < record->child_end; ++c) {
        global const FrontRecord* child = fronts + children[c];
        const FrontView from = view_front(child, matrices, vectors);
        for (int i = lane; i < child->boundary - 1; i += lanes) {
          const int column = parent_columns[child->list + i];
          front.u[column] += from.u[from.pivots + i];
          front.v[column] += from.v[from.pivots + i];
        }
        VSM_BARRIER();
      }
      carry_up(front);
    }
}

// The way back, from parents to children, of the same tasks, each from its last front on: solves for the pivots and adds the result to the map; the
// rounding error of the sum is kept in its second part. In and out: vectors, map. Work space: solution (2 floats per vertex).
kernel VSM_GROUP void substitute_back(float tolerance, int task_begin, int task_end, global const int* restrict tasks, int queue, global int* restrict queues,
                                      global const FrontRecord* restrict fronts, global const int* restrict boundary_rows,
                                      global const float* restrict roots, global const int* restrict ratios, global float* restrict matrices,
                                      global float* restrict vectors, global float* restrict solution, global float* restrict map) {
  const int lane = VSM_ITEM, lanes = VSM_ITEMS;
  local int taken;
  for (int task = task_begin + take_task(queues + queue, &taken); task < task_end; task = task_begin + take_task(queues + queue, &taken))
    for (int f = tasks[2 * task + 1] - 1; f >= tasks[2 * task]; --f) {
      global const FrontRecord* record = fronts + f;
      if (as_float(ratios[record->chart]) <= tolerance) continue;
      const FrontView front = view_front(record, matrices, vectors);
      for (int i = lane; i < record->boundary; i += lanes) {
        const int is_fixed = i == record->boundary - 1, row = is_fixed ? 0 : boundary_rows[record->list + i];
        front.u[front.pivots + i] = is_fixed ? 0.0f : solution[2 * row];
        front.v[front.pivots + i] = is_fixed ? 0.0f : solution[2 * row + 1];
      }
      VSM_BARRIER();
      for (int block = front.pivots - VSM_TILE; block >= 0; block -= VSM_TILE) {
        global const float* rows = front.rows + block * front.width;
        global float* u = front.u + block;
        global float* v = front.v + block;
        multiply_rows(rows, front.width, block + VSM_TILE, front.width, front.u, 0, u);
        multiply_rows(rows, front.width, block + VSM_TILE, front.width, front.v, 0, v);
        VSM_BARRIER();
        if (lane == 0)
          for (int k = VSM_TILE - 1; k >= 0; --k) {
            for (int j = k + 1; j < VSM_TILE; ++j) {
              u[k] += rows[k * front.width + block + j] * u[j];
              v[k] += rows[k * front.width + block + j] * v[j];
            }
            u[k] *= front.inverse[block + k];
            v[k] *= front.inverse[block + k];
          }
        VSM_BARRIER();
      }
      for (int i = lane; i < 2 * record->pivots; i += lanes) {
        const int axis = i & 1, row = record->first + i / 2;
        if (!(record->axes & (1 << axis))) continue;
        const float value = axis ? front.v[i / 2] : front.u[i / 2];
        global float* hi = map + 4 * row + axis;
        global float* lo = hi + 2;
        const float change = *lo + value / roots[row], sum = *hi + change, part = sum - *hi;
        solution[2 * row + axis] = value;
        *lo = (*hi - (sum - part)) + (change - part);
        *hi = sum;
      }
      VSM_BARRIER();
    }
}
