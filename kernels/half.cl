// SPDX-License-Identifier: MIT
// Texels rounded to half floats (16 bits). The nearest ones move a point by up to half a step of each number, in any
// direction; but only what leaves the surface is an error. So of the half floats near a texel those are taken whose
// point stays nearest to the planes of the triangles around it: on smooth parts it slides along the surface, on an edge
// along that. The mean of the squares over the planes, weighted by area, is a quadratic form of the point's move
// (quadric error metrics: Garland and Heckbert 1997), and with its derivative one of the texel's.
#include "bone_frame.h"
#include "planes.h"
#include "row_group.h"
#include "skeletex_structs.h"
#include "texel_structs.h"

#define MOST_CHANGE \
  0.4f  // of the triangles around: the root of the sum of squares of how much their heights change, as shares
#define CHANGE_WEIGHT 0.01f  // of such a change, against a way off the surface as long as their sides
#define LEAST_SLOPE \
  0.05f  // cosine between the ways from the foot and from the bone: beyond it a point moves too far to be told
#define LEAST_HEIGHT2 1e-12f  // of a triangle, in its side: flatter ones have no plane
#define LEAST_PART \
  0x1p-7f  // of the coarsest step: a number that is less is 0 but for rounding, as two of SPD texels are, and stays so
#define STEPS 8

// What is added to two of a texel's numbers, in steps of the third; no two in simple proportion.
constant float steps[STEPS] = {0.0f, 0.35f, -0.35f, 0.8f, -0.8f, 1.7f, -1.7f, 3.1f};

// Between the half floats around x; below 2^-14 they are evenly spaced.
float half_step(float x) { return fmax(as_float(as_int(x) & 0x7f800000) * 0x1p-10f, 0x1p-24f); }
float8 half_steps(float8 x) { return fmax(as_float8(as_int8(x) & 0x7f800000) * 0x1p-10f, 0x1p-24f); }

// By addition of 1.5 * 2^23 steps, beside which there is no room for less than one.
float nearest_half(float x) {
  const float large = 12582912.0f * half_step(x);
  return (x + large) - large;
}
float8 nearest_halves(float8 x) {
  const float8 large = 12582912.0f * half_steps(x);
  return (x + large) - large;
}

float product(const float a[3], const float b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

float form_of(float q[3][3], const float t[3]) {
  return product(q[0], t) * t[0] + product(q[1], t) * t[1] + product(q[2], t) * t[2];
}

// How a point moves with each of its texel's numbers. With the texel q it moves by m dq + d (d - m g) dq / (g d): d is
// the direction from the foot, m the length of that way over the texel's, and g the direction away from the bone, along
// which the point has to move by as much as the texel gets longer. Returns whether that is known.
int find_moves(const float texel[3], const float point[3], global const PatchRecord* restrict p, RowRecord row,
               ColumnRecord column, float moves[3][3]) {
  float foot[3], axes[3][3], d[3], g[3], axial = 0.0f;  // axes: along, around, out
  frame_of(p, row, column, foot, axes[2]);
  for (int i = 0; i < 3; ++i) axes[1][i] = column.cosine * p->b[i] - column.sine * p->s[i];
  for (int i = 0; i < 3; ++i) {
    const int k = (i + 1) % 3, l = (i + 2) % 3;
    axes[0][i] = axes[2][k] * axes[1][l] - axes[2][l] * axes[1][k];
    axial += (point[i] - p->head[i]) * p->axis[i];
  }
  axial = clamp(axial, 0.0f, p->length);
  for (int i = 0; i < 3; ++i) d[i] = point[i] - foot[i], g[i] = point[i] - p->head[i] - axial * p->axis[i];
  const float size = sqrt(product(texel, texel)), way = sqrt(product(d, d)), distance = sqrt(product(g, g));
  if (size == 0.0f || way == 0.0f || distance == 0.0f) return 0;
  for (int i = 0; i < 3; ++i) d[i] /= way, g[i] /= distance;
  const float m = way / size, inverse = 1.0f / fmax(product(g, d), LEAST_SLOPE);
  for (int i = 0; i < 3; ++i) {
    const float along_d = (product(axes[i], d) - m * product(axes[i], g)) * inverse;
    for (int l = 0; l < 3; ++l) moves[i][l] = m * axes[i][l] + along_d * d[l];
  }
  return 1;
}

void add_square(const float v[3], float weight, float q[3][3]) {
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k <= i; ++k) q[i][k] += weight * v[i] * v[k];
}

// A form of a point's move, of which the lower half is given, as one of its texel's.
void make_of_texel(float moves[3][3], float q[3][3]) {
  q[0][1] = q[1][0], q[0][2] = q[2][0], q[1][2] = q[2][1];
  float half_way[3][3];
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) half_way[i][k] = product(q[i], moves[k]);
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k)
      q[i][k] = moves[i][0] * half_way[0][k] + moves[i][1] * half_way[1][k] + moves[i][2] * half_way[2][k];
}

// The form of the mean of the squares of distances from the triangles' planes; that of the sum of the squares of how
// much their heights change, as shares; and the mean of the triangles' double areas, 0 where none has a plane.
typedef struct Surroundings {
  float off[3][3], change[3][3], area;
} Surroundings;

// Of the lattice's triangles at a texel; next to the first and last row those of its neighbours.
// in   column, row: of the patch
Surroundings surroundings_of(const float point[3], float moves[3][3], global const PatchRecord* restrict p,
                             int texture_width, int column, int row, Planes points,
                             global const int* restrict diagonals) {
  const int first = (p->y + row) * texture_width + p->x, above = first + texture_width, below = first - texture_width;
  const int left = (column > 0 ? column : p->width) - 1, right = column + 1 < p->width ? column + 1 : 0;
  const int has_above = row<p->height - 2, has_below = row> 1;
  // Neighbours in turn, and behind each what a diagonal may join to the texel.
  const int ring[8] = {first + right, above + right, above + column, above + left,
                       first + left,  below + left,  below + column, below + right};
  const int is_joined[8] = {
      1, has_above && diagonals[first + column] == 0, 1, has_above && diagonals[first + left] != 0,
      1, has_below && diagonals[below + left] == 0,   1, has_below && diagonals[below + column] != 0};
  float sides[9][3];
  int count = 0;
  for (int i = 0; i < 8; ++i) {
    const Point other = point_at(points, ring[i]);
    sides[count][0] = other.x - point[0], sides[count][1] = other.y - point[1], sides[count][2] = other.z - point[2];
    count += is_joined[i];
  }
  for (int i = 0; i < 3; ++i) sides[count][i] = sides[0][i];
  Surroundings around;
  for (int i = 0; i < 9; ++i) around.off[i / 3][i % 3] = around.change[i / 3][i % 3] = 0.0f;
  around.area = 0.0f;
  for (int i = 0; i < count; ++i) {
    const float* u = sides[i];
    const float* v = sides[i + 1];
    const float n[3] = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]},
                e[3] = {v[0] - u[0], v[1] - u[1], v[2] - u[2]};
    const float area2 = product(n, n), side2 = product(e, e);
    if (area2 <= LEAST_HEIGHT2 * side2 * side2) continue;
    // From the point to the opposite side, divided by the square of that height.
    const float share = product(u, e) / side2, inverse = side2 / area2;
    const float height[3] = {(u[0] - share * e[0]) * inverse, (u[1] - share * e[1]) * inverse,
                             (u[2] - share * e[2]) * inverse};
    add_square(n, rsqrt(area2), around.off);
    add_square(height, 1.0f, around.change);
    around.area += sqrt(area2);
  }
  make_of_texel(moves, around.off);
  make_of_texel(moves, around.change);
  for (int i = 0; i < 9; ++i) around.off[i / 3][i % 3] /= fmax(around.area, FLT_MIN);
  around.area /= (float)count;
  return around;
}

// What is to be added to a texel.
// in   moved: by the nearest half floats
// out  moved: by those that are taken; the same where no others change the triangles little enough
void choose_halves(const float texel[3], Surroundings* around, float moved[3]) {
  // The number whose step weighs most comes first: for all that is added to the others the best of its own is known.
  float own_steps[3], weights[3];
  for (int i = 0; i < 3; ++i) own_steps[i] = half_step(texel[i]);
  const float coarsest = fmax(own_steps[0], fmax(own_steps[1], own_steps[2]));
  for (int i = 0; i < 3; ++i)
    weights[i] = fabs(texel[i]) < LEAST_PART * coarsest ? -1.0f : around->off[i][i] * own_steps[i] * own_steps[i];
  const int a = weights[2] >= fmax(weights[0], weights[1]) ? 2
                : weights[0] >= weights[1]                 ? 0
                                                           : 1,
            b = a == 0 ? 1 : 0, c = a == 2 ? 1 : 2;
  const float step_b = weights[b] < 0.0f ? 0.0f : fmax(own_steps[a], own_steps[b]),
              step_c = weights[c] < 0.0f ? 0.0f : fmax(own_steps[a], own_steps[c]);
  float cost[3][3];
  for (int i = 0; i < 9; ++i)
    cost[i / 3][i % 3] =
        around->off[i / 3][i % 3] + CHANGE_WEIGHT * CHANGE_WEIGHT * around->area * around->change[i / 3][i % 3];
  const float inverse = 1.0f / cost[a][a];
  const float8 c_moves = nearest_halves(texel[c] + step_c * vload8(0, steps)) - texel[c];
  const float8 c_costs = cost[c][c] * c_moves * c_moves, c_changes = around->change[c][c] * c_moves * c_moves;
  float8 least = (float8)(form_of(cost, moved)), best_a = (float8)(moved[a]), best_b = (float8)(moved[b]),
         best_c = (float8)(moved[c]);
  for (int i = 0; i < STEPS; ++i) {
    const float b_move = nearest_half(texel[b] + step_b * steps[i]) - texel[b];
    const float8 slopes = cost[a][b] * b_move + cost[a][c] * c_moves;
    const float8 a_moves = nearest_halves(texel[a] - slopes * inverse) - texel[a];
    const float8 costs = a_moves * (cost[a][a] * a_moves + 2.0f * slopes) +
                         b_move * (cost[b][b] * b_move + 2.0f * cost[b][c] * c_moves) + c_costs;
    const float8 changes = a_moves * (around->change[a][a] * a_moves +
                                      2.0f * (around->change[a][b] * b_move + around->change[a][c] * c_moves)) +
                           b_move * (around->change[b][b] * b_move + 2.0f * around->change[b][c] * c_moves) + c_changes;
    const int8 is_better = (costs < least) & (changes <= MOST_CHANGE * MOST_CHANGE);
    least = is_better ? costs : least;
    best_a = is_better ? a_moves : best_a, best_b = is_better ? (float8)(b_move) : best_b,
    best_c = is_better ? c_moves : best_c;
  }
  float lanes[4][8];
  vstore8(least, 0, lanes[0]), vstore8(best_a, 0, lanes[1]), vstore8(best_b, 0, lanes[2]), vstore8(best_c, 0, lanes[3]);
  int best = 0;
  for (int i = 1; i < 8; ++i) best = lanes[0][i] < lanes[0][best] ? i : best;
  moved[a] = lanes[1][best], moved[b] = lanes[2][best], moved[c] = lanes[3][best];
}

// NDRange: one work-group of ROW_ITEMS per row, as in reconstruct.cl. Rounds the texels of inner rows.
// in   lattice_rows: inner rows; points: of the texels of all rows; diagonals: see choose_diagonals
// in and out  texels: along, around, out
// out  squares: per texel the mean of the squares of distances from the planes around, a plane for the nearest half
// floats and a plane for these
kernel void round_texels(const TexelParameters p, global const int* restrict lattice_rows,
                         global const PatchRecord* restrict patches, global const RowRecord* restrict rows,
                         global const float* restrict columns, global const float* restrict points,
                         global const int* restrict diagonals, global float* restrict texels,
                         global float* restrict squares) {
  const int k = get_group_id(0);
  if (k >= p.count) return;
  const Planes from = planes_of(points, p.texel_count);
  const MutablePlanes all = mutable_planes_of(texels, p.texel_count);
  global const PatchRecord* restrict patch = patches + lattice_rows[4 * k];
  const int row = lattice_rows[4 * k + 1], first = (patch->y + row) * p.texture_width + patch->x;
  for (int j = get_local_id(0); j < patch->width; j += ROW_ITEMS) {
    const int i = first + j;
    const float texel[3] = {all.x[i], all.y[i], all.z[i]}, point[3] = {from.x[i], from.y[i], from.z[i]};
    float moved[3] = {nearest_half(texel[0]) - texel[0], nearest_half(texel[1]) - texel[1],
                      nearest_half(texel[2]) - texel[2]};
    squares[i] = squares[p.texel_count + i] = 0.0f;
    float moves[3][3];
    const ColumnRecord column = column_at(columns, p.column_count, patch->column_begin + j);
    if (find_moves(texel, point, patch, rows[patch->row_begin + row], column, moves)) {
      Surroundings triangles = surroundings_of(point, moves, patch, p.texture_width, j, row, from, diagonals);
      if (triangles.area > 0.0f) {
        squares[i] = form_of(triangles.off, moved);
        choose_halves(texel, &triangles, moved);
        squares[p.texel_count + i] = form_of(triangles.off, moved);
      }
    }
    all.x[i] = nearest_half(texel[0] + moved[0]), all.y[i] = nearest_half(texel[1] + moved[1]),
    all.z[i] = nearest_half(texel[2] + moved[2]);
  }
}
