// SPDX-License-Identifier: MIT
// Diffusion on the surface by conjugate gradients. The head of filter.cl explains vertices, rows, fans, fields and
// weights. These kernels have a file of their own because they are compiled with other options.
//
// Every work-item writes its own partial sum, and sum_partials adds them up. So no result depends on the order in which
// groups run.
#include "surface_structs.h"

// Sum of w (p here - p there) over the eight neighbours in the rows.
float laplacian_at(const int count, __global const float* restrict weights, __global const float* restrict p,
                   const int before, const int here, const int after, const int left, const int j, const int right,
                   const float has_before) {
  const int v = here + j;
  const float centre = p[v];
  const float in_row = weights[v] * (centre - p[here + right]) + weights[here + left] * (centre - p[here + left]);
  const float ahead = weights[count + v] * (centre - p[after + left]) +
                      weights[2 * count + v] * (centre - p[after + j]) +
                      weights[3 * count + v] * (centre - p[after + right]);
  const float behind = weights[count + before + right] * (centre - p[before + right]) +
                       weights[2 * count + before + j] * (centre - p[before + j]) +
                       weights[3 * count + before + left] * (centre - p[before + left]);
  return in_row + ahead + has_before * behind;
}

// q = is_free (mass_share M + time L) p, and partial sums of p q.
// NDRange: rows.
// in   weights, mass: see weigh_rows; is_free: 1 or 0 per vertex; p: field
// out  q: field; partials: one per work-item
__kernel void apply_rows(const SurfaceParameters surface, __global const SurfaceRow* restrict rows,
                         __global const float* restrict weights, __global const float* restrict mass,
                         __global const float* restrict is_free, __global const float* restrict p,
                         __global float* restrict q, __global float* restrict partials) {
  const int k = get_group_id(0);
  if (k >= surface.row_count) return;
  const int here = rows[k].first, width = rows[k].width, has_before = rows[k].has_before, has_after = rows[k].has_after;
  const int before = has_before ? here - width : here, after = has_after ? here + width : here;
  const int begin = get_local_id(0), step = get_local_size(0);
  float sum = 0.0f;
  for (int c = 0; c < surface.components; ++c) {
    __global const float* restrict from = p + c * surface.count;
    __global float* restrict to = q + c * surface.count;
    for (int j = 1 + begin; j < width - 1; j += step)
      to[here + j] =
          surface.time * laplacian_at(surface.count, weights, from, before, here, after, j - 1, j, j + 1, has_before);
    if (begin == 0) {
      to[here] =
          surface.time * laplacian_at(surface.count, weights, from, before, here, after, width - 1, 0, 1, has_before);
      to[here + width - 1] = surface.time * laplacian_at(surface.count, weights, from, before, here, after, width - 2,
                                                         width - 1, 0, has_before);
    }
    // A work-item goes on with what it has written itself.
    for (int j = 1 + begin; j < width - 1; j += step) {
      const int v = here + j;
      const float value = is_free[v] * (surface.mass_share * mass[v] * from[v] + to[v]);
      to[v] = value;
      sum += from[v] * value;
    }
    if (begin == 0)
      for (int v = here; v < here + width; v += width - 1) {
        const float value = is_free[v] * (surface.mass_share * mass[v] * from[v] + to[v]);
        to[v] = value;
        sum += from[v] * value;
      }
  }
  partials[k * step + begin] = sum;
}

// The same for the triangles of the fans, and for M of the vertices in no row.
// NDRange: fans.
// out  partials: from `first_partial` on     in and out  q
__kernel void apply_fans(const SurfaceParameters surface, __global const FanVertex* restrict fan_vertices,
                         __global const int* restrict fans, __global const float* restrict fan_weights,
                         __global const float* restrict mass, __global const float* restrict is_free,
                         __global const float* restrict p, __global float* restrict q,
                         __global float* restrict partials) {
  const int begin = get_group_id(0) * FAN_CHUNK, end = min(begin + FAN_CHUNK, surface.fan_count);
  float sum = 0.0f;
  for (int k = begin + (int)get_local_id(0); k < end; k += get_local_size(0)) {
    const int v = fan_vertices[k].vertex;
    for (int c = 0; c < surface.components; ++c) {
      __global const float* restrict from = p + c * surface.count;
      const float centre = from[v];
      float laplacian = 0.0f;
      for (int i = 2 * fan_vertices[k].begin; i < 2 * fan_vertices[k + 1].begin; ++i)
        laplacian += fan_weights[i] * (centre - from[fans[i]]);
      const float value = is_free[v] * (surface.time * laplacian +
                                        (v < surface.inner_count ? 0.0f : surface.mass_share * mass[v] * centre));
      q[c * surface.count + v] = value + (v < surface.inner_count ? q[c * surface.count + v] : 0.0f);
      sum += centre * value;
    }
  }
  partials[surface.first_partial + (int)get_global_id(0)] = sum;
}

// result[slot] = the sum of the partial sums. One work-group, with a local float per work-item.
__kernel void sum_partials(const SolveParameters solve, __global const float* restrict partials,
                           __local float* restrict sums, __global float* restrict result) {
  const int begin = get_local_id(0), step = get_local_size(0);
  float sum = 0.0f;
  for (int i = begin; i < solve.value_count; i += step) sum += partials[i];
  sums[begin] = sum;
  barrier(CLK_LOCAL_MEM_FENCE);
  if (begin > 0) return;
  for (int i = 1; i < step; ++i) sum += sums[i];
  result[solve.slot] = sum;
}

// The preconditioner on one lattice is 1 / R + 1 / C. R has the matrix's entries along each row, which are periodic and
// tridiagonal. C has those along each column of inner rows, which are tridiagonal. For vertices in no row both have the
// diagonal. With the diagonal alone, dense rings around poles and narrow rows next to slanting seams would take many
// steps. Vertices whose value is given are not coupled to those that are free. A diagonal that is less than the sum of
// its neighbours is raised to that sum, so that R and C are positive. R = L D L^T: `below` has L's entries next to the
// diagonal, `last` those of its last row. C = L D L^T without `last`.

float raised_diagonal(const float mass, const float stiffness, const float one, const float other, const float time) {
  return mass + time * fmax(stiffness, fabs(one) + fabs(other)) + 1e-35f;
}

// Factors R. NDRange: rows, of which one work-item each works.
// in   weights, mass, stiffness, is_free
// out  inverse_pivots (1 / D), below, last: one plane each
__kernel void factor_rows(const SurfaceParameters surface, __global const SurfaceRow* restrict rows,
                          __global const float* restrict weights, __global const float* restrict mass,
                          __global const float* restrict stiffness, __global const float* restrict is_free,
                          __global float* restrict inverse_pivots, __global float* restrict below,
                          __global float* restrict last) {
  const int k = get_group_id(0);
  if (k >= surface.row_count || get_local_id(0) > 0) return;
  const int here = rows[k].first, end = here + rows[k].width - 1;
  float before = weights[end];  // of the edge from the vertex before
  float pivot_change = 0.0f, fill = -surface.time * weights[end] * is_free[here] * is_free[end], end_change = 0.0f;
  for (int v = here; v < end; ++v) {
    const float coupling = -surface.time * weights[v] * is_free[v] * is_free[v + 1];
    const float diagonal = raised_diagonal(mass[v], stiffness[v], before, weights[v], surface.time);
    const float inverse = 1.0f / fmax(diagonal + pivot_change, 1e-6f * diagonal);
    if (v + 1 == end) fill += coupling;
    inverse_pivots[v] = inverse;
    below[v] = v + 1 == end ? 0.0f : coupling * inverse;
    last[v] = fill * inverse;
    end_change -= fill * fill * inverse;
    pivot_change = -coupling * coupling * inverse;
    fill *= -coupling * inverse;
    before = weights[v];
  }
  const float diagonal = raised_diagonal(mass[end], stiffness[end], before, weights[end], surface.time);
  inverse_pivots[end] = 1.0f / fmax(diagonal + end_change, 1e-6f * diagonal);
}

// Factors C. NDRange of this kernel and of precondition_columns: one work-group per block of columns, whose work-items
// take columns in turn.
// in   weights, mass, stiffness, is_free
// out  inverse_pivots (1 / D), below: one plane each
__kernel void factor_columns(const SurfaceParameters surface, __global const ColumnBlock* restrict blocks,
                             __global const float* restrict weights, __global const float* restrict mass,
                             __global const float* restrict stiffness, __global const float* restrict is_free,
                             __global float* restrict inverse_pivots, __global float* restrict below) {
  const int k = get_group_id(0);
  if (k >= surface.block_count) return;
  const int first = blocks[k].first, columns = blocks[k].columns, stride = blocks[k].stride, rows = blocks[k].rows;
  __global const float* restrict ahead = weights + 2 * surface.count;
  const int begin = get_local_id(0), step = get_local_size(0);
  for (int row = 0; row < rows; ++row) {
    const int here = first + row * stride, back = row > 0 ? stride : 0;
    for (int v = here + begin; v < here + columns; v += step) {
      const float before = back > 0 ? ahead[v - back] : 0.0f;
      const float eliminated =
          back > 0 ? surface.time * before * is_free[v - back] * is_free[v] * below[v - back] : 0.0f;
      const float diagonal = raised_diagonal(mass[v], stiffness[v], before, ahead[v], surface.time);
      const float inverse = 1.0f / fmax(diagonal + eliminated, 1e-6f * diagonal);
      inverse_pivots[v] = inverse;
      below[v] = row + 1 < rows ? -surface.time * ahead[v] * is_free[v] * is_free[v + stride] * inverse : 0.0f;
    }
  }
}

// z = 1 / R r, in the rows.
// NDRange: rows, of which one work-item each does all components at once: their chains of dependent steps overlap.
__kernel void precondition_rows(const SurfaceParameters surface, __global const SurfaceRow* restrict rows,
                                __global const float* restrict inverse_pivots, __global const float* restrict below,
                                __global const float* restrict last, __global const float* restrict r,
                                __global float* restrict z) {
  const int k = get_group_id(0);
  if (k >= surface.row_count || get_local_id(0) > 0) return;
  const int here = rows[k].first, end = here + rows[k].width - 1;
  // A field of one component is done three times over.
  const int second = surface.components > 1 ? surface.count : 0, third = 2 * second;
  float x = r[here], y = r[second + here], w = r[third + here];
  float end_x = r[end], end_y = r[second + end], end_w = r[third + end];
  for (int v = here; v < end; ++v) {
    z[v] = x;
    z[second + v] = y;
    z[third + v] = w;
    end_x -= last[v] * x;
    end_y -= last[v] * y;
    end_w -= last[v] * w;
    x = r[v + 1] - below[v] * x;
    y = r[second + v + 1] - below[v] * y;
    w = r[third + v + 1] - below[v] * w;
  }
  end_x *= inverse_pivots[end];
  end_y *= inverse_pivots[end];
  end_w *= inverse_pivots[end];
  z[end] = end_x;
  z[second + end] = end_y;
  z[third + end] = end_w;
  x = 0.0f;
  y = 0.0f;
  w = 0.0f;
  for (int v = end - 1; v >= here; --v) {
    const float inverse = inverse_pivots[v];
    x = z[v] * inverse - below[v] * x - last[v] * end_x;
    y = z[second + v] * inverse - below[v] * y - last[v] * end_y;
    w = z[third + v] * inverse - below[v] * w - last[v] * end_w;
    z[v] = x;
    z[second + v] = y;
    z[third + v] = w;
  }
}

// z = is_free (z + 1 / C r), in the rows, and partial sums of r z.
// y: a field for intermediate values
__kernel void precondition_columns(const SurfaceParameters surface, __global const ColumnBlock* restrict blocks,
                                   __global const float* restrict inverse_pivots, __global const float* restrict below,
                                   __global const float* restrict is_free, __global const float* restrict r,
                                   __global float* restrict y, __global float* restrict z,
                                   __global float* restrict partials) {
  const int k = get_group_id(0);
  if (k >= surface.block_count) return;
  const int first = blocks[k].first, columns = blocks[k].columns, stride = blocks[k].stride, rows = blocks[k].rows;
  const int begin = get_local_id(0), step = get_local_size(0);
  float sum = 0.0f;
  for (int c = 0; c < surface.components; ++c) {
    __global const float* restrict from = r + c * surface.count;
    __global float* restrict between = y + c * surface.count;
    __global float* restrict to = z + c * surface.count;
    for (int v = first + begin; v < first + columns; v += step) between[v] = from[v];
    for (int row = 1; row < rows; ++row) {
      const int here = first + row * stride;
      for (int v = here + begin; v < here + columns; v += step)
        between[v] = from[v] - below[v - stride] * between[v - stride];
    }
    for (int row = rows - 1; row >= 0; --row) {
      const int here = first + row * stride, ahead = row + 1 < rows ? stride : 0;
      const float has_after = row + 1 < rows;
      for (int v = here + begin; v < here + columns; v += step) {
        const float value = between[v] * inverse_pivots[v] - has_after * below[v] * between[v + ahead];
        const float both = is_free[v] * (to[v] + value);
        between[v] = value;
        to[v] = both;
        sum += from[v] * both;
      }
    }
  }
  partials[k * step + begin] = sum;
}

// z = 2 is_free r / D for the vertices in no row, from inner_count on, and partial sums of r z.
// NDRange: work-items take vertices in turn.
// out  z; partials: from `first_partial` on
__kernel void precondition_others(const SurfaceParameters surface, __global const float* restrict mass,
                                  __global const float* restrict stiffness, __global const float* restrict is_free,
                                  __global const float* restrict r, __global float* restrict z,
                                  __global float* restrict partials) {
  float sum = 0.0f;
  for (int v = surface.inner_count + (int)get_global_id(0); v < surface.count; v += get_global_size(0))
    for (int c = 0; c < surface.components; ++c) {
      const float value =
          2.0f * is_free[v] * r[c * surface.count + v] / (mass[v] + surface.time * stiffness[v] + 1e-35f);
      z[c * surface.count + v] = value;
      sum += r[c * surface.count + v] * value;
    }
  partials[surface.first_partial + (int)get_global_id(0)] = sum;
}

// Levels. The coarser lattice has about half of the rows and columns (edit/filter/coarsen.h). A vertex of this lattice
// is interpolated from four vertices of the coarser one (`sources`, `shares`). `readers` is the transpose of that.

// The residual on the coarser lattice: each vertex has the sum over its readers, by their shares.
// NDRange: the coarser lattice's vertices.
__kernel void restrict_field(const SurfaceParameters surface, __global const int* restrict reader_begin,
                             __global const int* restrict readers, __global const float* restrict reader_shares,
                             __global const float* restrict from, __global float* restrict to) {
  const int v = get_global_id(0);
  if (v >= surface.coarse_count) return;
  const int begin = reader_begin[v], end = reader_begin[v + 1];
  for (int c = 0; c < surface.components; ++c) {
    float sum = 0.0f;
    for (int i = begin; i < end; ++i) sum += reader_shares[i] * from[c * surface.count + readers[i]];
    to[c * surface.coarse_count + v] = sum;
  }
}

// z += is_free times the coarser lattice's values at each vertex, and partial sums of r times that.
// NDRange: one work-group per VERTEX_CHUNK vertices.
// out  partials: from `first_partial` on     in and out  z
__kernel void add_coarse_field(const SurfaceParameters surface, __global const int* restrict sources,
                               __global const float* restrict shares, __global const float* restrict is_free,
                               __global const float* restrict coarse, __global const float* restrict r,
                               __global float* restrict z, __global float* restrict partials) {
  const int begin = get_group_id(0) * VERTEX_CHUNK, end = min(begin + VERTEX_CHUNK, surface.count);
  float sum = 0.0f;
  for (int v = begin + (int)get_local_id(0); v < end; v += get_local_size(0)) {
    const int s0 = sources[4 * v], s1 = sources[4 * v + 1], s2 = sources[4 * v + 2], s3 = sources[4 * v + 3];
    const float w0 = is_free[v] * shares[4 * v], w1 = is_free[v] * shares[4 * v + 1],
                w2 = is_free[v] * shares[4 * v + 2];
    const float w3 = is_free[v] * shares[4 * v + 3];
    for (int c = 0; c < surface.components; ++c) {
      __global const float* restrict from = coarse + c * surface.coarse_count;
      const float value = w0 * from[s0] + w1 * from[s1] + w2 * from[s2] + w3 * from[s3];
      z[c * surface.count + v] += value;
      sum += r[c * surface.count + v] * value;
    }
  }
  partials[surface.first_partial + (int)get_global_id(0)] = sum;
}

// r = is_free b, x = 0, p = 0.
// NDRange of this kernel and the next two: one work-group per VERTEX_CHUNK values of the fields.
__kernel void begin_solve(const SolveParameters solve, __global const float* restrict is_free,
                          __global const float* restrict b, __global float* restrict x, __global float* restrict r,
                          __global float* restrict p) {
  const int begin = get_group_id(0) * VERTEX_CHUNK, end = min(begin + VERTEX_CHUNK, solve.value_count);
  for (int i = begin + (int)get_local_id(0); i < end; i += get_local_size(0)) {
    x[i] = 0.0f;
    r[i] = is_free[i < solve.count ? i : i < 2 * solve.count ? i - solve.count : i - 2 * solve.count] * b[i];
    p[i] = 0.0f;
  }
}

// x += a p, r -= a q, where a = (r z) / (p q).
// in   scalars: sums, by slot
__kernel void take_step(const SolveParameters solve, __global const float* restrict scalars,
                        __global const float* restrict p, __global const float* restrict q, __global float* restrict x,
                        __global float* restrict r) {
  const int begin = get_group_id(0) * VERTEX_CHUNK, end = min(begin + VERTEX_CHUNK, solve.value_count);
  const float length = scalars[solve.other_slot] > 0.0f ? scalars[solve.slot] / scalars[solve.other_slot] : 0.0f;
  for (int i = begin + (int)get_local_id(0); i < end; i += get_local_size(0)) {
    x[i] += length * p[i];
    r[i] -= length * q[i];
  }
}

// p = z + (new r z) / (old r z) p.
__kernel void turn_direction(const SolveParameters solve, __global const float* restrict scalars,
                             __global const float* restrict z, __global float* restrict p) {
  const int begin = get_group_id(0) * VERTEX_CHUNK, end = min(begin + VERTEX_CHUNK, solve.value_count);
  const float kept = scalars[solve.slot] > 0.0f ? scalars[solve.other_slot] / scalars[solve.slot] : 0.0f;
  for (int i = begin + (int)get_local_id(0); i < end; i += get_local_size(0)) p[i] = z[i] + kept * p[i];
}
