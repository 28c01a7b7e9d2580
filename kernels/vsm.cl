// SPDX-License-Identifier: MIT
// Vertex-sampling-maximizing maps of all charts together (design: docs/parameterization.md).
//
// Vertices of all charts lie in one list: each chart has a block that begins at a multiple of VSM_SLICE and holds its
// inner vertices first, then its fixed ones. A vertex's map (u, v) is the sum of two floats each: (x, y) + (z, w) of
// map[vertex]. Rows of the sparse systems are the inner vertices. Their entries, one per neighbour, lie in slices of
// VSM_SLICE rows, column-major inside a slice: entry k of row i is slice_begin[i / VSM_SLICE] + k * VSM_SLICE + i %
// VSM_SLICE. A row's neighbours that are eliminated later come first, then fixed ones, then those that are eliminated
// before it. Per entry: column (the neighbour), jump (lifted v of the neighbour = v + jump; VSM_POLE: the neighbour is
// a pole, which acts through u only), weight = mantissa * 2^exponent. Both directions of an edge carry the same weight
// bits.

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

// The same for the u and v of four vertices; the second parts of a and b apart, jump 0 for u.
float8 lifted_differences(float8 a, float8 a_rest, float8 b, float8 b_rest, float8 jump) {
  const float8 difference = b - a;
  const float8 part = difference - b;
  const float8 error = (b - (difference - part)) - (a + part);
  return (difference + jump) + (error + (b_rest - a_rest));
}

// Texture area of a triangle, in (v, u); for a pole's triangle that of the trapezoid between its opposite edge and
// the pole's line. A pole is always corner 0. Never below a rounding error's worth, so that weights stay positive.
float texture_area(int t, int count, global const int* corners, global const char* jumps, global const float4* map) {
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
  return fmax(first - second, fmax(1e-7f * (fabs(first) + fabs(second)), 1e-36f));
}

// Texture areas of all triangles.
// In: corners (3 planes of `count` vertices), jumps (2 planes: corners 1 and 2 against corner 0; with a pole the first
// is VSM_POLE and the second that of corner 2 against corner 1). Out: areas. NDRange: triangles.
kernel void measure_areas(int count, global const int* restrict corners, global const char* restrict jumps,
                          global const float4* restrict map, global float* restrict areas) {
  const int t = get_global_id(0);
  if (t < count) areas[t] = texture_area(t, count, corners, jumps, map);
}

// A positive float as mantissa in [0.5, 1) and exponent; 0 where it is below all normal ones. frexp() and ldexp() are
// calls that no compiler makes vector instructions of.
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
#define VSM_ONCE \
  __attribute__((noinline))  // PoCL makes three copies of a kernel with all that is inlined in it, and compiles each
#define VSM_LANES \
  VSM_SLICE  // rows of a slice that a work-item takes side by side: loops over them become vector instructions
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

#ifdef VSM_SINGLE
VSM_ONCE void measure_mapped(int begin, int end, int count, global const int* restrict corners,
                             global const char* restrict jumps, global const float4* restrict map,
                             global float* restrict areas) {
  for (int t = begin; t < end; ++t) areas[t] = texture_area(t, count, corners, jumps, map);
}
#endif

// Multiplies each entry's weight by (A_left + A_right) * factor, where factor = 1 / A3^alpha, unless `is_frozen`:
// weights as they are. Then sums each row of the slice: d = 4^half_exponent / inverse_root^2, poles included. values:
// work space of a group, VSM_SLICE.
VSM_ONCE void weigh_slice(int slice, int is_frozen, int entries, global const int* restrict slice_begin,
                          global const int* restrict row_length, global const int* restrict triangles,
                          global const float* restrict factors, global const float* restrict areas,
                          global float* restrict mantissas, global int* restrict exponents,
                          global float* restrict weights, global float* restrict inverse_roots,
                          global int* restrict half_exponents, global int* restrict largest, local int* values) {
  const int first = slice * VSM_SLICE + get_local_id(0), longest = longest_row(row_length, first);
  int half_exponent[VSM_LANES];
  for (int i = 0; i < VSM_LANES; ++i) half_exponent[i] = INT_MIN;
  for (int k = 0; k < longest; ++k) {
    const int begin = entry_index(slice_begin, first, k);
    if (!is_frozen)
      for (int i = 0; i < VSM_LANES; ++i) {
        const int e = begin + i;
        int shift, exponent;
        // A common factor of all weights does not count; this one keeps the smallest areas away from a float's end.
        const float grown =
            split_float((areas[triangles[e]] + areas[triangles[entries + e]]) * (0x1p40f * factors[e]), &shift);
        mantissas[e] = split_float(mantissas[e] * grown, &exponent);
        exponents[e] += shift + exponent;
      }
    for (int i = 0; i < VSM_LANES; ++i)
      half_exponent[i] = k < row_length[first + i] ? max(half_exponent[i], exponents[begin + i]) : half_exponent[i];
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
      const float weight =
          is_entry ? mantissas[begin + i] * power_of_two(exponents[begin + i] - 2 * half_exponent[i]) : 0.0f;
      weights[begin + i] = weight;
      sum[i] += weight;
    }
  }
  for (int i = 0; i < VSM_LANES; ++i) {
    inverse_roots[first + i] = 1.0f / sqrt(sum[i]);
    half_exponents[first + i] = half_exponent[i];
  }
  raise_to_largest(values, half_exponent, largest);
}

// Weighs the rows of all slices.
// In: frozen (per slice: first solve, or a chart that has stopped), triangles (2 planes of `entries`: the two at the
// edge), factors. In and out: mantissas, exponents. Out: weights in units of 4^half_exponent; inverse_roots,
// half_exponents; largest (per chart, INT_MIN before), the largest of these. NDRange: slices, in groups of VSM_SLICE /
// VSM_LANES.
kernel VSM_GROUP void weigh_rows(int entries, global const int* restrict frozen, global const int* restrict slice_chart,
                                 global const int* restrict slice_begin, global const int* restrict row_length,
                                 global const int* restrict triangles, global const float* restrict factors,
                                 global const float* restrict areas, global float* restrict mantissas,
                                 global int* restrict exponents, global float* restrict weights,
                                 global float* restrict inverse_roots, global int* restrict half_exponents,
                                 global int* restrict largest) {
  const int slice = get_group_id(0);
  local int values[VSM_SLICE];
  weigh_slice(slice, frozen[slice], entries, slice_begin, row_length, triangles, factors, areas, mantissas, exponents,
              weights, inverse_roots, half_exponents, largest + slice_chart[slice], values);
}

// How far each inner vertex of a slice is from the weighted mean of its neighbours, from differences of neighbours, so
// that it is accurate relative to them however small they are. largest: of the slice's chart.
VSM_ONCE void form_residual_of_slice(int slice, global const int* restrict slice_begin,
                                     global const int* restrict row_length, global const int* restrict column,
                                     global const char* restrict jumps, global const float* restrict weights,
                                     global const float* restrict inverse_roots,
                                     global const int* restrict half_exponents, int largest,
                                     global const float* restrict map, global float* restrict roots,
                                     global float* restrict residual, global int* restrict ratio_of_chart,
                                     local int* values) {
  const int first = slice * VSM_SLICE + get_local_id(0);
  float sums[2 * VSM_LANES], totals[2 * VSM_LANES];  // of u and v for each row
#ifdef VSM_SINGLE
  // Four rows at once: a neighbour's map is one load, where eight rows side by side would gather each of its parts.
  for (int i = 0; i < VSM_LANES; i += 4) {
    const int row = first + i,
              longest = max(max(row_length[row], row_length[row + 1]), max(row_length[row + 2], row_length[row + 3]));
    const float8 own_low = vload8(0, map + 4 * row), own_high = vload8(0, map + 4 * row + 8);
    const float8 own_u = (float8)(own_low.s0145, own_high.s0145), own_v = (float8)(own_low.s2367, own_high.s2367);
    float8 sum = 0.0f, total = 0.0f;
    for (int k = 0; k < longest; ++k) {
      const int e = entry_index(slice_begin, row, k);
      const float4 at0 = vload4(column[e], map), at1 = vload4(column[e + 1], map), at2 = vload4(column[e + 2], map),
                   at3 = vload4(column[e + 3], map);
      const int4 jump = convert_int4(vload4(0, jumps + e));
      // Weights of padding are 0.
      const float4 weight_u = vload4(0, weights + e), weight_v = jump == VSM_POLE ? (float4)0.0f : weight_u;
      const float8 jump_v = (float8)((float4)0.0f, convert_float4(jump)).s04152637,
                   weight = (float8)(weight_u, weight_v).s04152637;
      const float8 value = weight * lifted_differences(own_u, own_v, (float8)(at0.xy, at1.xy, at2.xy, at3.xy),
                                                       (float8)(at0.zw, at1.zw, at2.zw, at3.zw), jump_v);
      sum += value;
      total += fabs(value);
    }
    vstore8(sum, 0, sums + 2 * i);
    vstore8(total, 0, totals + 2 * i);
  }
#else
  float2 sum = 0.0f, total = 0.0f;
  for (int k = 0; k < row_length[first]; ++k) {
    const int e = entry_index(slice_begin, first, k), jump = jumps[e];
    const float2 weight = (float2)(weights[e], jump == VSM_POLE ? 0.0f : weights[e]);
    const float2 value = weight * lifted_difference(vload4(first, map), vload4(column[e], map), jump);
    sum += value;
    total += fabs(value);
  }
  vstore2(sum, 0, sums);
  vstore2(total, 0, totals);
#endif
  int ratio[VSM_LANES];
  for (int i = 0; i < VSM_LANES; ++i) {
    const int row = first + i, is_inner = row_length[row] > 0;
    const float inverse_root = is_inner ? inverse_roots[row] : 1.0f;
    // In the middle of a float's range: 2^65 to 2^-65.
    const float root = power_of_two((is_inner ? max(half_exponents[row] - largest, -130) : 0) + 65) / inverse_root;
    const float over = inverse_root * inverse_root, u = sums[2 * i] * over, v = sums[2 * i + 1] * over;
    roots[row] = root;
    residual[2 * row] = u * root;
    residual[2 * row + 1] = v * root;
    const float ratio_u = fabs(u) / (totals[2 * i] * over + 1e-13f),
                ratio_v = fabs(v) / (totals[2 * i + 1] * over + 1e-13f);
    ratio[i] = max(as_int(ratio_u), as_int(ratio_v));
  }
  raise_to_largest(values, ratio, ratio_of_chart);
}

// Residuals of all slices.
// Out: roots_i = sqrt(d_i) in units of about the chart's largest; residual, of the system that these scale to a unit
// diagonal; ratios (per chart, 0 before): the largest |x_i - mean| / mean |x_i - x_j|, as bits of a float, which order
// like integers. NDRange: slices, in groups of VSM_SLICE / VSM_LANES.
kernel VSM_GROUP void form_residual(global const int* restrict slice_chart, global const int* restrict slice_begin,
                                    global const int* restrict row_length, global const int* restrict column,
                                    global const char* restrict jumps, global const float* restrict weights,
                                    global const float* restrict inverse_roots,
                                    global const int* restrict half_exponents, global const int* restrict largest,
                                    global const float* restrict map, global float* restrict roots,
                                    global float* restrict residual, global int* restrict ratios) {
  const int slice = get_group_id(0), chart = slice_chart[slice];
  local int values[VSM_SLICE];
  form_residual_of_slice(slice, slice_begin, row_length, column, jumps, weights, inverse_roots, half_exponents,
                         largest[chart], map, roots, residual, ratios + chart, values);
}

// Elimination. To eliminate vertex k of the scaled system is to join its neighbours i and j by a_ik a_kj / d_k more (a
// star becomes a mesh), where d_k, the diagonal entry then, is the sum of a_kj root_j / root_k over all j that are
// left, the fixed vertices among them. Nothing is ever subtracted (Grassmann, Taksar and Heyman 1985), so every entry
// is accurate to a few rounding errors of its own, however far apart weights are, and single precision will do.
// Vertices are eliminated by fronts (Duff and Reid 1983). A front is a dense matrix of its pivots and its boundary, the
// sum of entries of the system and of what its children have left between their boundaries. It keeps its pivots' rows,
// of which columns up to a row's own are 0; its boundary's rows go to its parent. Of these only tiles on and above the
// diagonal are kept.
//
// A task is a run of fronts that one work-group takes one by one: a subtree. Tasks of one stage are independent;
// parents are in the same task or in a later stage.

#ifdef VSM_SINGLE
float8 sums_of_pairs(float8 a, float8 b) { return (float8)(a.even + a.odd, b.even + b.odd); }
float8 add_across(const float8* sums) {
  const float8 low = sums_of_pairs(sums_of_pairs(sums[0], sums[1]), sums_of_pairs(sums[2], sums[3]));
  const float8 high = sums_of_pairs(sums_of_pairs(sums[4], sums[5]), sums_of_pairs(sums[6], sums[7]));
  return sums_of_pairs(low, high);
}
#else
float sum8(float8 x) { return ((x.s0 + x.s1) + (x.s2 + x.s3)) + ((x.s4 + x.s5) + (x.s6 + x.s7)); }
#endif

// target[k] (0 if `is_new`) += row k of a tile's rows times x, both from `begin` to `end`.
void multiply_rows(global const float* rows, int width, int begin, int end, global const float* x, int is_new,
                   global float* target) {
#ifdef VSM_SINGLE
  float8 sums[VSM_TILE];
#pragma unroll
  for (int k = 0; k < VSM_TILE; ++k) sums[k] = 0.0f;
  for (int column = begin; column < end; column += VSM_TILE) {
    const float8 by = vload8(0, x + column);
#pragma unroll
    for (int k = 0; k < VSM_TILE; ++k) sums[k] += vload8(0, rows + k * width + column) * by;
  }
  const float8 sum = add_across(sums);
  vstore8(is_new ? sum : vload8(0, target) + sum, 0, target);
#else
  for (int k = VSM_ITEM; k < VSM_TILE; k += VSM_ITEMS) {
    float8 sum = 0.0f;
    for (int column = begin; column < end; column += VSM_TILE)
      sum += vload8(0, rows + k * width + column) * vload8(0, x + column);
    target[k] = is_new ? sum8(sum) : target[k] + sum8(sum);
  }
#endif
}

// The same of two vectors, without `is_new`: rows are read once.
void multiply_rows_twice(global const float* rows, int width, int begin, int end, global const float* u,
                         global const float* v, global float* target_u, global float* target_v) {
#ifdef VSM_SINGLE
  float8 sums_u[VSM_TILE], sums_v[VSM_TILE];
#pragma unroll
  for (int k = 0; k < VSM_TILE; ++k) sums_u[k] = sums_v[k] = 0.0f;
  for (int column = begin; column < end; column += VSM_TILE) {
    const float8 by_u = vload8(0, u + column), by_v = vload8(0, v + column);
#pragma unroll
    for (int k = 0; k < VSM_TILE; ++k) {
      const float8 row = vload8(0, rows + k * width + column);
      sums_u[k] += row * by_u;
      sums_v[k] += row * by_v;
    }
  }
  vstore8(vload8(0, target_u) + add_across(sums_u), 0, target_u);
  vstore8(vload8(0, target_v) + add_across(sums_v), 0, target_v);
#else
  multiply_rows(rows, width, begin, end, u, 0, target_u);
  multiply_rows(rows, width, begin, end, v, 0, target_v);
#endif
}

// The next task of a queue, the same for all work-items of a group: any number of groups will do and none waits for
// another. Which group takes which task has no influence on results.
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

// target, a tile (0 if `is_new`), += what the elimination of `pivots` vertices joins its rows and columns by. rows: the
// pivots' rows, from the first column on.
void update_tile(global const float* rows, int width, global const float* inverse, int pivots, int row, int column,
                 int is_new, global float* target, int stride) {
  float8 sums[VSM_TILE];
#pragma unroll
  for (int i = 0; i < VSM_TILE; ++i) sums[i] = is_new ? (float8)0.0f : vload8(0, target + i * stride);
  for (int k = 0; k < pivots; ++k) {
    global const float* from = rows + k * width + row;
    const float8 to = vload8(0, rows + k * width + column) * inverse[k];
#pragma unroll
    for (int i = 0; i < VSM_TILE; ++i) sums[i] += from[i] * to;
  }
#pragma unroll
  for (int i = 0; i < VSM_TILE; ++i) vstore8(sums[i], 0, target + i * stride);
}

// A front's matrix and its four vectors.
typedef struct FrontView {
  int pivots, boundary, width;  // padded
  global float* rows;           // of the pivots
  global float* rest;           // rows of the boundary, see rest_row
  global float* root;           // of the columns: roots; 1 for the fixed column
  global float* u;              // residual, what is carried up, or solution
  global float* v;
  global float* inverse;  // 1 / d of the pivots
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

// Adds what a child has left between its boundary's vertices: rows from begin to end of its boundary.
VSM_ONCE void add_child(FrontView to, FrontView from, int begin, int end, int boundary, global const int* columns) {
  for (int i = begin + VSM_ITEM; i < end; i += VSM_ITEMS) {
    global const float* source = from.rest + rest_row(from.boundary, i);
    global float* row = columns[i] < to.pivots ? to.rows + columns[i] * to.width
                                               : to.rest + rest_row(to.boundary, columns[i] - to.pivots) - to.pivots;
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
      update_tile(front.rows, width, inverse, block, block, column, 0, front.rows + block * width + column, width);
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
  // What joins the boundary's vertices then; its memory is not written before.
  for (int i = 0; i < front.boundary; i += VSM_TILE)
    for (int j = i + lane * VSM_TILE; j < front.boundary; j += lanes * VSM_TILE)
      update_tile(front.rows, width, inverse, front.pivots, front.pivots + i, front.pivots + j, 1,
                  front.rest + rest_row(front.boundary, i) + j, front.boundary - i);
}

// Carries the pivots' residuals to the boundary.
VSM_ONCE void carry_up(FrontView front) {
  const int lane = VSM_ITEM, lanes = VSM_ITEMS;
  for (int block = 0; block < front.pivots; block += VSM_TILE) {
    global const float* rows = front.rows + block * front.width;
    global float* u = front.u + block;
    global float* v = front.v + block;
    global const float* inverse = front.inverse + block;
    if (lane == 0) {
      // In registers: each value waits for the one before.
      float own_u[VSM_TILE], own_v[VSM_TILE];
#pragma unroll
      for (int j = 0; j < VSM_TILE; ++j) {
        float sum_u = u[j], sum_v = v[j];
#pragma unroll
        for (int k = 0; k < j; ++k) {
          const float factor = rows[j * front.width + block + k];
          sum_u += factor * own_u[k];
          sum_v += factor * own_v[k];
        }
        u[j] = own_u[j] = sum_u;
        v[j] = own_v[j] = sum_v;
      }
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

// Factors fronts from begin to end (if `is_new`: the weights have changed), all of one chart, and carries the residual
// up from children to parents.
VSM_ONCE void eliminate(int begin, int end, int is_new, global const FrontRecord* restrict fronts,
                        global const int* restrict children, global const int* restrict boundary_rows,
                        global const int* restrict parent_columns, global const int* restrict slice_begin,
                        global const int* restrict later_end, global const int* restrict fixed_end,
                        global const int* restrict neighbour, global const char* restrict jumps,
                        global const int* restrict entry_columns, global const float* restrict mantissas,
                        global const int* restrict exponents, global const float* restrict weights,
                        global const float* restrict inverse_roots, global const int* restrict half_exponents,
                        global const float* restrict roots, global const float2* restrict residual,
                        global float* restrict matrices, global float* restrict vectors) {
  const int lane = VSM_ITEM, lanes = VSM_ITEMS;
  for (int f = begin; f < end; ++f) {
    global const FrontRecord* record = fronts + f;
    const FrontView front = view_front(record, matrices, vectors);
    const int first = record->first, pivots = record->pivots, fixed_column = front.pivots + record->boundary - 1;
    if (is_new) {
      for (int k = 0; k < front.pivots; ++k)
        for (int column = k / VSM_TILE * VSM_TILE + lane * VSM_TILE; column < front.width; column += lanes * VSM_TILE)
          vstore8(0.0f, 0, front.rows + k * front.width + column);
      for (int j = lane; j < front.width; j += lanes) {
        const int i = j - front.pivots;
        front.root[j] = j < pivots                   ? roots[first + j]
                        : j == fixed_column          ? 1.0f
                        : i >= 0 && j < fixed_column ? roots[boundary_rows[record->list + i]]
                                                     : 0.0f;
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
              mantissas[e] * (inverse_root * inverse_roots[j]) *
              power_of_two(exponents[e] - half_exponents[row] - half_exponents[j]);
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
        add_child(front, view_front(child, matrices, vectors), 0, child->shared, child->boundary,
                  parent_columns + child->list);
        VSM_BARRIER();
      }
      factor(front);
      VSM_BARRIER();
      for (int c = record->child_begin; c < record->child_end; ++c) {
        global const FrontRecord* child = fronts + children[c];
        add_child(front, view_front(child, matrices, vectors), child->shared, child->boundary - 1, child->boundary,
                  parent_columns + child->list);
        VSM_BARRIER();
      }
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

// Eliminates the fronts of tasks, for the charts whose ratio is above `tolerance`.
// In: tasks (first front and end, 2 ints each), from task_begin to task_end; queue, the one of `queues` to take them
// from (0); fronts and children (see vsm_structs.h); boundary_rows (the last of a front, the fixed column, has none);
// parent_columns, the columns of the parent; later_end, fixed_end: entries of a row whose neighbours are eliminated
// later, and these and fixed ones; entry_columns: of the first, the column in the front of its row. In and out:
// matrices; vectors, 4 rows per front (see FrontView). NDRange: any number of work-groups.
kernel VSM_GROUP void eliminate_fronts(
    int is_new, float tolerance, int task_begin, int task_end, global const int* restrict tasks, int queue,
    global int* restrict queues, global const FrontRecord* restrict fronts, global const int* restrict children,
    global const int* restrict boundary_rows, global const int* restrict parent_columns,
    global const int* restrict slice_begin, global const int* restrict later_end, global const int* restrict fixed_end,
    global const int* restrict neighbour, global const char* restrict jumps, global const int* restrict entry_columns,
    global const float* restrict mantissas, global const int* restrict exponents, global const float* restrict weights,
    global const float* restrict inverse_roots, global const int* restrict half_exponents,
    global const float* restrict roots, global const float2* restrict residual, global const int* restrict ratios,
    global float* restrict matrices, global float* restrict vectors) {
  local int taken;
  for (int task = task_begin + take_task(queues + queue, &taken); task < task_end;
       task = task_begin + take_task(queues + queue, &taken)) {
    const int begin = tasks[2 * task], end = tasks[2 * task + 1];
    if (as_float(ratios[fronts[begin].chart]) > tolerance)
      eliminate(begin, end, is_new, fronts, children, boundary_rows, parent_columns, slice_begin, later_end, fixed_end,
                neighbour, jumps, entry_columns, mantissas, exponents, weights, inverse_roots, half_exponents, roots,
                residual, matrices, vectors);
  }
}

// The way back, from parents to children: solves for the pivots of fronts from the last of them on, and adds the result
// to the map; the rounding error of the sum is kept in its second part.
VSM_ONCE void substitute(int begin, int end, global const FrontRecord* restrict fronts,
                         global const int* restrict boundary_rows, global const float* restrict roots,
                         global float* restrict matrices, global float* restrict vectors,
                         global float* restrict solution, global float* restrict map) {
  const int lane = VSM_ITEM, lanes = VSM_ITEMS;
  for (int f = end - 1; f >= begin; --f) {
    global const FrontRecord* record = fronts + f;
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
      multiply_rows_twice(rows, front.width, block + VSM_TILE, front.width, front.u, front.v, u, v);
      VSM_BARRIER();
      if (lane == 0) {
        // In registers: each value waits for the one before.
        float own_u[VSM_TILE], own_v[VSM_TILE];
#pragma unroll
        for (int k = VSM_TILE - 1; k >= 0; --k) {
          float sum_u = u[k], sum_v = v[k];
#pragma unroll
          for (int j = VSM_TILE - 1; j > k; --j) {
            const float value = rows[k * front.width + block + j];
            sum_u += value * own_u[j];
            sum_v += value * own_v[j];
          }
          u[k] = own_u[k] = sum_u * front.inverse[block + k];
          v[k] = own_v[k] = sum_v * front.inverse[block + k];
        }
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

// The way back of the same tasks. In and out: vectors, map. Work space: solution (2 floats per vertex).
kernel VSM_GROUP void substitute_back(float tolerance, int task_begin, int task_end, global const int* restrict tasks,
                                      int queue, global int* restrict queues, global const FrontRecord* restrict fronts,
                                      global const int* restrict boundary_rows, global const float* restrict roots,
                                      global const int* restrict ratios, global float* restrict matrices,
                                      global float* restrict vectors, global float* restrict solution,
                                      global float* restrict map) {
  local int taken;
  for (int task = task_begin + take_task(queues + queue, &taken); task < task_end;
       task = task_begin + take_task(queues + queue, &taken)) {
    const int begin = tasks[2 * task], end = tasks[2 * task + 1];
    if (as_float(ratios[fronts[begin].chart]) > tolerance)
      substitute(begin, end, fronts, boundary_rows, roots, matrices, vectors, solution, map);
  }
}

#ifdef VSM_SINGLE
// The same for charts of moderate size, each from its first weights to its last solution by one work-item: what it
// needs stays in a processor's cache, and it waits for no other chart. In: charts, largest first; queue (0). In and
// out: steps (per chart, 0), of the solver. All else as for the kernels above. NDRange: any number of work-groups.
kernel VSM_GROUP void map_charts(
    int iterations, float intermediate_tolerance, float tolerance, int max_steps, int chart_count,
    global const ChartRecord* restrict charts, global int* restrict queue, int entries, int triangles,
    global const int* restrict slice_begin, global const int* restrict row_length, global const int* restrict later_end,
    global const int* restrict fixed_end, global const int* restrict columns,
    global const int* restrict entry_triangles, global const int* restrict entry_columns,
    global const char* restrict jumps, global const float* restrict factors, global const int* restrict corners,
    global const char* restrict corner_jumps, global const FrontRecord* restrict fronts,
    global const int* restrict children, global const int* restrict boundary_rows,
    global const int* restrict parent_columns, global float* restrict areas, global float* restrict mantissas,
    global int* restrict exponents, global float* restrict weights, global float* restrict inverse_roots,
    global float* restrict roots, global int* restrict half_exponents, global float* restrict residual,
    global float* restrict solution, global float* restrict matrices, global float* restrict vectors,
    global float* restrict map, global int* restrict largest, global int* restrict ratios, global int* restrict steps) {
  local int taken, values[VSM_SLICE];
  for (int task = take_task(queue, &taken); task < chart_count; task = take_task(queue, &taken)) {
    const ChartRecord record = charts[task];
    const int chart = record.chart;
    for (int iteration = 0;; ++iteration) {
      const int is_last = iteration == iterations;
      const float wanted = is_last ? tolerance : intermediate_tolerance;
      largest[chart] = INT_MIN;
      for (int slice = record.slice_begin; slice < record.slice_end; ++slice)
        weigh_slice(slice, iteration == 0, entries, slice_begin, row_length, entry_triangles, factors, areas, mantissas,
                    exponents, weights, inverse_roots, half_exponents, largest + chart, values);
      for (int step = 0;; ++step) {
        ratios[chart] = 0;
        for (int slice = record.slice_begin; slice < record.slice_end; ++slice)
          form_residual_of_slice(slice, slice_begin, row_length, columns, jumps, weights, inverse_roots, half_exponents,
                                 largest[chart], map, roots, residual, ratios + chart, values);
        if (as_float(ratios[chart]) <= wanted || step == max_steps) break;
        ++steps[chart];
        eliminate(record.front_begin, record.front_end, step == 0, fronts, children, boundary_rows, parent_columns,
                  slice_begin, later_end, fixed_end, columns, jumps, entry_columns, mantissas, exponents, weights,
                  inverse_roots, half_exponents, roots, (global const float2*)residual, matrices, vectors);
        substitute(record.front_begin, record.front_end, fronts, boundary_rows, roots, matrices, vectors, solution,
                   map);
      }
      if (is_last) break;
      measure_mapped(record.triangle_begin, record.triangle_end, triangles, corners, corner_jumps,
                     (global const float4*)map, areas);
    }
  }
}
#endif
