// SPDX-License-Identifier: MIT
// Diffusion over the surface by conjugate gradients. Vertices, rows, fans, fields and weights as in filter.cl, whose
// head comment explains them. A file of its own because it is compiled with other options: one program of both would be
// compiled twice.
//
// Sums are partial sums, one per work-item of every group, that sum_partials adds up: no result depends on the order in
// which groups run.

#define FAN_CHUNK 64
#define VERTEX_CHUNK 4096

// Sum of w (p here - p there) over the eight neighbours in the rows.
float laplacian_at(const int count, __global const float* restrict weights, __global const float* restrict p,
                   const int before, const int here, const int after, const int left, const int j, const int right,
                   const float has_before) {
  const int v = here + j;
  const float centre = p[v];
  const float beside = weights[v] * (centre - p[here + right]) + weights[here + left] * (centre - p[here + left]);
  const float ahead = weights[count + v] * (centre - p[after + left]) +
                      weights[2 * count + v] * (centre - p[after + j]) +
                      weights[3 * count + v] * (centre - p[after + right]);
  const float behind = weights[count + before + right] * (centre - p[before + right]) +
                       weights[2 * count + before + j] * (centre - p[before + j]) +
                       weights[3 * count + before + left] * (centre - p[before + left]);
  return beside + ahead + has_before * behind;
}

// q = is_free (mass_share M + time L) p, and partial sums of p q.
// NDRange: rows. in  p: field; is_free: 1 or 0 per vertex     out  q: field; partials: one per work-item
__kernel void apply_rows(const int row_count, const int components, const int count, const float mass_share,
                         const float time, __global const int* restrict rows, __global const float* restrict weights,
                         __global const float* restrict mass, __global const float* restrict is_free,
                         __global const float* restrict p, __global float* restrict q,
                         __global float* restrict partials) {
  const int k = get_group_id(0);
  if (k >= row_count) return;
  const int here = rows[4 * k], width = rows[4 * k + 1], has_before = rows[4 * k + 2], has_after = rows[4 * k + 3];
  const int before = has_before ? here - width : here, after = has_after ? here + width : here;
  const int begin = get_local_id(0), step = get_local_size(0);
  float sum = 0.0f;
  for (int c = 0; c < components; ++c) {
    __global const float* restrict from = p + c * count;
    __global float* restrict to = q + c * count;
    for (int j = 1 + begin; j < width - 1; j += step)
      to[here + j] = time * laplacian_at(count, weights, from, before, here, after, j - 1, j, j + 1, has_before);
    if (begin == 0) {
      to[here] = time * laplacian_at(count, weights, from, before, here, after, width - 1, 0, 1, has_before);
      to[here + width - 1] =
          time * laplacian_at(count, weights, from, before, here, after, width - 2, width - 1, 0, has_before);
    }
    // A work-item goes on with what it has written itself.
    for (int j = 1 + begin; j < width - 1; j += step) {
      const int v = here + j;
      const float value = is_free[v] * (mass_share * mass[v] * from[v] + to[v]);
      to[v] = value;
      sum += from[v] * value;
    }
    if (begin == 0)
      for (int v = here; v < here + width; v += width - 1) {
        const float value = is_free[v] * (mass_share * mass[v] * from[v] + to[v]);
        to[v] = value;
        sum += from[v] * value;
      }
  }
  partials[k * step + begin] = sum;
}

// The same for the triangles of the fans; M of vertices in no row. NDRange: fans.
// in and out  q     out  partials, from `first_partial` on
__kernel void apply_fans(const int fan_count, const int inner_count, const int components, const int count,
                         const int first_partial, const float mass_share, const float time,
                         __global const int* restrict fan_vertices, __global const int* restrict fan_begin,
                         __global const int* restrict fans, __global const float* restrict fan_weights,
                         __global const float* restrict mass, __global const float* restrict is_free,
                         __global const float* restrict p, __global float* restrict q,
                         __global float* restrict partials) {
  const int begin = get_group_id(0) * FAN_CHUNK, end = min(begin + FAN_CHUNK, fan_count);
  float sum = 0.0f;
  for (int k = begin + (int)get_local_id(0); k < end; k += get_local_size(0)) {
    const int v = fan_vertices[k];
    for (int c = 0; c < components; ++c) {
      __global const float* restrict from = p + c * count;
      const float centre = from[v];
      float laplacian = 0.0f;
      for (int i = 2 * fan_begin[k]; i < 2 * fan_begin[k + 1]; ++i)
        laplacian += fan_weights[i] * (centre - from[fans[i]]);
      const float value = is_free[v] * (time * laplacian + (v < inner_count ? 0.0f : mass_share * mass[v] * centre));
      q[c * count + v] = value + (v < inner_count ? q[c * count + v] : 0.0f);
      sum += centre * value;
    }
  }
  partials[first_partial + (int)get_global_id(0)] = sum;
}

// result[slot] = the sum of the partial sums. One work-group, with a local float per work-item.
__kernel void sum_partials(const int partial_count, const int slot, __global const float* restrict partials,
                           __local float* restrict sums, __global float* restrict result) {
  const int begin = get_local_id(0), step = get_local_size(0);
  float sum = 0.0f;
  for (int i = begin; i < partial_count; i += step) sum += partials[i];
  sums[begin] = sum;
  barrier(CLK_LOCAL_MEM_FENCE);
  if (begin > 0) return;
  for (int i = 1; i < step; ++i) sum += sums[i];
  result[slot] = sum;
}

// Conjugate gradients. On one lattice the preconditioner is 1 / R + 1 / C: R takes the matrix's part along each row,
// periodic and tridiagonal, C that along each column of inner rows, tridiagonal; for the other vertices both take its
// diagonal. So neither dense rings around a pole nor rows that a slanting seam presses together count, which the
// diagonal alone would need many steps for. Vertices whose value is given are cut off from those that are free. Where a
// diagonal does not outweigh its neighbours it is raised until it does, so both are positive. R = L D L^T, with L's
// entries next to the diagonal in `below` and those of its last row in `last`; C alike, no last.

float raised_diagonal(const float mass, const float stiffness, const float one, const float other, const float time) {
  return mass + time * fmax(stiffness, fabs(one) + fabs(other)) + 1e-35f;
}

// NDRange: rows; one work-item each does it. out  inverse_pivots (1 / D), below, last: one plane each
__kernel void factor_rows(const int row_count, const float time, __global const int* restrict rows,
                          __global const float* restrict weights, __global const float* restrict mass,
                          __global const float* restrict stiffness, __global const float* restrict is_free,
                          __global float* restrict inverse_pivots, __global float* restrict below,
                          __global float* restrict last) {
  const int k = get_group_id(0);
  if (k >= row_count || get_local_id(0) > 0) return;
  const int here = rows[4 * k], end = here + rows[4 * k + 1] - 1;
  float before = weights[end];  // of the edge from the vertex before
  float pivot_change = 0.0f, fill = -time * weights[end] * is_free[here] * is_free[end], end_change = 0.0f;
  for (int v = here; v < end; ++v) {
    const float coupling = -time * weights[v] * is_free[v] * is_free[v + 1];
    const float diagonal = raised_diagonal(mass[v], stiffness[v], before, weights[v], time);
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
  const float diagonal = raised_diagonal(mass[end], stiffness[end], before, weights[end], time);
  inverse_pivots[end] = 1.0f / fmax(diagonal + end_change, 1e-6f * diagonal);
}

// NDRange of this and precondition_columns: one work-group per four ints of `blocks`: first vertex in the first inner
// row, number of columns, distance between rows, number of rows; work-items take columns in turn. out  inverse_pivots,
// below: one plane each
__kernel void factor_columns(const int block_count, const int count, const float time,
                             __global const int* restrict blocks, __global const float* restrict weights,
                             __global const float* restrict mass, __global const float* restrict stiffness,
                             __global const float* restrict is_free, __global float* restrict inverse_pivots,
                             __global float* restrict below) {
  const int k = get_group_id(0);
  if (k >= block_count) return;
  const int first = blocks[4 * k], columns = blocks[4 * k + 1], stride = blocks[4 * k + 2], rows = blocks[4 * k + 3];
  __global const float* restrict ahead = weights + 2 * count;
  const int begin = get_local_id(0), step = get_local_size(0);
  for (int row = 0; row < rows; ++row) {
    const int here = first + row * stride, back = row > 0 ? stride : 0;
    for (int v = here + begin; v < here + columns; v += step) {
      const float before = back > 0 ? ahead[v - back] : 0.0f;
      const float eliminated = back > 0 ? time * before * is_free[v - back] * is_free[v] * below[v - back] : 0.0f;
      const float diagonal = raised_diagonal(mass[v], stiffness[v], before, ahead[v], time);
      const float inverse = 1.0f / fmax(diagonal + eliminated, 1e-6f * diagonal);
      inverse_pivots[v] = inverse;
      below[v] = row + 1 < rows ? -time * ahead[v] * is_free[v] * is_free[v + stride] * inverse : 0.0f;
    }
  }
}

// z = 1 / R r, in the rows. NDRange: rows; one work-item each does it, all components at once: their chains of
// dependent steps overlap.
__kernel void precondition_rows(const int row_count, const int components, const int count,
                                __global const int* restrict rows, __global const float* restrict inverse_pivots,
                                __global const float* restrict below, __global const float* restrict last,
                                __global const float* restrict r, __global float* restrict z) {
  const int k = get_group_id(0);
  if (k >= row_count || get_local_id(0) > 0) return;
  const int here = rows[4 * k], end = here + rows[4 * k + 1] - 1;
  // A field of one component is done three times over.
  const int second = components > 1 ? count : 0, third = 2 * second;
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

// z = is_free (z + 1 / C r), in the rows, and partial sums of r z. y: a field for use in between
__kernel void precondition_columns(const int block_count, const int components, const int count,
                                   __global const int* restrict blocks, __global const float* restrict inverse_pivots,
                                   __global const float* restrict below, __global const float* restrict is_free,
                                   __global const float* restrict r, __global float* restrict y,
                                   __global float* restrict z, __global float* restrict partials) {
  const int k = get_group_id(0);
  if (k >= block_count) return;
  const int first = blocks[4 * k], columns = blocks[4 * k + 1], stride = blocks[4 * k + 2], rows = blocks[4 * k + 3];
  const int begin = get_local_id(0), step = get_local_size(0);
  float sum = 0.0f;
  for (int c = 0; c < components; ++c) {
    __global const float* restrict from = r + c * count;
    __global float* restrict between = y + c * count;
    __global float* restrict to = z + c * count;
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

// z = 2 is_free r / D for the vertices in no row, from inner_count on. NDRange: work-items take them in turn.
// out  partials of r z, from `first_partial` on
__kernel void precondition_others(const int inner_count, const int components, const int count, const int first_partial,
                                  const float time, __global const float* restrict mass,
                                  __global const float* restrict stiffness, __global const float* restrict is_free,
                                  __global const float* restrict r, __global float* restrict z,
                                  __global float* restrict partials) {
  float sum = 0.0f;
  for (int v = inner_count + (int)get_global_id(0); v < count; v += get_global_size(0))
    for (int c = 0; c < components; ++c) {
      const float value = 2.0f * is_free[v] * r[c * count + v] / (mass[v] + time * stiffness[v] + 1e-35f);
      z[c * count + v] = value;
      sum += r[c * count + v] * value;
    }
  partials[first_partial + (int)get_global_id(0)] = sum;
}

// Levels: a lattice of about half of the rows and columns, see edit/coarsen.h. Each of its vertices lies at a vertex of
// this one (`picks`); a vertex here reads four of its values (`sources`, `shares`), and `readers` lists who reads
// which.

// The residual there: each vertex takes what its readers have, by their shares. NDRange: the coarser lattice's vertices
__kernel void restrict_field(const int coarse_count, const int components, const int count,
                             __global const int* restrict reader_begin, __global const int* restrict readers,
                             __global const float* restrict reader_shares, __global const float* restrict from,
                             __global float* restrict to) {
  const int v = get_global_id(0);
  if (v >= coarse_count) return;
  const int begin = reader_begin[v], end = reader_begin[v + 1];
  for (int c = 0; c < components; ++c) {
    float sum = 0.0f;
    for (int i = begin; i < end; ++i) sum += reader_shares[i] * from[c * count + readers[i]];
    to[c * coarse_count + v] = sum;
  }
}

// z += is_free times what the coarser lattice has at each vertex, and partial sums of r times that.
// NDRange: one work-group per VERTEX_CHUNK vertices. out  partials, from `first_partial` on
__kernel void add_coarse_field(const int components, const int count, const int coarse_count, const int first_partial,
                               __global const int* restrict sources, __global const float* restrict shares,
                               __global const float* restrict is_free, __global const float* restrict coarse,
                               __global const float* restrict r, __global float* restrict z,
                               __global float* restrict partials) {
  const int begin = get_group_id(0) * VERTEX_CHUNK, end = min(begin + VERTEX_CHUNK, count);
  float sum = 0.0f;
  for (int v = begin + (int)get_local_id(0); v < end; v += get_local_size(0)) {
    const int s0 = sources[4 * v], s1 = sources[4 * v + 1], s2 = sources[4 * v + 2], s3 = sources[4 * v + 3];
    const float w0 = is_free[v] * shares[4 * v], w1 = is_free[v] * shares[4 * v + 1],
                w2 = is_free[v] * shares[4 * v + 2];
    const float w3 = is_free[v] * shares[4 * v + 3];
    for (int c = 0; c < components; ++c) {
      __global const float* restrict from = coarse + c * coarse_count;
      const float value = w0 * from[s0] + w1 * from[s1] + w2 * from[s2] + w3 * from[s3];
      z[c * count + v] += value;
      sum += r[c * count + v] * value;
    }
  }
  partials[first_partial + (int)get_global_id(0)] = sum;
}

// r = is_free b, x = 0, p = 0. NDRange of this and the next two: one work-group per VERTEX_CHUNK values of the fields.
__kernel void begin_solve(const int values, const int count, __global const float* restrict is_free,
                          __global const float* restrict b, __global float* restrict x, __global float* restrict r,
                          __global float* restrict p) {
  const int begin = get_group_id(0) * VERTEX_CHUNK, end = min(begin + VERTEX_CHUNK, values);
  for (int i = begin + (int)get_local_id(0); i < end; i += get_local_size(0)) {
    x[i] = 0.0f;
    r[i] = is_free[i < count ? i : i < 2 * count ? i - count : i - 2 * count] * b[i];
    p[i] = 0.0f;
  }
}

// x += a p, r -= a q, where a = (r z) / (p q). scalars: sums, by slot
__kernel void take_step(const int values, const int rz, const int pq, __global const float* restrict scalars,
                        __global const float* restrict p, __global const float* restrict q, __global float* restrict x,
                        __global float* restrict r) {
  const int begin = get_group_id(0) * VERTEX_CHUNK, end = min(begin + VERTEX_CHUNK, values);
  const float length = scalars[pq] > 0.0f ? scalars[rz] / scalars[pq] : 0.0f;
  for (int i = begin + (int)get_local_id(0); i < end; i += get_local_size(0)) {
    x[i] += length * p[i];
    r[i] -= length * q[i];
  }
}

// p = z + (new r z) / (old r z) p.
__kernel void turn_direction(const int values, const int old_rz, const int new_rz,
                             __global const float* restrict scalars, __global const float* restrict z,
                             __global float* restrict p) {
  const int begin = get_group_id(0) * VERTEX_CHUNK, end = min(begin + VERTEX_CHUNK, values);
  const float kept = scalars[old_rz] > 0.0f ? scalars[new_rz] / scalars[old_rz] : 0.0f;
  for (int i = begin + (int)get_local_id(0); i < end; i += get_local_size(0)) p[i] = z[i] + kept * p[i];
}
