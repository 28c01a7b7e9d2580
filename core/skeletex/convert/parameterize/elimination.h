// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "elimination_structs.h"
#include "skeletex/convert/parameterize/dissection.h"
#include "skeletex/device/context.h"

namespace skeletex {

/// The fronts of systems in the layout of elimination.cl.
struct EliminationTables {
  std::vector<FrontRecord> fronts;
  std::vector<int> children, boundary_rows, parent_columns;
  std::vector<int> row_begin, columns;   ///< see EliminationLayout
  std::vector<int> tasks, stage_begin;   ///< tasks: first front and end, largest first in each stage
  int matrix_rows = 0, vector_rows = 0;  ///< of ELIMINATION_TILE floats
};

/// A system to be eliminated: the graph of its matrix, in an order, from a row on.
struct OrderedGraph {
  SparseGraph graph;
  Dissection dissection;
  int first_row = 0;
};

/// \param rows  of all systems; those that no unknown has are padding
EliminationTables make_elimination_tables(std::span<const OrderedGraph> systems, int rows);

/// Solves symmetric sparse systems on the device, in single precision, for two right sides each (elimination.cl). The
/// caller's kernels write matrix, scale and residuals to `system`; solve() adds the solution to the unknowns.
class Elimination {
 public:
  /// \param group_size  work-items of a group \param options  of the kernels, see work_group.h
  Elimination(ClContext& context, EliminationTables tables, int rows, std::size_t group_size, const char* options);

  /// Values of the matrix, and from `layout` on what joins rows to fixed vertices, roots and residuals.
  ClBuffer<float>& system() { return system_; }
  const EliminationLayout& layout() const { return layout_; }

  /// \param is_new     the matrix has changed since the last call
  /// \param ratios     per system, a float as bits: those above `tolerance` are solved
  /// \param unknowns   four floats per row: two values, and what they are more than their floats
  void solve(bool is_new, float tolerance, const ClBuffer<int>& ratios, ClBuffer<float>& unknowns);

 private:
  ClKernelName kernel(std::string_view name) const { return {"elimination.cl", name, options_}; }
  ClRange range(const EliminationParameters& parameters) const;

  ClContext& context_;
  const char* options_;
  std::size_t group_size_;
  std::vector<int> stage_begin_;
  EliminationLayout layout_{};
  ClBuffer<FrontRecord> fronts_;
  ClBuffer<int> tables_, queues_;
  ClBuffer<float> system_, matrices_, vectors_;
};

}  // namespace skeletex
