// SPDX-License-Identifier: MIT
// What host and device share of the sparse elimination. Read by C++20 and by OpenCL C 1.2; all members are 4 bytes
// wide, no padding.
#ifndef SKELETEX_ELIMINATION_STRUCTS_H
#define SKELETEX_ELIMINATION_STRUCTS_H

#define ELIMINATION_TILE 8  // rows and columns of dense matrices are padded to this

#ifndef __OPENCL_C_VERSION__
namespace skeletex {
#endif

/// Vertices that are eliminated together, and what comes of it: a dense matrix whose columns are first the pivots, then
/// the boundary, both padded.
typedef struct FrontRecord {
  int system;
  int axes;   ///< 1: of the first unknown; 2: of the second; 3: of both, whose matrices are the same here
  int first;  ///< the pivots are rows first to first + pivots - 1 of the system
  int pivots;
  int boundary;     ///< later neighbours, and one column more that stands for all fixed vertices
  int list;         ///< first entry of the boundary in `boundary_rows` and `parent_columns`
  int shared;       ///< so many of these, the first, are pivots of the parent
  int child_begin;  ///< its children are children[child_begin] to children[child_end - 1]: fronts whose
                    ///< boundaries lie in this one
  int child_end;
  int rows;     ///< the pivots' rows in `matrices`, in tiles' rows (ELIMINATION_TILE floats)
  int rest;     ///< the boundary's rows there
  int vectors;  ///< four rows of `vectors`, in the same unit
} FrontRecord;

/// Where the tables and planes begin in the buffers of the elimination.
typedef struct EliminationLayout {
  int children, boundary_rows, parent_columns;  ///< in `tables`; tasks are at 0: first front and end
  int row_begin;                                ///< in `tables`, per row and one more: its first value of the matrix
  int columns;                                  ///< in `tables`, per value: its column in the front of its row
  int fixed;     ///< in `system`, two planes, per row: what joins it to fixed vertices; values are at 0
  int roots;     ///< in `system`, per row: the scale of its unknown
  int residual;  ///< in `system`, two per row
  int solution;  ///< in `vectors`, two per row
  int rows;      ///< how many there are, of all systems
} EliminationLayout;

/// Which tasks a launch takes.
typedef struct EliminationParameters {
  EliminationLayout at;
  int is_new;       ///< the matrix has changed since the last factorization
  float tolerance;  ///< systems whose ratio is not above this are left out
  int task_begin, task_end;
  int queue;  ///< the entry of `queues` that counts the tasks taken
} EliminationParameters;

#ifndef __OPENCL_C_VERSION__
static_assert(sizeof(FrontRecord) == 4 * 12);
static_assert(sizeof(EliminationParameters) == 4 * 15);
}  // namespace skeletex
#endif
#endif
