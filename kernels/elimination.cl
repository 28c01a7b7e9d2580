// SPDX-License-Identifier: MIT
// Sparse elimination of many symmetric systems at once, each for two right sides.
//
// A system has a row per unknown, scaled to a unit diagonal: x_i = sum over neighbours j of a_ij root_j / root_i x_j,
// where a_ij > 0 and fixed vertices are among the neighbours. To eliminate vertex k is to join its neighbours i and j
// by a_ik a_kj / d_k more (a star becomes a mesh), where d_k, the diagonal entry then, is the sum of a_kj root_j /
// root_k over all j that are left, the fixed vertices among them. Nothing is ever subtracted (Grassmann, Taksar and
// Heyman 1985), so every entry is accurate to a few rounding errors of its own, however far apart weights are, and
// single precision will do.
//
// Vertices are eliminated by fronts (Duff and Reid 1983). A front is a dense matrix of its pivots and its boundary, the
// sum of entries of the system and of what its children have left between their boundaries. It keeps its pivots' rows,
// of which columns up to a row's own are 0; its boundary's rows go to its parent. Of these only tiles on and above the
// diagonal are kept.
//
// A task is a run of fronts that one work-group takes one by one: a subtree. Tasks of one stage are independent;
// parents are in the same task or in a later stage.

#include "elimination_structs.h"
#include "work_group.h"

float sum8(float8 x) { return ((x.s0 + x.s1) + (x.s2 + x.s3)) + ((x.s4 + x.s5) + (x.s6 + x.s7)); }

// target[k] (0 if `is_new`) += row k of a tile's rows times x, both from `begin` to `end`.
void multiply_rows(global const float* rows, int width, int begin, int end, global const float* x, int is_new,
                   global float* target) {
  for (int k = GROUP_ITEM; k < ELIMINATION_TILE; k += GROUP_ITEMS) {
    float8 sum = 0.0f;
    for (int column = begin; column < end; column += ELIMINATION_TILE)
      sum += vload8(0, rows + k * width + column) * vload8(0, x + column);
    target[k] = is_new ? sum8(sum) : target[k] + sum8(sum);
  }
}

// The next task of a queue, the same for all work-items of a group: any number of groups will do and none waits for
// another. Which group takes which task has no influence on results.
int take_task(global int* queue, local int* taken) {
  GROUP_BARRIER();
  if (GROUP_ITEM == 0) *taken = atomic_inc(queue);
  GROUP_BARRIER();
  return *taken;
}

int padded(int count) { return (count + ELIMINATION_TILE - 1) / ELIMINATION_TILE * ELIMINATION_TILE; }

// Where column 0 of a row of the boundary's matrix would be: rows begin at their diagonal tile.
int rest_row(int width, int row) {
  const int above = row / ELIMINATION_TILE * ELIMINATION_TILE;
  return above * width - above / 2 * (above - ELIMINATION_TILE) + (row - above) * (width - above) - above;
}

// target, a tile (0 if `is_new`), += what the elimination of `pivots` vertices joins its rows and columns by. rows: the
// pivots' rows, from the first column on.
void update_tile(global const float* rows, int width, global const float* inverse, int pivots, int row, int column,
                 int is_new, global float* target, int stride) {
  float8 sums[ELIMINATION_TILE];
#pragma unroll
  for (int i = 0; i < ELIMINATION_TILE; ++i) sums[i] = is_new ? (float8)0.0f : vload8(0, target + i * stride);
  for (int k = 0; k < pivots; ++k) {
    global const float* from = rows + k * width + row;
    const float8 to = vload8(0, rows + k * width + column) * inverse[k];
#pragma unroll
    for (int i = 0; i < ELIMINATION_TILE; ++i) sums[i] += from[i] * to;
  }
#pragma unroll
  for (int i = 0; i < ELIMINATION_TILE; ++i) vstore8(sums[i], 0, target + i * stride);
}

// A front's matrix and its four vectors.
typedef struct FrontView {
  int pivots, boundary, width;  // padded
  global float* rows;           // of the pivots
  global float* rest;           // rows of the boundary, see rest_row
  global float* root;           // of the columns: roots; 1 for the fixed column
  global float* u;              // of the first right side: residual, what is carried up, or solution
  global float* v;              // of the second
  global float* inverse;        // 1 / d of the pivots
} FrontView;

FrontView view_front(global const FrontRecord* front, global float* matrices, global float* vectors) {
  FrontView view;
  view.pivots = padded(front->pivots);
  view.boundary = padded(front->boundary);
  view.width = view.pivots + view.boundary;
  view.rows = matrices + (size_t)front->rows * ELIMINATION_TILE;
  view.rest = matrices + (size_t)front->rest * ELIMINATION_TILE;
  view.root = vectors + (size_t)front->vectors * ELIMINATION_TILE;
  view.u = view.root + view.width;
  view.v = view.u + view.width;
  view.inverse = view.v + view.width;
  return view;
}

// The entries of the system in the pivots' rows, and the roots of all columns.
GROUP_FUNCTION void fill_front(FrontView front, global const FrontRecord* record, EliminationLayout at,
                               global const int* tables, global const float* system) {
  const int item = GROUP_ITEM, items = GROUP_ITEMS, first = record->first, pivots = record->pivots;
  const int fixed_column = front.pivots + record->boundary - 1;
  global const float* roots = system + at.roots;
  global const int* boundary = tables + at.boundary_rows + record->list;
  for (int k = 0; k < front.pivots; ++k)
    for (int column = k / ELIMINATION_TILE * ELIMINATION_TILE + item * ELIMINATION_TILE; column < front.width;
         column += items * ELIMINATION_TILE)
      vstore8(0.0f, 0, front.rows + k * front.width + column);
  for (int j = item; j < front.width; j += items) {
    const int i = j - front.pivots;
    front.root[j] = j < pivots                   ? roots[first + j]
                    : j == fixed_column          ? 1.0f
                    : i >= 0 && j < fixed_column ? roots[boundary[i]]
                                                 : 0.0f;
  }
  GROUP_BARRIER();
  // Where the two matrices differ, the second one has a front of its own.
  global const float* fixed = system + at.fixed + (record->axes == 2 ? at.rows : 0);
  global const int* row_begin = tables + at.row_begin;
  global const int* columns = tables + at.columns;
  for (int k = item; k < pivots; k += items) {
    const int row = first + k;
    for (int e = row_begin[row]; e < row_begin[row + 1]; ++e) front.rows[k * front.width + columns[e]] = system[e];
    front.rows[k * front.width + fixed_column] = fixed[row] * front.root[k];
  }
  GROUP_BARRIER();
}

// Adds what a child has left between its boundary's vertices: rows from begin to end of its boundary.
GROUP_FUNCTION void add_rows(FrontView to, FrontView from, int begin, int end, int boundary,
                             global const int* columns) {
  for (int i = begin + GROUP_ITEM; i < end; i += GROUP_ITEMS) {
    global const float* source = from.rest + rest_row(from.boundary, i);
    global float* row = columns[i] < to.pivots ? to.rows + columns[i] * to.width
                                               : to.rest + rest_row(to.boundary, columns[i] - to.pivots) - to.pivots;
    for (int j = i + 1; j < boundary; ++j) row[columns[j]] += source[j];
  }
}

// Adds what the children have left to the rows of this front's pivots (if `is_pivots`), or of its boundary.
void add_children(FrontView front, global const FrontRecord* record, int is_pivots, EliminationLayout at,
                  global const FrontRecord* fronts, global const int* tables, global float* matrices,
                  global float* vectors) {
  for (int c = record->child_begin; c < record->child_end; ++c) {
    global const FrontRecord* child = fronts + tables[at.children + c];
    add_rows(front, view_front(child, matrices, vectors), is_pivots ? 0 : child->shared,
             is_pivots ? child->shared : child->boundary - 1, child->boundary,
             tables + at.parent_columns + child->list);
    GROUP_BARRIER();
  }
}

// Eliminates the rows of a diagonal tile, by one work-item. Below the diagonal the tile gets a_ki / d_k. after: per row
// what joins it to all columns after the tile's.
void factor_tile(global float* tile, int width, global const float* root, global float* inverse, global float* after) {
  for (int k = 0; k < ELIMINATION_TILE; ++k) {
    float left = after[k];
    for (int j = k + 1; j < ELIMINATION_TILE; ++j) left += tile[k * width + j] * root[j];
    // Nothing is left of padding, and of the last vertex where nothing is fixed: its value may be any.
    const float over = left > 0.0f ? root[k] / left : 0.0f;
    inverse[k] = over;
    for (int i = k + 1; i < ELIMINATION_TILE; ++i) {
      const float factor = tile[k * width + i] * over;
      tile[i * width + k] = factor;
      after[i] += factor * after[k];
      for (int j = i + 1; j < ELIMINATION_TILE; ++j) tile[i * width + j] += factor * tile[k * width + j];
    }
  }
}

// Eliminates the pivots, a tile's rows at a time.
GROUP_FUNCTION void factor(FrontView front) {
  const int item = GROUP_ITEM, items = GROUP_ITEMS, width = front.width;
  for (int block = 0; block < front.pivots; block += ELIMINATION_TILE) {
    global float* tile = front.rows + block * width + block;
    for (int column = block + item * ELIMINATION_TILE; column < width; column += items * ELIMINATION_TILE)
      update_tile(front.rows, width, front.inverse, block, block, column, 0, front.rows + block * width + column,
                  width);
    GROUP_BARRIER();
    // What joins a row to all columns after the tile's acts as one more column of the tile.
    multiply_rows(tile, width, ELIMINATION_TILE, width - block, front.root + block, 1, front.u + block);
    GROUP_BARRIER();
    if (item == 0) factor_tile(tile, width, front.root + block, front.inverse + block, front.u + block);
    GROUP_BARRIER();
    for (int column = (1 + item) * ELIMINATION_TILE; column < width - block; column += items * ELIMINATION_TILE) {
      float8 values[ELIMINATION_TILE];
#pragma unroll
      for (int i = 0; i < ELIMINATION_TILE; ++i) {
        values[i] = vload8(0, tile + i * width + column);
#pragma unroll
        for (int k = 0; k < i; ++k) values[i] += tile[i * width + k] * values[k];
        vstore8(values[i], 0, tile + i * width + column);
      }
    }
    GROUP_BARRIER();
  }
  // What joins the boundary's vertices then; its memory is not written before.
  for (int i = 0; i < front.boundary; i += ELIMINATION_TILE)
    for (int j = i + item * ELIMINATION_TILE; j < front.boundary; j += items * ELIMINATION_TILE)
      update_tile(front.rows, width, front.inverse, front.pivots, front.pivots + i, front.pivots + j, 1,
                  front.rest + rest_row(front.boundary, i) + j, front.boundary - i);
}

// The right sides of a front: the pivots' residuals, and what the children have carried up.
void fill_right_sides(FrontView front, global const FrontRecord* record, EliminationLayout at,
                      global const FrontRecord* fronts, global const int* tables, global const float* system,
                      global float* matrices, global float* vectors) {
  for (int j = GROUP_ITEM; j < front.width; j += GROUP_ITEMS) {
    const float2 value = j < record->pivots ? vload2(record->first + j, system + at.residual) : (float2)0.0f;
    front.u[j] = value.x;
    front.v[j] = value.y;
  }
  GROUP_BARRIER();
  for (int c = record->child_begin; c < record->child_end; ++c) {
    global const FrontRecord* child = fronts + tables[at.children + c];
    const FrontView from = view_front(child, matrices, vectors);
    for (int i = GROUP_ITEM; i < child->boundary - 1; i += GROUP_ITEMS) {
      const int column = tables[at.parent_columns + child->list + i];
      front.u[column] += from.u[from.pivots + i];
      front.v[column] += from.v[from.pivots + i];
    }
    GROUP_BARRIER();
  }
}

// Carries the pivots' residuals to the boundary.
GROUP_FUNCTION void carry_up(FrontView front) {
  for (int block = 0; block < front.pivots; block += ELIMINATION_TILE) {
    global const float* rows = front.rows + block * front.width;
    global float* u = front.u + block;
    global float* v = front.v + block;
    global const float* inverse = front.inverse + block;
    if (GROUP_ITEM == 0) {
      // In registers: each value waits for the one before.
      float own_u[ELIMINATION_TILE], own_v[ELIMINATION_TILE];
#pragma unroll
      for (int j = 0; j < ELIMINATION_TILE; ++j) {
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
    GROUP_BARRIER();
    for (int column = block + (1 + GROUP_ITEM) * ELIMINATION_TILE; column < front.width;
         column += GROUP_ITEMS * ELIMINATION_TILE) {
      float8 sum_u = vload8(0, front.u + column), sum_v = vload8(0, front.v + column);
      for (int k = 0; k < ELIMINATION_TILE; ++k) {
        const float8 values = vload8(0, rows + k * front.width + column) * inverse[k];
        sum_u += values * u[k];
        sum_v += values * v[k];
      }
      vstore8(sum_u, 0, front.u + column);
      vstore8(sum_v, 0, front.v + column);
    }
    GROUP_BARRIER();
  }
}

// Factors the fronts of tasks where the matrix is new, and carries the residuals up from children to parents.
// In: fronts, tables and system (see EliminationLayout); ratios, per system. In and out: queues (0 at `queue`);
// matrices; vectors, 4 rows per front (see FrontView). NDRange: any number of work-groups.
kernel GROUP_KERNEL void eliminate_fronts(const EliminationParameters p, global const FrontRecord* restrict fronts,
                                          global const int* restrict tables, global const float* restrict system,
                                          global const int* restrict ratios, global int* restrict queues,
                                          global float* restrict matrices, global float* restrict vectors) {
  local int taken;
  for (int task = p.task_begin + take_task(queues + p.queue, &taken); task < p.task_end;
       task = p.task_begin + take_task(queues + p.queue, &taken)) {
    const int begin = tables[2 * task], end = tables[2 * task + 1];
    if (!(as_float(ratios[fronts[begin].system]) > p.tolerance)) continue;
    for (int f = begin; f < end; ++f) {
      global const FrontRecord* record = fronts + f;
      const FrontView front = view_front(record, matrices, vectors);
      if (p.is_new) {
        fill_front(front, record, p.at, tables, system);
        add_children(front, record, 1, p.at, fronts, tables, matrices, vectors);
        factor(front);
        GROUP_BARRIER();
        add_children(front, record, 0, p.at, fronts, tables, matrices, vectors);
      }
      fill_right_sides(front, record, p.at, fronts, tables, system, matrices, vectors);
      carry_up(front);
    }
  }
}

// Solves for the pivots of a front, whose boundary is solved.
GROUP_FUNCTION void solve_pivots(FrontView front) {
  for (int block = front.pivots - ELIMINATION_TILE; block >= 0; block -= ELIMINATION_TILE) {
    global const float* rows = front.rows + block * front.width;
    global float* u = front.u + block;
    global float* v = front.v + block;
    multiply_rows(rows, front.width, block + ELIMINATION_TILE, front.width, front.u, 0, u);
    multiply_rows(rows, front.width, block + ELIMINATION_TILE, front.width, front.v, 0, v);
    GROUP_BARRIER();
    if (GROUP_ITEM == 0) {
      // In registers: each value waits for the one before.
      float own_u[ELIMINATION_TILE], own_v[ELIMINATION_TILE];
#pragma unroll
      for (int k = ELIMINATION_TILE - 1; k >= 0; --k) {
        float sum_u = u[k], sum_v = v[k];
#pragma unroll
        for (int j = ELIMINATION_TILE - 1; j > k; --j) {
          const float value = rows[k * front.width + block + j];
          sum_u += value * own_u[j];
          sum_v += value * own_v[j];
        }
        u[k] = own_u[k] = sum_u * front.inverse[block + k];
        v[k] = own_v[k] = sum_v * front.inverse[block + k];
      }
    }
    GROUP_BARRIER();
  }
}

// The way back of the same tasks, from parents to children: solves for the pivots of fronts from the last of them on,
// and adds the result to the unknowns, 4 floats per row: the two values, and what each is more than its float.
// In and out: vectors (with work space for the solution), unknowns. NDRange: any number of work-groups.
kernel GROUP_KERNEL void substitute_back(const EliminationParameters p, global const FrontRecord* restrict fronts,
                                         global const int* restrict tables, global const float* restrict system,
                                         global const int* restrict ratios, global int* restrict queues,
                                         global float* restrict matrices, global float* restrict vectors,
                                         global float* restrict unknowns) {
  local int taken;
  global float* solution = vectors + p.at.solution;
  for (int task = p.task_begin + take_task(queues + p.queue, &taken); task < p.task_end;
       task = p.task_begin + take_task(queues + p.queue, &taken)) {
    const int begin = tables[2 * task], end = tables[2 * task + 1];
    if (!(as_float(ratios[fronts[begin].system]) > p.tolerance)) continue;
    for (int f = end - 1; f >= begin; --f) {
      global const FrontRecord* record = fronts + f;
      const FrontView front = view_front(record, matrices, vectors);
      for (int i = GROUP_ITEM; i < record->boundary; i += GROUP_ITEMS) {
        const int is_fixed = i == record->boundary - 1,
                  row = is_fixed ? 0 : tables[p.at.boundary_rows + record->list + i];
        front.u[front.pivots + i] = is_fixed ? 0.0f : solution[2 * row];
        front.v[front.pivots + i] = is_fixed ? 0.0f : solution[2 * row + 1];
      }
      GROUP_BARRIER();
      solve_pivots(front);
      for (int i = GROUP_ITEM; i < 2 * record->pivots; i += GROUP_ITEMS) {
        const int axis = i & 1, row = record->first + i / 2;
        if (!(record->axes & (1 << axis))) continue;
        const float value = axis ? front.v[i / 2] : front.u[i / 2];
        global float* hi = unknowns + 4 * row + axis;
        global float* lo = hi + 2;
        const float change = *lo + value / system[p.at.roots + row], sum = *hi + change, part = sum - *hi;
        solution[2 * row + axis] = value;
        *lo = (*hi - (sum - part)) + (change - part);
        *hi = sum;
      }
      GROUP_BARRIER();
    }
  }
}
