// SPDX-License-Identifier: MIT
#include "skeletex/edit/filter/diffusion.h"

#include <algorithm>
#include <cmath>

#include "skeletex/model/error.h"
#include "skeletex/reconstruct/displace.h"

namespace skeletex {
namespace {

constexpr const char *kFile = "filter.cl", *kSolverFile = "diffusion.cl";
// Sums may be taken in any order that the compiler likes: their loops become vector instructions.
constexpr const char* kFastSums = "-cl-unsafe-math-optimizations";
constexpr int kFanChunk = 64, kVertexChunk = 4096;  // FAN_CHUNK, VERTEX_CHUNK of the kernels

int chunks(std::size_t values, int chunk) { return static_cast<int>((values + chunk - 1) / chunk); }
ClRange fan_range(const ClContext& context, const DeviceNeighbours& neighbours) {
  return row_range(context, chunks(neighbours.fan_vertices.size, kFanChunk));
}
/// Work-items that share the vertices in no row.
ClRange other_range(const ClContext& context, const DeviceNeighbours& neighbours) {
  return row_range(context, chunks(std::max(1, neighbours.vertex_count - neighbours.inner_count), kFanChunk));
}

int size(const auto& buffer) { return static_cast<int>(buffer.size); }

/// Sums that work-items leave behind, and where they are added up.
struct DeviceSums {
  ClBuffer<float> partials;
  ClBuffer<float> scalars;
};
DeviceSums allocate_sums(ClContext& context, const DeviceNeighbours& neighbours) {
  const std::size_t rows = row_range(context, std::max(neighbours.rows.size, neighbours.column_blocks.size)).global[0];
  const std::size_t others =
      std::max(fan_range(context, neighbours).global[0], other_range(context, neighbours).global[0]);
  const std::size_t vertices = row_range(context, chunks(neighbours.vertex_count, kVertexChunk)).global[0];
  return {context.allocate<float>(rows + others + vertices), context.allocate<float>(3)};
}
void sum_partials(ClContext& context, const DeviceSums& sums, std::size_t partials, int slot) {
  const std::size_t group =
      context.device().type == "cpu" ? 1 : context.work_group_size({kSolverFile, "sum_partials", kFastSums}, 256);
  context.launch({kSolverFile, "sum_partials", kFastSums}, ClRange({group, 1}, {group, 1}), static_cast<int>(partials),
                 slot, sums.partials, ClLocal{group * sizeof(float)}, sums.scalars);
}

/// Queues q = is_free (mass_share M + time L) p. \return the number of partial sums of p q
std::size_t queue_operator(ClContext& context, const SurfaceOperator& surface, float mass_share, float time,
                           const ClBuffer<float>& is_free, const DeviceField& p, const DeviceField& q,
                           const ClBuffer<float>& partials) {
  const DeviceNeighbours& n = *surface.neighbours;
  const ClRange rows = row_range(context, n.rows.size), fans = fan_range(context, n);
  context.launch({kSolverFile, "apply_rows", kFastSums}, rows, size(n.rows), p.components, n.vertex_count, mass_share,
                 time, n.rows, surface.weights, surface.mass, is_free, p.values, q.values, partials);
  context.launch({kSolverFile, "apply_fans", kFastSums}, fans, size(n.fan_vertices), n.inner_count, p.components,
                 n.vertex_count, static_cast<int>(rows.global[0]), mass_share, time, n.fan_vertices, n.fan_begin,
                 n.fans, surface.fan_weights, surface.mass, is_free, p.values, q.values, partials);
  return rows.global[0] + fans.global[0];
}

/// The values of a field at the vertices of the coarser lattice.
DeviceField pick_vertices(ClContext& context, const DeviceCoarseLattice& coarse, int count, const DeviceField& field) {
  DeviceField picked{field.components, context.allocate<float>(field.components * coarse.picks.size)};
  context.launch({kFile, "pick_vertices"}, ClRange(coarse.picks.size), size(coarse.picks), field.components, count,
                 coarse.picks, field.values, picked.values);
  return picked;
}

/// The preconditioner on one lattice and those below it: solves along rows and along columns, and what the next level
/// makes of the residual, added up. Symmetric and positive, whatever the levels are.
class Preconditioner {
 public:
  Preconditioner(ClContext& context, const SurfaceOperator& surface, float time, const ClBuffer<float>& is_free,
                 int components)
      : context_(&context),
        surface_(&surface),
        is_free_(is_free),
        time_(time),
        components_(components),
        count_(surface.neighbours->vertex_count) {
    const DeviceNeighbours& n = *surface.neighbours;
    const auto plane = [&] { return context.allocate<float>(count_); };
    row_pivots_ = plane(), row_below_ = plane(), row_last_ = plane(), column_pivots_ = plane(), column_below_ = plane();
    context.launch({kSolverFile, "factor_rows", kFastSums}, rows(), size(n.rows), time, n.rows, surface.weights,
                   surface.mass, surface.stiffness, is_free_, row_pivots_, row_below_, row_last_);
    context.launch({kSolverFile, "factor_columns", kFastSums}, columns(), size(n.column_blocks), count_, time,
                   n.column_blocks, surface.weights, surface.mass, surface.stiffness, is_free_, column_pivots_,
                   column_below_);
    between_ = context.allocate<float>(static_cast<std::size_t>(components) * count_);
    if (!surface.coarser) return;
    const DeviceCoarseLattice& coarse = *n.coarser;
    const DeviceField free_below = pick_vertices(context, coarse, count_, {1, is_free});
    coarser_ = std::make_unique<Preconditioner>(context, *surface.coarser, time, free_below.values, components);
    coarse_r_ = context.allocate<float>(static_cast<std::size_t>(components) * coarse.picks.size);
    coarse_z_ = context.allocate<float>(coarse_r_.size);
  }

  /// Queues z. \return the number of partial sums of r z
  std::size_t queue(const ClBuffer<float>& r, const ClBuffer<float>& z, const ClBuffer<float>& partials) const {
    const DeviceNeighbours& n = *surface_->neighbours;
    if (coarser_) {
      const DeviceCoarseLattice& coarse = *n.coarser;
      context_->launch({kSolverFile, "restrict_field", kFastSums}, ClRange(coarse.picks.size), size(coarse.picks),
                       components_, count_, coarse.reader_begin, coarse.readers, coarse.reader_shares, r, coarse_r_);
      coarser_->queue(coarse_r_, coarse_z_, partials);
    }
    context_->launch({kSolverFile, "precondition_rows", kFastSums}, rows(), size(n.rows), components_, count_, n.rows,
                     row_pivots_, row_below_, row_last_, r, z);
    context_->launch({kSolverFile, "precondition_columns", kFastSums}, columns(), size(n.column_blocks), components_,
                     count_, n.column_blocks, column_pivots_, column_below_, is_free_, r, between_, z, partials);
    std::size_t sums = columns().global[0];
    context_->launch({kSolverFile, "precondition_others", kFastSums}, other_range(*context_, n), n.inner_count,
                     components_, count_, static_cast<int>(sums), time_, surface_->mass, surface_->stiffness, is_free_,
                     r, z, partials);
    sums += other_range(*context_, n).global[0];
    if (coarser_) {
      const DeviceCoarseLattice& coarse = *n.coarser;
      const ClRange range = row_range(*context_, chunks(count_, kVertexChunk));
      context_->launch({kSolverFile, "add_coarse_field", kFastSums}, range, components_, count_, size(coarse.picks),
                       static_cast<int>(sums), coarse.sources, coarse.shares, is_free_, coarse_z_, r, z, partials);
      sums += range.global[0];
    }
    return sums;
  }

 private:
  ClRange rows() const { return row_range(*context_, surface_->neighbours->rows.size); }
  ClRange columns() const { return row_range(*context_, surface_->neighbours->column_blocks.size); }

  ClContext* context_;
  const SurfaceOperator* surface_;
  ClBuffer<float> is_free_;
  float time_;
  int components_, count_;
  ClBuffer<float> row_pivots_, row_below_, row_last_, column_pivots_, column_below_, between_;
  std::unique_ptr<Preconditioner> coarser_;
  ClBuffer<float> coarse_r_, coarse_z_;
};

}  // namespace

SurfaceOperator make_surface_operator(ClContext& context, const DeviceNeighbours& neighbours,
                                      const DeviceField& points) {
  const std::size_t count = neighbours.vertex_count;
  SurfaceOperator surface{&neighbours,
                          context.allocate<float>(4 * count),
                          context.allocate<float>(2 * neighbours.fans.size),
                          context.allocate<float>(count),
                          context.allocate<float>(count),
                          nullptr};
  context.launch({kFile, "weigh_rows"}, row_range(context, neighbours.rows.size), size(neighbours.rows),
                 neighbours.vertex_count, neighbours.rows, points.values, surface.weights, surface.mass,
                 surface.stiffness);
  context.launch({kFile, "weigh_fans"}, fan_range(context, neighbours), size(neighbours.fan_vertices),
                 neighbours.inner_count, neighbours.vertex_count, neighbours.fan_vertices, neighbours.fan_begin,
                 neighbours.fans, points.values, surface.weights, surface.fan_weights, surface.mass, surface.stiffness);
  if (neighbours.coarser)
    surface.coarser = std::make_shared<const SurfaceOperator>(
        make_surface_operator(context, neighbours.coarser->neighbours,
                              pick_vertices(context, *neighbours.coarser, neighbours.vertex_count, points)));
  return surface;
}

DeviceField apply_operator(ClContext& context, const SurfaceOperator& surface, float mass_share, float time,
                           const ClBuffer<float>& is_free, const DeviceField& x) {
  DeviceField q{x.components, context.allocate<float>(x.values.size)};
  const DeviceSums sums = allocate_sums(context, *surface.neighbours);
  queue_operator(context, surface, mass_share, time, is_free, x, q, sums.partials);
  return q;
}

SolveResult solve_diffusion(ClContext& context, const SurfaceOperator& surface, float time,
                            const ClBuffer<float>& is_free, const DeviceField& b, double tolerance, int most_steps) {
  constexpr int kStepsBetweenLooks = 4;
  constexpr int kPq = 2;  // slots 0 and 1 hold r z of even and odd steps
  const DeviceNeighbours& n = *surface.neighbours;
  const int count = n.vertex_count, values = size(b.values);
  const auto field = [&] { return DeviceField{b.components, context.allocate<float>(b.values.size)}; };
  SolveResult result{field(), {}};
  const DeviceField r = field(), p = field(), q = field(), z = field();
  const DeviceSums sums = allocate_sums(context, n);
  const ClRange range = row_range(context, chunks(b.values.size, kVertexChunk));
  const Preconditioner preconditioner(context, surface, time, is_free, b.components);
  const auto precondition = [&](int slot) {
    sum_partials(context, sums, preconditioner.queue(r.values, z.values, sums.partials), slot);
  };
  const auto turn_direction = [&](int old_rz, int new_rz) {
    context.launch({kSolverFile, "turn_direction", kFastSums}, range, values, old_rz, new_rz, sums.scalars, z.values,
                   p.values);
  };

  context.launch({kSolverFile, "begin_solve", kFastSums}, range, values, count, is_free, b.values, result.x.values,
                 r.values, p.values);
  precondition(0);
  turn_direction(0, 0);
  const double first = context.download(sums.scalars)[0];
  if (!std::isfinite(first))
    throw InputError("the surface is too far out of shape to be filtered: its weights are no finite numbers");
  result.report.residual = first > 0 ? 1 : 0;
  for (int step = 0; step < most_steps && result.report.residual > tolerance; ++step) {
    const int old_rz = step % 2, new_rz = 1 - old_rz;
    sum_partials(context, sums, queue_operator(context, surface, 1.0f, time, is_free, p, q, sums.partials), kPq);
    context.launch({kSolverFile, "take_step", kFastSums}, range, values, old_rz, kPq, sums.scalars, p.values, q.values,
                   result.x.values, r.values);
    precondition(new_rz);
    turn_direction(old_rz, new_rz);
    result.report.steps = step + 1;
    if ((step + 1) % kStepsBetweenLooks == 0 || step + 1 == most_steps)
      result.report.residual = std::sqrt(static_cast<double>(context.download(sums.scalars)[new_rz]) / first);
  }
  return result;
}

DeviceField area_vectors(ClContext& context, const DeviceNeighbours& neighbours, const DeviceField& points) {
  DeviceField vectors{3, context.allocate<float>(points.values.size)};
  context.launch({kFile, "sum_row_vectors"}, row_range(context, neighbours.rows.size), size(neighbours.rows),
                 neighbours.vertex_count, neighbours.rows, points.values, vectors.values);
  context.launch({kFile, "sum_fan_vectors"}, fan_range(context, neighbours), size(neighbours.fan_vertices),
                 neighbours.inner_count, neighbours.vertex_count, neighbours.fan_vertices, neighbours.fan_begin,
                 neighbours.fans, points.values, vectors.values);
  return vectors;
}

DeviceField upload_points(ClContext& context, std::span<const Vec3> positions, const Vec3& origin, double unit) {
  std::vector<float> values(3 * positions.size());
  for (int axis = 0; axis < 3; ++axis)
    for (std::size_t i = 0; i < positions.size(); ++i)
      values[axis * positions.size() + i] = static_cast<float>((positions[i][axis] - origin[axis]) / unit);
  return {3, context.upload(values)};
}

std::vector<Vec3> download_vectors(ClContext& context, const DeviceField& field) {
  const std::vector<float> values = context.download(field.values);
  const std::size_t count = values.size() / 3;
  std::vector<Vec3> vectors(count);
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (std::size_t i = 0; i < count; ++i) vectors[i][static_cast<int>(axis)] = values[axis * count + i];
  return vectors;
}

}  // namespace skeletex
