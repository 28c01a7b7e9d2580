// SPDX-License-Identifier: MIT
// Vertex-sampling-maximizing maps of all charts together (design: docs/steps/vsm.md): areas, weights and
// residuals; elimination.cl solves the systems.
//
// Vertices of all charts lie in one list: each chart has a block that begins at a multiple of VSM_SLICE and holds its
// inner vertices first, then its fixed ones. A vertex's map (u, v) is the sum of two floats each: (x, y) + (z, w) of
// map[vertex]. Rows of the sparse systems are the inner vertices. Their entries, one per neighbour, lie in slices of
// VSM_SLICE rows, column-major inside a slice: entry k of row i is slice_begin[i / VSM_SLICE] + k * VSM_SLICE + i %
// VSM_SLICE. A row's neighbours that are eliminated later come first, then fixed ones, then those that are eliminated
// before it. Per entry: column (the neighbour), jump (lifted v of the neighbour = v + jump; VSM_POLE: the neighbour is
// a pole, which acts through u only), weight = mantissa * 2^exponent. Both directions of an edge carry the same weight
// bits.
//
// Buffers, each of planes behind each other (see VsmLayout for `tables` and `system`):
//   weights    mantissas (per entry), weights in units of 4^half_exponent (per entry), inverse_roots (per row)
//   exponents  exponents (per entry), half_exponents (per row)
// A row's weights sum up to d = 4^half_exponent / inverse_root^2.

#include "vsm_structs.h"
#include "work_group.h"

// On a CPU a work-item takes the rows of a slice side by side: loops over them become vector instructions. Elsewhere a
// group shares a slice.
#ifdef GROUP_IS_SINGLE
#define VSM_LANES VSM_SLICE
#else
#define VSM_LANES 1
#endif

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

// Texture areas of all triangles, in (v, u); for a pole's triangle that of the trapezoid between its opposite edge and
// the pole's line. Never below a rounding error's worth, so that weights stay positive.
// In: corners (3 planes of vertices, a pole first), jumps (2 planes: corners 1 and 2 against corner 0; with a pole the
// first is VSM_POLE and the second that of corner 2 against corner 1). Out: areas. NDRange: triangles.
kernel void measure_areas(const VsmLayout at, global const int* restrict corners, global const char* restrict jumps,
                          global const float4* restrict map, global float* restrict areas) {
  const int t = get_global_id(0), count = at.triangles;
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

// A positive float as mantissa in [0.5, 1) and exponent; 0 where it is below all normal ones. frexp() and ldexp() are
// calls that no compiler makes vector instructions of.
float split_float(float value, int* exponent) {
  const int bits = as_int(value);
  *exponent = (bits >> 23) - 126;
  return as_float((bits & 0x7fffff) | 0x3f000000);
}
float power_of_two(int exponent) { return as_float(clamp(exponent + 127, 0, 254) << 23); }

// Raises a chart's value to the largest of a slice, which one group takes; slices belong to one chart.
void raise_to_largest(local int* values, const int* own, global int* target) {
  int value = own[0];
  for (int i = 1; i < VSM_LANES; ++i) value = max(value, own[i]);
#ifndef GROUP_IS_SINGLE
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

// Multiplies each entry's weight by (A_left + A_right) * factor, where factor = 1 / A3^alpha, then sums each row, poles
// included.
// In: is_frozen, per chart: its weights stay as they are; tables, factors, areas. In and out: weights, exponents;
// largest (per chart, INT_MIN before), the largest half_exponent. NDRange: slices, in groups of VSM_SLICE / VSM_LANES.
kernel GROUP_KERNEL void weigh_rows(const VsmLayout at, global const int* restrict tables,
                                    global const int* restrict is_frozen, global const float* restrict factors,
                                    global const float* restrict areas, global float* restrict weights,
                                    global int* restrict exponents, global int* restrict largest) {
  const int slice = get_group_id(0), first = slice * VSM_SLICE + get_local_id(0);
  if (slice >= at.rows / VSM_SLICE) return;
  const int chart = tables[slice];
  global const int* slice_begin = tables + at.slice_begin;
  global const int* row_length = tables + at.row_length;
  global const int* triangles = tables + at.triangles_at;
  global float* scaled = weights + at.entries;
  const int longest = longest_row(row_length, first);
  local int values[VSM_SLICE];
  int half_exponent[VSM_LANES];
  for (int i = 0; i < VSM_LANES; ++i) half_exponent[i] = INT_MIN;
  for (int k = 0; k < longest; ++k) {
    const int begin = entry_index(slice_begin, first, k);
    if (!is_frozen[chart])
      for (int i = 0; i < VSM_LANES; ++i) {
        const int e = begin + i;
        int shift, exponent;
        // A common factor of all weights does not count; this one keeps the smallest areas away from a float's end.
        const float grown =
            split_float((areas[triangles[e]] + areas[triangles[at.entries + e]]) * (0x1p40f * factors[e]), &shift);
        weights[e] = split_float(weights[e] * grown, &exponent);
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
          is_entry ? weights[begin + i] * power_of_two(exponents[begin + i] - 2 * half_exponent[i]) : 0.0f;
      scaled[begin + i] = weight;
      sum[i] += weight;
    }
  }
  for (int i = 0; i < VSM_LANES; ++i) {
    scaled[at.entries + first + i] = 1.0f / sqrt(sum[i]);
    exponents[at.entries + first + i] = half_exponent[i];
  }
  raise_to_largest(values, half_exponent, largest + chart);
}

// Writes the matrix of the elimination: per later neighbour the entry, scaled to a unit diagonal; per row what joins it
// to fixed vertices, for u and for v, on which poles do not act. NDRange: rows.
kernel void scale_rows(const VsmLayout at, global const int* restrict tables, global const char* restrict jumps,
                       global const float* restrict weights, global const int* restrict exponents,
                       global float* restrict system) {
  const int row = get_global_id(0);
  if (row >= at.rows) return;
  global const int* slice_begin = tables + at.slice_begin;
  global const int* columns = tables + at.columns;
  global const int* half_exponents = exponents + at.entries;
  global const float* inverse_roots = weights + 2 * at.entries;
  if (tables[at.row_length + row] == 0) return;  // no unknown
  const int later_end = tables[at.later_end + row], fixed_end = tables[at.fixed_end + row];
  const float inverse_root = inverse_roots[row];
  global float* values = system + tables[at.matrix_begin + row];
  int n = 0;
  for (; n < later_end; ++n) {
    // Not from weights, of which one row's may be too small for a float.
    const int e = entry_index(slice_begin, row, n), j = columns[e];
    values[n] = weights[e] * (inverse_root * inverse_roots[j]) *
                power_of_two(exponents[e] - half_exponents[row] - half_exponents[j]);
  }
  float fixed_u = 0.0f, fixed_v = 0.0f;
  for (; n < fixed_end; ++n) {
    const int e = entry_index(slice_begin, row, n);
    const float weight = weights[at.entries + e];
    fixed_u += weight;
    fixed_v += jumps[e] == VSM_POLE ? 0.0f : weight;
  }
  system[at.fixed + row] = fixed_u * (inverse_root * inverse_root);
  system[at.fixed + at.rows + row] = fixed_v * (inverse_root * inverse_root);
}

// How far each inner vertex is from the weighted mean of its neighbours, from differences of neighbours, so that it is
// accurate relative to them however small they are.
// Out: in `system` roots_i = sqrt(d_i) in units of about the chart's largest, and the residual of the system that these
// scale to a unit diagonal; ratios (per chart, 0 before): the largest |x_i - mean| / mean |x_i - x_j|, as bits of a
// float, which order like integers. NDRange: slices, in groups of VSM_SLICE / VSM_LANES.
kernel GROUP_KERNEL void form_residual(const VsmLayout at, global const int* restrict tables,
                                       global const char* restrict jumps, global const float* restrict weights,
                                       global const int* restrict exponents, global const int* restrict largest,
                                       global const float* restrict map, global float* restrict system,
                                       global int* restrict ratios) {
  const int slice = get_group_id(0), first = slice * VSM_SLICE + get_local_id(0);
  if (slice >= at.rows / VSM_SLICE) return;
  const int chart = tables[slice];
  global const int* slice_begin = tables + at.slice_begin;
  global const int* row_length = tables + at.row_length;
  global const int* columns = tables + at.columns;
  global const float* scaled = weights + at.entries;
  local int values[VSM_SLICE];
  int ratio[VSM_LANES];
  for (int i = 0; i < VSM_LANES; ++i) {
    const int row = first + i, length = row_length[row], is_inner = length > 0;
    const float4 own = vload4(row, map);
    float2 sum = 0.0f, total = 0.0f;
    for (int k = 0; k < length; ++k) {
      const int e = entry_index(slice_begin, row, k), jump = jumps[e];
      const float2 weight = (float2)(scaled[e], jump == VSM_POLE ? 0.0f : scaled[e]);
      const float2 value = weight * lifted_difference(own, vload4(columns[e], map), jump);
      sum += value;
      total += fabs(value);
    }
    const float inverse_root = is_inner ? scaled[at.entries + row] : 1.0f;
    // In the middle of a float's range: 2^65 to 2^-65.
    const float root =
        power_of_two((is_inner ? max(exponents[at.entries + row] - largest[chart], -130) : 0) + 65) / inverse_root;
    const float over = inverse_root * inverse_root;
    const float2 distance = sum * over, extent = total * over + 1e-13f;
    system[at.roots + row] = root;
    vstore2(distance * root, row, system + at.residual);
    const float2 relative = fabs(distance) / extent;
    ratio[i] = max(as_int(relative.x), as_int(relative.y));
  }
  raise_to_largest(values, ratio, ratios + chart);
}
