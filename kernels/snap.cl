// SPDX-License-Identifier: MIT
// Where texels read: from the regular grid to the mesh's own vertices and creased edges.
//   reserve_texels, decide_reservations, decide_the_rest
//                               vertices, strongest first, take the nearest texel that is free
//   place_on_edges              free texels follow their neighbours half way, then go to the nearest point of a creased
//                               edge
//   part_colours, join_colours  rows by colour, see below, and the other way again
// A reading position is an offset from the texel's own place in the lattice, in cells: two planes over the texture, x
// around, y along. Rows 0 and height-1 stay. `anchors` says what holds a texel: 0 nothing, 1 + i vertex i of the list
// of vertices, -1 - i edge i. Vertices and edges come with their patch and their place (x, y) in its cells, x
// unwrapped. While texels snap, each row of a patch has its even columns first, then its odd ones: those of a colour
// and their neighbours lie side by side. Texels never look at each other's offsets where these may change: reservations
// wait for stronger ones next to them, the other kernels take even and odd rows apart, and in each of them one colour
// after the other (see row_colour). So nothing depends on the order of work-items.
#include "extremes.h"
#include "patch_texels.h"
#include "row_group.h"
#include "skeletex_structs.h"
#include "snap_map.h"
#include "snap_structs.h"

#define REACH 0.7f         // cells from where a texel is to where it goes
#define FURTHEST 1.0f      // cells from a texel's own place, along each axis
#define LOOSE 0.5f         // the same of texels that nothing holds: where edges look for them
#define LEAST_CROSS 0.05f  // cells squared: twice the area that the triangles around a texel keep in the map
#define LEAST_MOVE 0.01f   // cells: shorter steps of free texels are not worth their test
#define PLACED 5           // states of a vertex: 0 to 3 the candidate that it reserves, 4 none is left
#define NONE -1            // of a bin's edges
#define FLATTEST 5.0f      // of edges that texels look for again, see SnapEdge: dihedral angles of 0.1 rad

// The candidate of a vertex: the k-th nearest corner of its cell, and the vertex' offset from it.
void candidate_of(float x, float y, int k, int* column, int* row, float* dx, float* dy) {
  const float base_x = floor(x), base_y = floor(y);
  const float fx = x - base_x, fy = y - base_y;
  const int near_x = fx > 0.5f, near_y = fy > 0.5f;
  // The nearest, then across the nearer side, then across the other one, then the opposite corner.
  const int is_x_first = fabs(fx - 0.5f) < fabs(fy - 0.5f);
  const int flip_x = k == 3 || k == (is_x_first ? 1 : 2), flip_y = k == 3 || k == (is_x_first ? 2 : 1);
  const int right = near_x ^ flip_x, up = near_y ^ flip_y;
  *column = (int)base_x + right, *row = (int)base_y + up;
  *dx = fx - (float)right, *dy = fy - (float)up;
}

// A vertex that is not placed reserves the first of its candidates that it can still have.
// in   least: more than all reservations of rounds before
__attribute__((always_inline)) void reserve_texel(int v, int least, SnapVertex vertex,
                                                  global const PatchRecord* restrict p, int texture_width,
                                                  global const int* anchors, global int* states,
                                                  volatile global int* reservations) {
  int state = states[v];
  for (; state < 4; ++state) {
    int column, row;
    float dx, dy;
    candidate_of(vertex.x, vertex.y, state, &column, &row, &dx, &dy);
    if (row < 1 || row > p->height - 2 || dx * dx + dy * dy > REACH * REACH) continue;
    const int texel = coloured_at(p, texture_width, (column % p->width + p->width) % p->width, row);
    if (anchors[texel] != 0) continue;
    atomic_max(reservations + texel, least + vertex.rank);
    break;
  }
  states[v] = state;
}

// A reservation that is the strongest on its texel and the eight around is decided: it stands when the map does not
// fold, else the next candidate's turn has come.
__attribute__((always_inline)) void decide_reservation(int v, int least, SnapVertex vertex,
                                                       global const PatchRecord* restrict p, SnapParameters sizes,
                                                       volatile global const int* reservations, global int* states,
                                                       global int* anchors, global float* offsets) {
  const int texture_width = sizes.texture_width;
  global float *offset_x = offsets, *offset_y = offsets + sizes.texel_count;
  int column, row;
  float dx, dy;
  candidate_of(vertex.x, vertex.y, states[v], &column, &row, &dx, &dy);
  column = (column % p->width + p->width) % p->width;
  int is_strongest = 1;
  for (int i = -1; i <= 1; ++i)
    for (int j = -1; j <= 1; ++j)
      is_strongest &= reservations[coloured_at(p, texture_width, column + j, row + i)] <= least + vertex.rank;
  if (!is_strongest) return;
  const Neighbours n = neighbours_of(p, texture_width, column, row);
  if (cross_around_one(n, p->height, texture_width, row, dx, dy, offset_x, offset_y) < LEAST_CROSS) {
    states[v] += 1;
    return;
  }
  offset_x[n.own] = dx;
  offset_y[n.own] = dy;
  anchors[n.own] = 1 + v;
  states[v] = PLACED;
}

// NDRange (vertices). One round: reservations.
kernel void reserve_texels(const SnapParameters p, global const SnapVertex* restrict vertices,
                           global const PatchRecord* restrict patches, global const int* restrict anchors,
                           global int* restrict states, global int* restrict reservations) {
  const int v = (int)get_global_id(0);
  if (v < p.count)
    reserve_texel(v, p.least, vertices[v], patches + vertices[v].patch, p.texture_width, anchors, states, reservations);
}

// NDRange (vertices). One round: decisions.
kernel void decide_reservations(const SnapParameters p, global const SnapVertex* restrict vertices,
                                global const PatchRecord* restrict patches, global const int* restrict reservations,
                                global int* restrict states, global int* restrict anchors,
                                global float* restrict offsets) {
  const int v = (int)get_global_id(0);
  if (v < p.count && states[v] < 4)
    decide_reservation(v, p.least, vertices[v], patches + vertices[v].patch, p, reservations, states, anchors, offsets);
}

// NDRange: one work-group of ROW_ITEMS. All further rounds, which are of few vertices. Every round decides at least the
// strongest reservation that is open.
// out  open: what else the kernel needs, two numbers per vertex
kernel void decide_the_rest(const SnapParameters p, global const SnapVertex* restrict vertices,
                            global const PatchRecord* restrict patches, volatile global int* reservations,
                            global int* states, global int* anchors, global float* offsets, global int* open) {
  local int counts[2];
  const int own = (int)get_local_id(0);
  if (own == 0) counts[0] = counts[1] = 0;
  WAIT_FOR_GROUP(CLK_LOCAL_MEM_FENCE);
  for (int v = own; v < p.count; v += ROW_ITEMS)
    if (states[v] < 4) open[atomic_inc(counts)] = v;
  int round_least = p.least;
  for (int list = 0;; list = !list) {
    WAIT_FOR_GROUP(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
    const int count = counts[list];
    if (count == 0) break;
    global const int* from = open + list * p.count;
    global int* to = open + !list * p.count;
    if (round_least > 0x7fffffff - 2 * p.step) {
      for (int i = own; i < p.texel_count; i += ROW_ITEMS) reservations[i] = 0;
      round_least = 0;
      WAIT_FOR_GROUP(CLK_GLOBAL_MEM_FENCE);
    }
    for (int i = own; i < count; i += ROW_ITEMS) {
      const int v = from[i];
      reserve_texel(v, round_least, vertices[v], patches + vertices[v].patch, p.texture_width, anchors, states,
                    reservations);
    }
    WAIT_FOR_GROUP(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
    if (own == 0) counts[list] = 0;
    for (int i = own; i < count; i += ROW_ITEMS) {
      const int v = from[i];
      if (states[v] < 4)
        decide_reservation(v, round_least, vertices[v], patches + vertices[v].patch, p, reservations, states, anchors,
                           offsets);
      if (states[v] < 4) to[atomic_inc(counts + !list)] = v;
    }
    round_least += p.step;
  }
}

typedef struct Offset {
  float x, y;
} Offset;

// Where a texel that nothing holds goes: half way to the mean of its four neighbours, when that is worth its test and
// stands it.
__attribute__((always_inline)) Offset relaxed(Offset own, int is_held, Neighbours n, int height, int texture_width,
                                              int row, global const float* offset_x, global const float* offset_y) {
  const int below = n.own - texture_width, above = n.own + texture_width;
  const float mean_x = 0.25f * (offset_x[n.left] + offset_x[n.right] + offset_x[below] + offset_x[above]);
  const float mean_y = 0.25f * (offset_y[n.left] + offset_y[n.right] + offset_y[below] + offset_y[above]);
  const Offset moved = {0.5f * (own.x + mean_x), 0.5f * (own.y + mean_y)};
  const int is_worth_it =
      (fabs(moved.x - own.x) + fabs(moved.y - own.y) >= LEAST_MOVE) & (fmax(fabs(moved.x), fabs(moved.y)) <= LOOSE);
  const int stands = cross_around(n, height, texture_width, row, moved.x, moved.y, offset_x, offset_y) >= LEAST_CROSS;
  const int moves = (is_held == 0) & is_worth_it & stands;
  const Offset now = {moves ? moved.x : own.x, moves ? moved.y : own.y};
  return now;
}

// Texels of one colour of a row with a neighbour on either side, `first` to `end`, and the left one of the first. The
// right one is the next after it.
typedef struct RowColour {
  int first, end, left;
} RowColour;

// Columns that wrap round are left out: what is done for the others becomes vector instructions.
RowColour row_colour(int is_odd, int first, int width) {
  const int odd = first + ((width + 1) >> 1);
  const RowColour colour = {is_odd ? odd : first + 1, is_odd ? odd + ((width - 1) >> 1) : first + (width >> 1),
                            is_odd ? first : odd};
  return colour;
}

// The column at an end of a row that comes with a colour; of an odd width the last one comes by itself. -1: none.
int end_of_colour(int colour, int width) {
  return colour == 0 ? (width > 1 ? 0 : -1) : colour == 1 ? ((width & 1) ? -1 : width - 1) : width - 1;
}

// Texels of one colour relax.
// in   offset_x, offset_y: the same as own_x, own_y, of which only texels of this colour are read there
__attribute__((always_inline)) void relax_colour(const RowColour colour, const int height, const int texture_width,
                                                 const int row, global const int* restrict anchors,
                                                 global const float* restrict offset_x,
                                                 global const float* restrict offset_y, global float* restrict own_x,
                                                 global float* restrict own_y) {
  for (int i = get_local_id(0); i < colour.end - colour.first; i += ROW_ITEMS) {
    const int texel = colour.first + i;
    const Offset own = {own_x[texel], own_y[texel]};
    const Neighbours n = {texel, colour.left + i, colour.left + i + 1};
    const Offset now = relaxed(own, anchors[texel] != 0, n, height, texture_width, row, offset_x, offset_y);
    own_x[texel] = now.x;
    own_y[texel] = now.y;
  }
}

// Compiled once.
__attribute__((noinline)) void relax_at_end(global const PatchRecord* restrict p, const int texture_width,
                                            const int column, const int row, global const int* restrict anchors,
                                            global float* offset_x, global float* offset_y) {
  const Neighbours n = neighbours_of(p, texture_width, column, row);
  const Offset own = {offset_x[n.own], offset_y[n.own]};
  const Offset now = relaxed(own, anchors[n.own] != 0, n, p->height, texture_width, row, offset_x, offset_y);
  offset_x[n.own] = now.x;
  offset_y[n.own] = now.y;
}

// The free texels of a row relax, one colour after the other.
__attribute__((always_inline)) void relax_row(global const PatchRecord* restrict p, const int texture_width,
                                              const int row, global const int* restrict anchors, global float* offset_x,
                                              global float* offset_y) {
  const int width = p->width, first = (p->y + row) * texture_width + p->x;
  for (int colour = 0; colour < 2 + (width & 1); ++colour) {
    const int at_end = end_of_colour(colour, width);
    if (colour < 2)
      relax_colour(row_colour(colour, first, width), p->height, texture_width, row, anchors, offset_x, offset_y,
                   offset_x, offset_y);
    if (get_local_id(0) == 0 && at_end >= 0) relax_at_end(p, texture_width, at_end, row, anchors, offset_x, offset_y);
    WAIT_FOR_GROUP(CLK_GLOBAL_MEM_FENCE);
  }
}

float8 gathered(const int8 at, global const float* from) {
  return (float8)(from[at.s0], from[at.s1], from[at.s2], from[at.s3], from[at.s4], from[at.s5], from[at.s6],
                  from[at.s7]);
}

int8 gathered_ints(const int8 at, global const int* from) {
  return (int8)(from[at.s0], from[at.s1], from[at.s2], from[at.s3], from[at.s4], from[at.s5], from[at.s6], from[at.s7]);
}

// Of eight columns, by colour.
float8 loaded(global const float* plane, const int at_even, const int at_odd) {
  return (float8)(vload4(0, plane + at_even), vload4(0, plane + at_odd));
}
int8 loaded_ints(global const int* plane, const int at_even, const int at_odd) {
  return (int8)(vload4(0, plane + at_even), vload4(0, plane + at_odd));
}
void store(const float8 values, global float* plane, const int at_even, const int at_odd) {
  vstore4(values.lo, 0, plane + at_even);
  vstore4(values.hi, 0, plane + at_odd);
}
void store_ints(const int8 values, global int* plane, const int at_even, const int at_odd) {
  vstore4(values.lo, 0, plane + at_even);
  vstore4(values.hi, 0, plane + at_odd);
}

// Of a bin's edges those that are nearest to eight texels, by distance / weight, and within reach; of two as near the
// first one.
int8 nearest_edges(const float8 x, const float8 y, const int begin, const int end, global const int* restrict bin_edges,
                   global const SnapEdge* restrict edges) {
  float8 least = (float8)(INFINITY);
  int8 nearest = (int8)(NONE);
  for (int i = begin; i < end; ++i) {
    const int e = bin_edges[i];
    global const SnapEdge* restrict edge = edges + e;
    const float8 to_x = edge->x - x, to_y = edge->y - y;
    const float8 t = clamp(to_x * edge->over_x + to_y * edge->over_y, (float8)(0.0f), (float8)(1.0f));
    const float8 dx = to_x + t * edge->ex, dy = to_y + t * edge->ey, distance2 = dx * dx + dy * dy,
                 cost = distance2 * edge->flatness;
    const int8 is_nearer = (cost < least) & (distance2 <= REACH * REACH);
    least = is_nearer ? cost : least;
    nearest = is_nearer ? (int8)(e) : nearest;
  }
  return nearest;
}

// Records of eight edges, by field.
typedef struct SnapEdges {
  float8 x, y, ex, ey, over_x, over_y, flatness;
  int8 number;
} SnapEdges;

SnapEdges gathered_edges(const int8 at, global const SnapEdge* restrict edges) {
  global const float* from = (global const float*)edges;
  const int8 first = at * 8;
  const SnapEdges all = {gathered(first, from),     gathered(first, from + 1),         gathered(first, from + 2),
                         gathered(first, from + 3), gathered(first, from + 4),         gathered(first, from + 5),
                         gathered(first, from + 6), as_int8(gathered(first, from + 7))};
  return all;
}

// The edge that a texel can go to: its number, and whether it is so sharp that another try is worth it. NONE: nothing.
int8 candidates_of(const SnapEdges edges) { return 2 * edges.number + ((edges.flatness <= FLATTEST) & 1); }
int number_of_candidate(int candidate) { return candidate >> 1; }
int is_sharp_candidate(int candidate) { return candidate & 1; }

// A free texel of any column goes where its candidate is; if it cannot, and the edge is flat, it has none any more.
// Compiled once.
__attribute__((noinline)) void place_one(global const PatchRecord* restrict p, const int texture_width,
                                         const int column, const int row, global const float* restrict target_x,
                                         global const float* restrict target_y, global int* candidates,
                                         global int* restrict anchors, global float* offset_x, global float* offset_y) {
  const Neighbours n = neighbours_of(p, texture_width, column, row);
  const int texel = n.own, candidate = candidates[texel];
  if (candidate == NONE) return;
  const float dx = target_x[texel], dy = target_y[texel];
  if (fmax(fabs(dx), fabs(dy)) > FURTHEST ||
      cross_around(n, p->height, texture_width, row, dx, dy, offset_x, offset_y) < LEAST_CROSS) {
    if (!is_sharp_candidate(candidate)) candidates[texel] = NONE;
    return;
  }
  offset_x[texel] = dx, offset_y[texel] = dy;
  anchors[texel] = -1 - number_of_candidate(candidate), candidates[texel] = NONE;
}

// Texels of one colour, as for relax_colour, go to the edge that is nearest.
// out  candidates: of those that could not, and are worth another try
__attribute__((always_inline)) void place_colour(const RowColour colour, const int height, const int texture_width,
                                                 const int row, global const float* restrict target_x,
                                                 global const float* restrict target_y, global int* restrict candidates,
                                                 global int* restrict anchors, global const float* restrict offset_x,
                                                 global const float* restrict offset_y, global float* restrict own_x,
                                                 global float* restrict own_y) {
  for (int i = get_local_id(0); i < colour.end - colour.first; i += ROW_ITEMS) {
    const int texel = colour.first + i, candidate = candidates[texel], has_candidate = candidate != NONE;
    const float from_x = own_x[texel], from_y = own_y[texel], dx = target_x[texel], dy = target_y[texel];
    const Neighbours n = {texel, colour.left + i, colour.left + i + 1};
    const int stands = cross_around(n, height, texture_width, row, dx, dy, offset_x, offset_y) >= LEAST_CROSS;
    const int moves = has_candidate & (fabs(dx) <= FURTHEST) & (fabs(dy) <= FURTHEST) & stands;
    const float to_x = moves ? dx : from_x, to_y = moves ? dy : from_y;
    const int anchor = moves ? -1 - number_of_candidate(candidate) : anchors[texel];
    own_x[texel] = to_x, own_y[texel] = to_y, anchors[texel] = anchor;
    const int is_open = has_candidate & !moves & is_sharp_candidate(candidate);
    candidates[texel] = is_open ? candidate : NONE;
  }
}

// The same where hardly any texel has a candidate.
__attribute__((always_inline)) void place_few(global const PatchRecord* restrict p, const RowColour colour,
                                              const int odd, const int texture_width, const int row,
                                              global const float* restrict target_x,
                                              global const float* restrict target_y, global int* restrict candidates,
                                              global int* restrict anchors, global float* offset_x,
                                              global float* offset_y) {
  for (int i = get_local_id(0); i < colour.end - colour.first; i += ROW_ITEMS)
    if (candidates[colour.first + i] != NONE)
      place_one(p, texture_width, odd ? 2 * i + 1 : 2 * i + 2, row, target_x, target_y, candidates, anchors, offset_x,
                offset_y);
}

// NDRange: one work-group of ROW_ITEMS per row, as in reconstruct.cl. Free texels of a row relax, then go to the
// nearest edge within reach, one colour of the row after the other. A row comes in bins of eight columns, which look
// for their edges together; bins, of this row alone or of several, have lists of the edges near them.
// in   rows: patch, row, number of the first bin, 0: inner ones, even or odd; bins: where the list of each begins,
//      bin_count and one more, then the lists: numbers of edges
// in/out  offsets: planes x, y, and where on its edge a texel is, 0 to 1
// out  candidates, targets (planes x, y): what else the kernel needs per texel
kernel void place_on_edges(const SnapParameters p, global const int* restrict rows,
                           global const PatchRecord* restrict patches, global const int* restrict bins,
                           global const SnapEdge* restrict edges, global int* restrict anchors, global float* offsets,
                           global int* restrict candidates, global float* restrict targets) {
  const int k = get_group_id(0);
  if (k >= p.count) return;
  const int texture_width = p.texture_width;
  global const int* bin_edges = bins + p.bin_count + 1;
  global float *offset_x = offsets, *offset_y = offsets + p.texel_count, *parameters = offsets + 2 * p.texel_count;
  global float *target_x = targets, *target_y = targets + p.texel_count;
  global const PatchRecord* restrict patch = patches + rows[4 * k];
  const int row = rows[4 * k + 1], width = patch->width, height = patch->height,
            first = (patch->y + row) * texture_width + patch->x;
  const int odd = first + ((width + 1) >> 1);
  relax_row(patch, texture_width, row, anchors, offset_x, offset_y);
  for (int column = SNAP_BIN_WIDTH * get_local_id(0), bin = rows[4 * k + 2] + get_local_id(0); column < width;
       column += SNAP_BIN_WIDTH * ROW_ITEMS, bin += ROW_ITEMS) {
    // Even columns, then odd ones. The last texels of a row are fewer than eight: each lane beyond them looks at the
    // last one.
    const int8 columns = min(column + (int8)(0, 2, 4, 6, 1, 3, 5, 7), (int8)(width - 1));
    const int8 texels = (columns >> 1) + ((columns & 1) == 0 ? (int8)(first) : (int8)(odd));
    const int is_whole = column + SNAP_BIN_WIDTH <= width, at_even = first + column / 2, at_odd = odd + column / 2;
    if (p.is_again && is_whole && !any(loaded_ints(candidates, at_even, at_odd) != NONE)) continue;
    const float8 x = is_whole ? loaded(offset_x, at_even, at_odd) : gathered(texels, offset_x);
    const float8 y = is_whole ? loaded(offset_y, at_even, at_odd) : gathered(texels, offset_y);
    const int8 nearest =
        nearest_edges(convert_float8(columns) + x, (float)row + y, bins[bin], bins[bin + 1], bin_edges, edges);
    const int8 are_held = (is_whole ? loaded_ints(anchors, at_even, at_odd) : gathered_ints(texels, anchors)) != 0;
    const int8 have_candidates = (nearest != NONE) & !are_held;
    const SnapEdges found = gathered_edges(have_candidates ? nearest : (int8)(0), edges);
    const float8 to_x = found.x - (convert_float8(columns) + x), to_y = found.y - ((float)row + y);
    const float8 t = clamp(to_x * found.over_x + to_y * found.over_y, (float8)(0.0f), (float8)(1.0f));
    const float8 to_offset_x = to_x + t * found.ex + x, to_offset_y = to_y + t * found.ey + y;
    const int8 new_candidates = have_candidates ? candidates_of(found) : (int8)(NONE);
    if (is_whole) {
      store_ints(new_candidates, candidates, at_even, at_odd);
      store(to_offset_x, target_x, at_even, at_odd), store(to_offset_y, target_y, at_even, at_odd);
      // The first time those of others are nothing yet.
      const float8 before = p.is_again ? loaded(parameters, at_even, at_odd) : t;
      store(have_candidates ? t : before, parameters, at_even, at_odd);
    } else {
      int at[8], of_lanes[8];
      float x_of_lanes[8], y_of_lanes[8], t_of_lanes[8];
      vstore8(texels, 0, at), vstore8(new_candidates, 0, of_lanes);
      vstore8(to_offset_x, 0, x_of_lanes), vstore8(to_offset_y, 0, y_of_lanes), vstore8(t, 0, t_of_lanes);
      // What several lanes look at is the same.
      for (int i = 0; i < 8; ++i) {
        candidates[at[i]] = of_lanes[i], target_x[at[i]] = x_of_lanes[i], target_y[at[i]] = y_of_lanes[i];
        if (of_lanes[i] != NONE) parameters[at[i]] = t_of_lanes[i];
      }
    }
  }
  WAIT_FOR_GROUP(CLK_GLOBAL_MEM_FENCE);
  for (int colour = 0; colour < 2 + (width & 1); ++colour) {
    const int at_end = end_of_colour(colour, width);
    if (colour < 2 && p.is_again)
      place_few(patch, row_colour(colour, first, width), colour, texture_width, row, target_x, target_y, candidates,
                anchors, offset_x, offset_y);
    else if (colour < 2)
      place_colour(row_colour(colour, first, width), height, texture_width, row, target_x, target_y, candidates,
                   anchors, offset_x, offset_y, offset_x, offset_y);
    if (get_local_id(0) == 0 && at_end >= 0)
      place_one(patch, texture_width, at_end, row, target_x, target_y, candidates, anchors, offset_x, offset_y);
    WAIT_FOR_GROUP(CLK_GLOBAL_MEM_FENCE);
  }
}

// NDRange and rows as for place_on_edges. Offsets with their rows by colour, from `home`, where columns follow each
// other. They are 0 before, and stay so in rows without any at home: nearly all.
kernel void part_colours(const SnapParameters p, global const int* restrict rows,
                         global const PatchRecord* restrict patches, global const float* restrict home,
                         global float* restrict offsets) {
  const int k = get_group_id(0);
  if (k >= p.count) return;
  global const PatchRecord* restrict patch = patches + rows[4 * k];
  const int width = patch->width, first = (patch->y + rows[4 * k + 1]) * p.texture_width + patch->x;
  global const float *home_x = home + first, *home_y = home_x + p.texel_count;
  global float *offset_x = offsets + first, *offset_y = offset_x + p.texel_count;
  int has_any = 0;
  for (int i = 0; i < width; ++i) has_any |= (home_x[i] != 0.0f) | (home_y[i] != 0.0f);
  if (!has_any) return;
  for (int j = get_local_id(0); j < width; j += ROW_ITEMS) {
    const int at = by_colour(j, width);
    offset_x[at] = home_x[j], offset_y[at] = home_y[j];
  }
}

// NDRange and rows as for place_on_edges. What has snapped by columns, from rows by colour.
// in   snapped: planes x, y, place on the edge; held_by: anchors    out  offsets, anchors: the same
kernel void join_colours(const SnapParameters p, global const int* restrict rows,
                         global const PatchRecord* restrict patches, global const float* restrict snapped,
                         global const int* restrict held_by, global float* restrict offsets,
                         global int* restrict anchors) {
  const int k = get_group_id(0);
  if (k >= p.count) return;
  global const PatchRecord* restrict patch = patches + rows[4 * k];
  const int width = patch->width, first = (patch->y + rows[4 * k + 1]) * p.texture_width + patch->x;
  for (int j = get_local_id(0); j < width; j += ROW_ITEMS) {
    const int at = first + by_colour(j, width);
    anchors[first + j] = held_by[at];
    for (int plane = 0; plane < 3; ++plane)
      offsets[plane * p.texel_count + first + j] = snapped[plane * p.texel_count + at];
  }
}
