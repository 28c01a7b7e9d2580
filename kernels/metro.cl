// SPDX-License-Identifier: MIT
// The nearest triangle of a mesh to each of many points.
//
// In:   points           planes x, y, z; relative to the tree's origin, in units of its scale. Points that follow each
//                        other should be near each other: each starts from its predecessor's block.
//       boxes            six vectors per node: least x, y, z and greatest x, y, z of its eight children
//       blocks           nine vectors per block of eight triangles: first vertex, edge to the second, edge to the third
//       level_begin      per level of the tree, its first node in `boxes`; level 0 are the blocks
//                        (layout: core/skeletex/geometry/triangle_tree.h)
// Out:  nearest          per point, the nearest triangle's place in the tree
//       nearest_squared  per point, its squared distance, as exact as float32 allows
// NDRange: one item per `run` consecutive points.
//
// Vectors of eight are the width of the tree, not of a pixel: one point against eight boxes or triangles at a time
// fills the registers of a CPU and is plain scalar code on a GPU. At most 8 levels above the blocks (134 million
// triangles).

#include "metro_structs.h"
#include "planes.h"

#define STACK_SIZE 64
#define BEYOND_ALL 1e30f  // less than to the places past the end
#define LEVEL_SHIFT 27
#define INDEX_MASK ((1 << LEVEL_SHIFT) - 1)

inline float least_of(const float8 x) {
  const float4 a = min(x.lo, x.hi);
  const float2 b = min(a.lo, a.hi);
  return min(b.x, b.y);
}

// Bit k is set where the comparison of lane k holds.
inline uint bits_of(const int8 comparison) {
  const int8 bits = comparison & (int8)(1, 2, 4, 8, 16, 32, 64, 128);
  const int4 a = bits.lo | bits.hi;
  const int2 b = a.lo | a.hi;
  return (uint)(b.x | b.y);
}

// Place of the lowest bit that is set.
inline uint lowest_bit(const uint bits) { return popcount((bits & (0u - bits)) - 1u); }

// Squared distance to eight segments from the origin to (ex, ey, ez); a segment may be a point.
inline float8 squared_to_edges(const float8 x, const float8 y, const float8 z, const float8 ex, const float8 ey,
                               const float8 ez) {
  const float8 squared = max(ex * ex + ey * ey + ez * ez, (float8)(1e-37f));
  const float8 t = clamp((x * ex + y * ey + z * ez) / squared, (float8)(0.0f), (float8)(1.0f));
  const float8 rx = x - t * ex, ry = y - t * ey, rz = z - t * ez;
  return rx * rx + ry * ry + rz * rz;
}

// Squared distances from a point to the eight triangles of a block. The least of the distances to the three edges and,
// where the point's foot lies in the triangle, to the foot: every candidate is a point of the triangle, so that slivers
// can make the result slightly too large but never too small.
inline float8 squared_to_block(global const float8* restrict block, const float px, const float py, const float pz) {
  const float8 ux = block[3], uy = block[4], uz = block[5];
  const float8 wx = block[6], wy = block[7], wz = block[8];
  const float8 dx = px - block[0], dy = py - block[1], dz = pz - block[2];
  const float8 nx = uy * wz - uz * wy, ny = uz * wx - ux * wz, nz = ux * wy - uy * wx;
  const float8 scale = 1.0f / max(nx * nx + ny * ny + nz * nz, (float8)(1e-37f));
  const float8 s = scale * (nx * (dy * wz - dz * wy) + ny * (dz * wx - dx * wz) + nz * (dx * wy - dy * wx));
  const float8 t = scale * (nx * (uy * dz - uz * dy) + ny * (uz * dx - ux * dz) + nz * (ux * dy - uy * dx));
  const float8 fx = dx - s * ux - t * wx, fy = dy - s * uy - t * wy, fz = dz - s * uz - t * wz;
  const int8 is_inside = (s >= 0.0f) & (t >= 0.0f) & (s + t <= 1.0f);
  const float8 to_foot = select((float8)(1e37f), fx * fx + fy * fy + fz * fz, is_inside);
  const float8 to_first = squared_to_edges(dx, dy, dz, ux, uy, uz);
  const float8 to_second = squared_to_edges(dx, dy, dz, wx, wy, wz);
  const float8 to_third = squared_to_edges(dx - ux, dy - uy, dz - uz, wx - ux, wy - uy, wz - uz);
  return min(min(to_foot, to_first), min(to_second, to_third));
}

inline float8 squared_to_boxes(global const float8* restrict node, const float px, const float py, const float pz) {
  const float8 dx = max(max(node[0] - px, px - node[3]), (float8)(0.0f));
  const float8 dy = max(max(node[1] - py, py - node[4]), (float8)(0.0f));
  const float8 dz = max(max(node[2] - pz, pz - node[5]), (float8)(0.0f));
  return dx * dx + dy * dy + dz * dz;
}

kernel void find_nearest_triangles(const NearestParameters p, global const float* restrict points,
                                   global const float8* restrict boxes, global const float8* restrict blocks,
                                   constant int* restrict level_begin, global int* restrict nearest,
                                   global float* restrict nearest_squared) {
  PLANES(global const float, px, py, pz, points, p.count);
  const int begin = (int)get_global_id(0) * p.run;
  const int end = min(begin + p.run, p.count);
  int block = -1;  // the previous point's
  for (int i = begin; i < end; ++i) {
    const float x = px[i], y = py[i], z = pz[i];
    const int first_block = block;
    float best = BEYOND_ALL;
    int best_place = -1;
    if (first_block >= 0) {
      const float8 squared = squared_to_block(blocks + 9 * first_block, x, y, z);
      const float least = least_of(squared);
      if (least < best) {
        best = least;
        best_place = 8 * first_block + (int)lowest_bit(bits_of(squared <= (float8)(best)));
      }
    }
    int stack_node[STACK_SIZE];
    float stack_squared[STACK_SIZE];
    int size = 0;
    int level = p.top_level, index = 0;
    while (best > p.enough_squared) {
      if (level > 0) {
        const float8 squared = squared_to_boxes(boxes + 6 * (level_begin[level] + index), x, y, z);
        uint lanes = bits_of(squared < (float8)(best));
        if (lanes != 0u) {
          // The nearest child next, the others later.
          float lane_squared[8];
          vstore8(squared, 0, lane_squared);
          uint next = lowest_bit(lanes);
          lanes &= lanes - 1u;
          while (lanes != 0u) {
            uint other = lowest_bit(lanes);
            lanes &= lanes - 1u;
            if (lane_squared[other] < lane_squared[next]) {
              const uint swapped = next;
              next = other;
              other = swapped;
            }
            stack_node[size] = ((level - 1) << LEVEL_SHIFT) | (8 * index + (int)other);
            stack_squared[size] = lane_squared[other];
            ++size;
          }
          index = 8 * index + (int)next;
          --level;
          continue;
        }
      } else if (index != first_block) {
        const float8 squared = squared_to_block(blocks + 9 * index, x, y, z);
        const float least = least_of(squared);
        if (least < best) {
          best = least;
          block = index;
          best_place = 8 * index + (int)lowest_bit(bits_of(squared <= (float8)(best)));
        }
      }
      while (size > 0 && stack_squared[size - 1] >= best) --size;
      if (size == 0) break;
      --size;
      level = stack_node[size] >> LEVEL_SHIFT;
      index = stack_node[size] & INDEX_MASK;
    }
    nearest[i] = max(best_place, 0);
    nearest_squared[i] = best;
  }
}
