// SPDX-License-Identifier: MIT
#include "skeletex/convert/parameterize/elimination.h"

#include <algorithm>
#include <utility>

namespace skeletex {
namespace {

/// One work-group takes whole subtrees of so many vertices: a share of all that keeps processors busy, within limits.
constexpr int kSubtrees = 32, kSmallestSubtree = 256, kLargestSubtree = 1024;
/// More groups than tasks do no harm, and drivers that hand groups to threads in blocks then use every thread.
constexpr int kLeastGroups = 64;

int padded(int count) { return (count + ELIMINATION_TILE - 1) / ELIMINATION_TILE * ELIMINATION_TILE; }

/// A run of fronts that one work-group takes, and when it can.
struct Task {
  int begin = 0, end = 0, stage = 0;
  double work = 0;
};

/// Adds the fronts of one system to the tables, and the tasks that they make.
class FrontBuilder {
 public:
  FrontBuilder(const OrderedGraph& system, int id, int subtree_size, EliminationTables& tables,
               std::vector<Task>& tasks)
      : system_(system),
        d_(system.dissection),
        id_(id),
        subtree_size_(subtree_size),
        s_(tables),
        tasks_(tasks),
        column_(d_.order.size(), -1),
        list_(d_.fronts.size()),
        records_(d_.fronts.size() + 1),
        stage_(d_.fronts.size(), 0),
        work_(d_.fronts.size(), 0) {}

  void run() {
    // Rows of padding before this system have no values.
    s_.row_begin.resize(system_.first_row + 1, static_cast<int>(s_.columns.size()));
    for (int f = 0; f < static_cast<int>(d_.fronts.size()); ++f) {
      number_columns(f);
      list_values(f);
      join_children(f);
      add_records(f);
      add_tasks(f);
    }
  }

 private:
  int pivots(int f) const { return padded(d_.fronts[f].pivots); }
  int boundary_size(int f) const { return static_cast<int>(d_.fronts[f].boundary.size()); }
  int width(int f) const { return pivots(f) + padded(boundary_size(f) + 1); }
  bool is_in_subtree(int f) const { return d_.fronts[f].size <= subtree_size_; }

  /// The columns of a front's vertices in it.
  void number_columns(int f) {
    const Front& front = d_.fronts[f];
    for (int i = 0; i < front.pivots; ++i) column_[front.first + i] = i;
    for (int i = 0; i < boundary_size(f); ++i) column_[front.boundary[i]] = pivots(f) + i;
  }

  /// The values of the pivots' rows: one per neighbour that is eliminated later.
  void list_values(int f) {
    const Front& front = d_.fronts[f];
    for (int number = front.first; number < front.first + front.pivots; ++number) {
      for (const int v : system_.graph.neighbours(d_.order[number]))
        if (d_.number[v] > number) s_.columns.push_back(column_[d_.number[v]]);
      s_.row_begin.push_back(static_cast<int>(s_.columns.size()));
    }
  }

  /// The columns of the children's boundaries in this front.
  void join_children(int f) {
    const Front& front = d_.fronts[f];
    for (const int child : front.children) {
      const std::vector<int>& joined = d_.fronts[child].boundary;
      for (std::size_t i = 0; i < joined.size(); ++i) s_.parent_columns[list_[child] + i] = column_[joined[i]];
      s_.parent_columns[list_[child] + joined.size()] = pivots(f) + boundary_size(f);
      const auto shared = std::lower_bound(joined.begin(), joined.end(), front.first + front.pivots) - joined.begin();
      for (int k = records_[child]; k < records_[child + 1]; ++k) s_.fronts[k].shared = static_cast<int>(shared);
    }
    list_[f] = static_cast<int>(s_.boundary_rows.size());
    for (const int number : front.boundary) s_.boundary_rows.push_back(system_.first_row + number);
    s_.boundary_rows.push_back(-1);  // fixed vertices
    s_.parent_columns.resize(s_.boundary_rows.size(), -1);
  }

  /// One record, or two where the two matrices differ.
  void add_records(int f) {
    const Front& front = d_.fronts[f];
    records_[f] = static_cast<int>(s_.fronts.size());
    const int boundary = width(f) - pivots(f);
    for (const int axes : front.is_last ? std::vector<int>{1, 2} : std::vector<int>{3}) {
      FrontRecord record{};
      record.system = id_;
      record.axes = axes;
      record.first = system_.first_row + front.first;
      record.pivots = front.pivots;
      record.boundary = boundary_size(f) + 1;
      record.list = list_[f];
      record.child_begin = static_cast<int>(s_.children.size());
      for (const int child : front.children) s_.children.push_back(records_[child]);
      record.child_end = static_cast<int>(s_.children.size());
      record.rows = s_.matrix_rows;
      s_.matrix_rows += pivots(f) * width(f) / ELIMINATION_TILE;
      record.rest = s_.matrix_rows;
      s_.matrix_rows += boundary * (boundary + ELIMINATION_TILE) / 2 / ELIMINATION_TILE;
      record.vectors = s_.vector_rows;
      s_.vector_rows += 4 * width(f) / ELIMINATION_TILE;
      s_.fronts.push_back(record);
    }
    records_[f + 1] = static_cast<int>(s_.fronts.size());
  }

  /// Fronts above subtrees are tasks of their own; a subtree is one when its last front is there.
  void add_tasks(int f) {
    const Front& front = d_.fronts[f];
    const int begin = records_[f], end = records_[f + 1];
    const double own_work = static_cast<double>(pivots(f)) * width(f) * width(f);
    work_[f] += (end - begin) * own_work;
    if (front.parent >= 0) work_[front.parent] += work_[f];
    if (!is_in_subtree(f)) {
      for (const int child : front.children) stage_[f] = std::max(stage_[f], stage_[child] + 1);
      for (int k = begin; k < end; ++k) tasks_.push_back({k, k + 1, stage_[f], own_work});
      return;
    }
    if (front.parent < 0 || !is_in_subtree(front.parent)) tasks_.push_back({records_[front.subtree], end, 0, work_[f]});
  }

  const OrderedGraph& system_;
  const Dissection& d_;
  int id_, subtree_size_;
  EliminationTables& s_;
  std::vector<Task>& tasks_;
  std::vector<int> column_;   ///< per number, in the front at hand
  std::vector<int> list_;     ///< per front, its boundary's first entry in `boundary_rows`
  std::vector<int> records_;  ///< per front, its first record
  std::vector<int> stage_;
  std::vector<double> work_;
};

}  // namespace

EliminationTables make_elimination_tables(std::span<const OrderedGraph> systems, int rows) {
  const int subtree_size = std::clamp(rows / kSubtrees, kSmallestSubtree, kLargestSubtree);
  EliminationTables tables;
  std::vector<Task> tasks;
  for (std::size_t i = 0; i < systems.size(); ++i)
    FrontBuilder(systems[i], static_cast<int>(i), subtree_size, tables, tasks).run();
  tables.row_begin.resize(rows + 1, static_cast<int>(tables.columns.size()));
  std::stable_sort(tasks.begin(), tasks.end(), [](const Task& a, const Task& b) {
    return a.stage != b.stage ? a.stage < b.stage : a.work > b.work;
  });
  for (const Task& task : tasks) {
    tables.stage_begin.resize(task.stage + 1, static_cast<int>(tables.tasks.size() / 2));
    tables.tasks.insert(tables.tasks.end(), {task.begin, task.end});
  }
  tables.stage_begin.push_back(static_cast<int>(tasks.size()));
  return tables;
}

Elimination::Elimination(ClContext& context, EliminationTables tables, int rows, std::size_t group_size,
                         const char* options)
    : context_(context),
      options_(options),
      group_size_(group_size),
      stage_begin_(std::move(tables.stage_begin)),
      fronts_(context.upload(tables.fronts)) {
  std::vector<int> joined = std::move(tables.tasks);
  const auto place = [&](const std::vector<int>& table) {
    const int begin = static_cast<int>(joined.size());
    joined.insert(joined.end(), table.begin(), table.end());
    return begin;
  };
  layout_.children = place(tables.children);
  layout_.boundary_rows = place(tables.boundary_rows);
  layout_.parent_columns = place(tables.parent_columns);
  layout_.row_begin = place(tables.row_begin);
  layout_.columns = place(tables.columns);
  tables_ = context.upload(joined);
  layout_.rows = rows;
  layout_.fixed = static_cast<int>(tables.columns.size());
  layout_.roots = layout_.fixed + 2 * rows;
  layout_.residual = layout_.roots + rows;
  system_ = context.allocate<float>(static_cast<std::size_t>(layout_.residual) + 2 * static_cast<std::size_t>(rows));
  layout_.solution = tables.vector_rows * ELIMINATION_TILE;
  matrices_ = context.allocate<float>(static_cast<std::size_t>(tables.matrix_rows) * ELIMINATION_TILE);
  vectors_ = context.allocate<float>(static_cast<std::size_t>(layout_.solution) + 2 * static_cast<std::size_t>(rows));
  queues_ = context.allocate<int>(2 * stage_begin_.size());
}

ClRange Elimination::range(const EliminationParameters& parameters) const {
  const std::size_t group = context_.work_group_size(kernel("eliminate_fronts"),
                                                     context_.work_group_size(kernel("substitute_back"), group_size_));
  const std::size_t groups = std::max(parameters.task_end - parameters.task_begin, kLeastGroups);
  return {{groups * group, 1}, {group, 1}};
}

void Elimination::solve(bool is_new, float tolerance, const ClBuffer<int>& ratios, ClBuffer<float>& unknowns) {
  const int stages = static_cast<int>(stage_begin_.size()) - 1;
  context_.fill(queues_, 0);
  EliminationParameters parameters{layout_, is_new ? 1 : 0, tolerance, 0, 0, 0};
  const auto take_stage = [&](int stage) {
    parameters.task_begin = stage_begin_[stage];
    parameters.task_end = stage_begin_[stage + 1];
    return range(parameters);
  };
  for (int stage = 0; stage < stages; ++stage, ++parameters.queue)
    context_.launch(kernel("eliminate_fronts"), take_stage(stage), parameters, fronts_, tables_, system_, ratios,
                    queues_, matrices_, vectors_);
  for (int stage = stages - 1; stage >= 0; --stage, ++parameters.queue)
    context_.launch(kernel("substitute_back"), take_stage(stage), parameters, fronts_, tables_, system_, ratios,
                    queues_, matrices_, vectors_, unknowns);
}

}  // namespace skeletex
