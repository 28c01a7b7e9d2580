// SPDX-License-Identifier: MIT
// Vertex-sampling-maximizing maps of all charts together (design: docs/parameterization.md).
//
// Vertices of all charts lie in one list: each chart has a block that begins at a multiple of VSM_SLICE and holds its
// inner vertices first, then its fixed ones. A vertex's map is (u, v) = (hi + lo)[2 * vertex], [2 * vertex + 1].
// Rows of the sparse systems are the inner vertices. Their entries, one per neighbour, lie in slices of VSM_SLICE rows,
// column-major inside a slice: entry k of row i is slice_begin[i / VSM_SLICE] + k * VSM_SLICE + i % VSM_SLICE.
// Per entry: column (the neighbour), jump (lifted v of the neighbour = v + jump; VSM_POLE: the neighbour is a pole,
// which acts through u only), weight = mantissa * 2^exponent. Both directions of an edge carry the same weight bits.

#ifndef VSM_SLICE
#define VSM_SLICE 32
#endif
#define VSM_POLE (-128)

int entry_index(global const int* restrict slice_begin, int row, int k) {
  return slice_begin[row / VSM_SLICE] + k * VSM_SLICE + row % VSM_SLICE;
}

// (b - a) + jump of two values that are each a sum of two floats. Rounded once, relative to the result: the rounding
// error of b_hi - a_hi is kept, because across the cut jump cancels nearly all of it.
float lifted_difference(float a_hi, float a_lo, float b_hi, float b_lo, float jump) {
  const float difference = b_hi - a_hi;
  const float part = difference - b_hi;
  const float error = (b_hi - (difference - part)) - (a_hi + part);
  return (difference + jump) + (error + (b_lo - a_lo));
}

// Texture area of each triangle, in (v, u); for a pole's triangle that of the trapezoid between its opposite edge and
// the pole's line. A pole is always corner 0. Never below a rounding error's worth, so that weights stay positive.
// In: corners (3 planes of `count` vertices), jumps (2 planes: corners 1 and 2 against corner 0; with a pole the first
// is VSM_POLE and the second that of corner 2 against corner 1). Out: areas. NDRange: triangles.
kernel void measure_areas(int count, global const int* restrict corners, global const char* restrict jumps, global const float* restrict hi,
                          global const float* restrict lo, global float* restrict areas) {
  const int t = get_global_id(0);
  if (t >= count) return;
  const int a = 2 * corners[t], b = 2 * corners[count + t], c = 2 * corners[2 * count + t];
  const int jump_b = jumps[t], jump_c = jumps[count + t];
  const float ub = lifted_difference(hi[a], lo[a], hi[b], lo[b], 0.0f);
  const float uc = lifted_difference(hi[a], lo[a], hi[c], lo[c], 0.0f);
  float first, second;
  if (jump_b == VSM_POLE) {
    first = lifted_difference(hi[b + 1], lo[b + 1], hi[c + 1], lo[c + 1], jump_c) * (-0.5f * (ub + uc));
    second = 0.0f;
  } else {
    first = 0.5f * lifted_difference(hi[a + 1], lo[a + 1], hi[b + 1], lo[b + 1], jump_b) * uc;
    second = 0.5f * lifted_difference(hi[a + 1], lo[a + 1], hi[c + 1], lo[c + 1], jump_c) * ub;
  }
  areas[t] = fmax(first - second, fmax(1e-7f * (fabs(first) + fabs(second)), 1e-36f));
}

// Multiplies each entry's weight by (A_left + A_right) * factor, where factor = 1 / A3^alpha, unless the row's slice is
// frozen (first solve, or a chart that has stopped: weights as they are). Then normalises each row: share = weight / d with
// d the row's sum = sum * 2^row_exponent, poles included; v_part is the share of d that does not belong to poles.
// In: frozen (per slice), triangles (2 planes of `entries`: the two at the edge), factors. In and out: mantissas, exponents.
// Out: shares, sums, row_exponents, v_parts. NDRange: vertices.
kernel void weigh_rows(int vertices, int entries, global const int* restrict frozen, global const int* restrict slice_begin,
                       global const int* restrict row_length, global const char* restrict jumps, global const int* restrict triangles,
                       global const float* restrict factors, global const float* restrict areas, global float* restrict mantissas,
                       global int* restrict exponents, global float* restrict shares, global float* restrict sums,
                       global int* restrict row_exponents, global float* restrict v_parts) {
  const int row = get_global_id(0);
  if (row >= vertices) return;
  const int length = row_length[row];
  if (length == 0) return;
  const int is_frozen = frozen[row / VSM_SLICE];
  int largest = INT_MIN;
  for (int k = 0; k < length; ++k) {
    const int e = entry_index(slice_begin, row, k);
    if (!is_frozen) {
      int shift, exponent;
      const float grown = frexp((areas[triangles[e]] + areas[triangles[entries + e]]) * factors[e], &shift);
      mantissas[e] = frexp(mantissas[e] * grown, &exponent);
      exponents[e] += shift + exponent;
    }
    largest = max(largest, exponents[e]);
  }
  float sum = 0.0f, v_sum = 0.0f;
  for (int k = 0; k < length; ++k) {
    const int e = entry_index(slice_begin, row, k);
    const float weight = ldexp(mantissas[e], exponents[e] - largest);
    sum += weight;
    v_sum += jumps[e] == VSM_POLE ? 0.0f : weight;
    shares[e] = weight;
  }
  for (int k = 0; k < length; ++k) shares[entry_index(slice_begin, row, k)] /= sum;
  sums[row] = sum;
  row_exponents[row] = largest;
  v_parts[row] = v_sum / sum;
}

// The symmetric matrix scaled to a unit diagonal: a_ij = w_ij / sqrt(d_i d_j) = sqrt(share_ij share_ji); 0 where the
// neighbour is fixed (twin -1). NDRange: vertices.
kernel void scale_entries(int vertices, global const int* restrict slice_begin, global const int* restrict row_length, global const int* restrict twins,
                          global const float* restrict shares, global float* restrict scaled) {
  const int row = get_global_id(0);
  if (row >= vertices) return;
  const int length = row_length[row];
  for (int k = 0; k < length; ++k) {
    const int e = entry_index(slice_begin, row, k);
    const int twin = twins[e];
    scaled[e] = twin < 0 ? 0.0f : sqrt(shares[e]) * sqrt(shares[twin]);
  }
}

// A work-group per chart. VSM_SINGLE: groups of one work-item, which need no barriers; CPU compilers turn each barrier in a
// loop into a loop over work-items, which takes them seconds to tens of seconds here.
#ifdef VSM_SINGLE
#define VSM_GROUP __attribute__((reqd_work_group_size(1, 1, 1)))
#define VSM_BARRIER()
#else
#define VSM_GROUP
#define VSM_BARRIER() barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE)
#endif

// Sum (or maximum) of one value per work-item, the same for all of them; the order of additions is fixed. In two stages
// of about sqrt(group size) values each, so the number of barriers is fixed too. What the group wrote before is visible to
// all of it afterwards.
// Local: scratch, VSM_STRIDE floats more than work-items.
#define VSM_STRIDE 32
float reduce_group(local float* scratch, float value, int is_maximum) {
#ifdef VSM_SINGLE
  return value;
#else
  const int lane = get_local_id(0), count = get_local_size(0);
  VSM_BARRIER();
  scratch[lane] = value;
  barrier(CLK_LOCAL_MEM_FENCE);
  local float* const stage = scratch + count;
  const int used = min(count, VSM_STRIDE);
  if (lane < used) {
    float part = scratch[lane];
    for (int k = lane + VSM_STRIDE; k < count; k += VSM_STRIDE) part = is_maximum ? fmax(part, scratch[k]) : part + scratch[k];
    stage[lane] = part;
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  float total = stage[0];
  for (int k = 1; k < used; ++k) total = is_maximum ? fmax(total, stage[k]) : total + stage[k];
  return total;
#endif
}

// The next chart of the queue, the same for all work-items of a group: groups take charts, largest first, so any number
// of groups will do and none waits for another. Which group takes which chart has no influence on results.
int take_chart(global int* queue, local int* taken) {
  VSM_BARRIER();
  if (get_local_id(0) == 0) *taken = atomic_inc(queue);
  VSM_BARRIER();
  return *taken;
}

// The coarse half of the preconditioner I + P C P^T of the scaled matrix A: a chart's rows are grouped into cells of
// neighbours; column I of P is sqrt(d_i) at the rows i of cell I and 0 elsewhere, times what gives P^T A P a unit diagonal;
// C is the inverse of P^T A P. Poles count as fixed neighbours: that is u's matrix, and near enough to v's.
// In: cell_first (per chart: its place in cell_begin and in coarse vectors), cell_counts, cell_begin (per chart the cells'
// first rows, and the end), row_cells (the cell of each row).
// Out: roots_i = sqrt(d_i) relative to the chart's largest; basis, the entries of P, one per row; inverses, per chart *minus*
// C, symmetric, from matrix_begin on, each row padded with zeros to a multiple of VSM_BLOCK.
// Work space: pivots, a coarse vector. Local: scratch (see reduce_group). NDRange: any number of work-groups.
#define VSM_BLOCK 8
kernel VSM_GROUP void invert_coarse(int charts, global int* restrict queue, global const int* restrict order, global const int* restrict chart_begin,
                          global const int* restrict chart_rows, global const int* restrict cell_first, global const int* restrict cell_counts,
                          global const int* restrict cell_begin, global const int* restrict row_cells, global const int* restrict matrix_begin,
                          global const int* restrict slice_begin, global const int* restrict row_length, global const int* restrict column,
                          global const float* restrict shares, global const float* restrict scaled, global const float* restrict sums,
                          global const int* restrict row_exponents, global float* restrict roots, global float* restrict basis,
                          global float* restrict inverses, global float* restrict pivots, local float* restrict scratch) {
  const int lane = get_local_id(0), lanes = get_local_size(0);
  local int taken;
  for (int position = take_chart(queue, &taken); position < charts; position = take_chart(queue, &taken)) {
    const int chart = order[position], begin = chart_begin[chart], end = begin + chart_rows[chart];
    float largest = -1e30f;
    for (int i = begin + lane; i < end; i += lanes) largest = fmax(largest, (float)row_exponents[i]);
    largest = reduce_group(scratch, largest, 1);
    for (int i = begin + lane; i < end; i += lanes) {
      const int exponent = max(row_exponents[i] - (int)largest, -260) + 80;
      roots[i] = ldexp(sqrt(exponent & 1 ? 2.0f * sums[i] : sums[i]), exponent >> 1);
    }
    VSM_BARRIER();

    const int cells = cell_counts[chart], width = (cells + VSM_BLOCK - 1) / VSM_BLOCK * VSM_BLOCK;
    global const int* first_row = cell_begin + cell_first[chart];
    global float* matrix = inverses + matrix_begin[chart];
    global float* pivot = pivots + cell_first[chart];
    for (int k = lane; k < cells * width; k += lanes) matrix[k] = 0.0f;
    // A column's product with A is what leaves the cell, summed without cancellation, in units of the cell's largest root.
    for (int cell = lane; cell < cells; cell += lanes) {
      float unit = 0.0f, leaving = 0.0f;
      for (int i = first_row[cell]; i < first_row[cell + 1]; ++i) unit = fmax(unit, roots[i]);
      for (int i = first_row[cell]; i < first_row[cell + 1]; ++i) {
        float outside = 0.0f;
        for (int k = 0; k < row_length[i]; ++k) {
          const int e = entry_index(slice_begin, i, k), j = column[e];
          const int is_outside = j < first_row[cell] || j >= first_row[cell + 1];
          outside += is_outside ? shares[e] : 0.0f;
        }
        leaving += outside * (roots[i] / unit) * (roots[i] / unit);
      }
      const float scale = leaving > 0.0f ? 1.0f / (unit * sqrt(leaving)) : 0.0f;
      for (int i = first_row[cell]; i < first_row[cell + 1]; ++i) basis[i] = roots[i] * scale;
    }
    VSM_BARRIER();
    for (int cell = lane; cell < cells; cell += lanes) {
      for (int i = first_row[cell]; i < first_row[cell + 1]; ++i)
        for (int k = 0; k < row_length[i]; ++k) {
          const int e = entry_index(slice_begin, i, k), j = column[e];
          const int is_outside = j < first_row[cell] || j >= first_row[cell + 1];
          if (is_outside && j < end) matrix[cell * width + row_cells[j]] -= scaled[e] * (basis[i] * basis[j]);
        }
      matrix[cell * width + cell] = 1.0f;
    }
    VSM_BARRIER();
    // The sweep operator (Beaton 1964) on every row in turn leaves minus the inverse. The matrix stays symmetric, so a pivot's
    // row is read off its column; positive definite matrices need no other order. The floor is far below such pivots.
    for (int k = 0; k < cells; ++k) {
      for (int i = lane; i < cells; i += lanes) pivot[i] = matrix[i * width + k];
      for (int i = cells + lane; i < width; i += lanes) pivot[i] = 0.0f;
      VSM_BARRIER();
      const float over = 1.0f / fmax(pivot[k], 1e-5f);
      for (int i = lane; i < cells; i += lanes) {
        const float factor = pivot[i];
        for (int block = 0; block < width / VSM_BLOCK; ++block) {
          const float8 values = vload8(block, pivot);
          vstore8(i == k ? values * over : vload8(block, matrix + i * width) - (factor * values) * over, block, matrix + i * width);
        }
        matrix[i * width + k] = i == k ? -over : factor * over;
      }
      VSM_BARRIER();
    }
  }
}

// Preconditioned conjugate gradients on the scaled systems, u and v as one vector (interleaved), a work-group per chart.
// Every `check_steps` steps the correction is added to the map and the true residual is formed from differences of
// neighbours, so that it is accurate relative to them however small they are.
// Stops when max over rows of |x_i - mean of neighbours| / mean |x_i - x_j| <= tolerance, or after max_steps.
// All loops around barriers run on values that are the same for the whole group.
// In: order (charts, largest first), the systems and what invert_coarse made; queue (1 int, 0). In and out: hi, lo.
// Work space of 2 floats per vertex: residual, direction (0 at fixed vertices), product, correction (0); coarse: 4 planes
// of `coarse_size` floats (a coarse vector and its image, u and v). Out: steps (added to), ratios, per chart.
// Local: scratch (see reduce_group). NDRange: any number of work-groups.
kernel VSM_GROUP void solve_charts(int charts, float tolerance, int max_steps, int check_steps, int coarse_size, global int* restrict queue,
                         global const int* restrict order, global const int* restrict chart_begin, global const int* restrict chart_rows,
                         global const int* restrict cell_first, global const int* restrict cell_counts, global const int* restrict cell_begin,
                         global const int* restrict row_cells, global const int* restrict matrix_begin, global const int* restrict slice_begin,
                         global const int* restrict row_length, global const int* restrict column, global const char* restrict jumps,
                         global const float* restrict shares, global const float* restrict scaled, global const float* restrict v_parts,
                         global const float* restrict roots, global const float* restrict basis, global const float* restrict inverses,
                         global float* restrict hi, global float* restrict lo, global float* restrict residual, global float* restrict direction,
                         global float* restrict product, global float* restrict correction, global float* restrict coarse,
                         global int* restrict steps, global float* restrict ratios, local float* restrict scratch) {
  const int lane = get_local_id(0), lanes = get_local_size(0);
  local int taken;
  for (int position = take_chart(queue, &taken); position < charts; position = take_chart(queue, &taken)) {
    const int chart = order[position], begin = chart_begin[chart], end = begin + chart_rows[chart];
    const int cells = cell_counts[chart], width = (cells + VSM_BLOCK - 1) / VSM_BLOCK * VSM_BLOCK;
    global const int* first_row = cell_begin + cell_first[chart];
    global const float* inverse = inverses + matrix_begin[chart];
    global float* coarse_u = coarse + cell_first[chart];
    global float* coarse_v = coarse_u + coarse_size;
    global float* image_u = coarse_v + coarse_size;
    global float* image_v = image_u + coarse_size;

    // energy: residual times preconditioned residual; norm: this work-item's part of the same without the coarse half.
    int step = 0, is_going = 1, is_stuck = 0;
    // Both in units of the residual's largest entry at the last start, because entries are as far apart as weights are.
    float energy = 1.0f, norm = 0.0f, ratio = 0.0f, unit = 1.0f;
    while (is_going) {
      int is_restart = 0;
      if (step % check_steps == 0) {
        // The correction goes to the map; the rounding error of the sum is kept in `lo`.
        for (int i = 2 * begin + lane; i < 2 * end; i += lanes) {
          const float change = lo[i] + correction[i] * (unit / roots[i / 2]);
          const float sum = hi[i] + change;
          const float part = sum - hi[i];
          lo[i] = (hi[i] - (sum - part)) + (change - part);
          hi[i] = sum;
          correction[i] = 0.0f;
        }
        VSM_BARRIER();
        // The true residual goes to `product`, but only in the rows that are not good enough yet: without this, rows of
        // large weight, whose rounding errors outweigh all of a row of tiny weight, would blind the method to it.
        float largest = 0.0f;
        ratio = 0.0f;
        for (int i = begin + lane; i < end; i += lanes) {
          const float u_hi = hi[2 * i], u_lo = lo[2 * i], v_hi = hi[2 * i + 1], v_lo = lo[2 * i + 1];
          const int length = row_length[i];
          float ru = 0.0f, rv = 0.0f, mu = 0.0f, mv = 0.0f;
          for (int k = 0; k < length; ++k) {
            const int e = entry_index(slice_begin, i, k), j = 2 * column[e];
            const int jump = jumps[e];
            const float share = shares[e];
            const float du = share * ((hi[j] - u_hi) + (lo[j] - u_lo));
            const float dv = jump == VSM_POLE ? 0.0f : share * lifted_difference(v_hi, v_lo, hi[j + 1], lo[j + 1], jump);
            ru += du;
            rv += dv;
            mu += fabs(du);
            mv += fabs(dv);
          }
          const float ratio_u = fabs(ru) / (mu + 1e-13f), ratio_v = fabs(rv) / (mv + 1e-13f);
          ratio = fmax(ratio, fmax(ratio_u, ratio_v));
          ru = ratio_u > 0.1f * tolerance ? ru * roots[i] : 0.0f;
          rv = ratio_v > 0.1f * tolerance ? rv * roots[i] : 0.0f;
          product[2 * i] = ru;
          product[2 * i + 1] = rv;
          largest = fmax(largest, fmax(fabs(ru), fabs(rv)));
        }
        ratio = reduce_group(scratch, ratio, 1);
        largest = reduce_group(scratch, largest, 1);
        float true_norm = 0.0f;
        for (int i = begin + lane; i < end; i += lanes) {
          const float ru = product[2 * i] / largest, rv = product[2 * i + 1] / largest;
          true_norm += ru * ru + rv * rv / v_parts[i];
        }
        const float expected = reduce_group(scratch, norm, 0), found = reduce_group(scratch, true_norm, 0);
        const float change = largest / unit;
        is_going = ratio > tolerance && step < max_steps && largest > 0.0f;
        // Go on as long as the recursive residual says the same as the true one, else start again from the true one.
        is_restart = is_stuck || !(found * change * change < 4.0f * expected);
        if (is_restart) {
          is_stuck = 0;
          unit = largest;
          norm = true_norm;
          for (int i = 2 * begin + lane; i < 2 * end; i += lanes) {
            residual[i] = product[i] / unit;
            direction[i] = 0.0f;
          }
          VSM_BARRIER();
        }
      }
      if (is_going) {
        // The coarse half of the preconditioner.
        for (int cell = lane; cell < width; cell += lanes) {
          float tu = 0.0f, tv = 0.0f;
          if (cell < cells)
            for (int i = first_row[cell]; i < first_row[cell + 1]; ++i) {
              tu += basis[i] * residual[2 * i];
              tv += basis[i] * residual[2 * i + 1];
            }
          coarse_u[cell] = tu;
          coarse_v[cell] = tv;
        }
        VSM_BARRIER();
        float new_energy = norm;
        for (int block = lane; block < width / VSM_BLOCK; block += lanes) {
          float8 yu = 0.0f, yv = 0.0f;
          for (int k = 0; k < cells; ++k) {
            const float8 values = vload8(block, inverse + k * width);
            yu -= values * coarse_u[k];
            yv -= values * coarse_v[k];
          }
          vstore8(yu, block, image_u);
          vstore8(yv, block, image_v);
          const float8 both = yu * vload8(block, coarse_u) + yv * vload8(block, coarse_v);
          new_energy += ((both.s0 + both.s1) + (both.s2 + both.s3)) + ((both.s4 + both.s5) + (both.s6 + both.s7));
        }
        new_energy = reduce_group(scratch, new_energy, 0);
        // The next direction, its product with the matrix, and the step along it.
        const float beta = is_restart ? 0.0f : new_energy / energy;
        energy = new_energy;
        for (int i = begin + lane; i < end; i += lanes) {
          const int cell = row_cells[i];
          direction[2 * i] = residual[2 * i] + basis[i] * image_u[cell] + beta * direction[2 * i];
          direction[2 * i + 1] = residual[2 * i + 1] / v_parts[i] + basis[i] * image_v[cell] + beta * direction[2 * i + 1];
        }
        VSM_BARRIER();
        float curvature = 0.0f;
        for (int i = begin + lane; i < end; i += lanes) {
          const int length = row_length[i];
          const float pu = direction[2 * i], pv = direction[2 * i + 1];
          float qu = pu, qv = v_parts[i] * pv;
          for (int k = 0; k < length; ++k) {
            const int e = entry_index(slice_begin, i, k), j = 2 * column[e];
            const float a = scaled[e];
            qu -= a * direction[j];
            qv -= a * direction[j + 1];
          }
          product[2 * i] = qu;
          product[2 * i + 1] = qv;
          curvature += pu * qu + pv * qv;
        }
        curvature = reduce_group(scratch, curvature, 0);
        is_stuck = is_stuck || !(curvature > 0.0f);  // rounding errors only: stands still until the next look
        const float alpha = is_stuck ? 0.0f : energy / curvature;
        norm = 0.0f;
        for (int i = begin + lane; i < end; i += lanes) {
          const float ru = residual[2 * i] - alpha * product[2 * i], rv = residual[2 * i + 1] - alpha * product[2 * i + 1];
          residual[2 * i] = ru;
          residual[2 * i + 1] = rv;
          correction[2 * i] += alpha * direction[2 * i];
          correction[2 * i + 1] += alpha * direction[2 * i + 1];
          norm += ru * ru + rv * rv / v_parts[i];
        }
        VSM_BARRIER();
        ++step;
      }
    }
    if (lane == 0) {
      steps[chart] += step;
      ratios[chart] = ratio;
    }
  }
}
