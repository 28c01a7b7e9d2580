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

int chunks(std::size_t values) { return static_cast<int>((values + VERTEX_CHUNK - 1) / VERTEX_CHUNK); }
/// Work-items that share the vertices in no row.
ClRange other_range(const ClContext& context, const DeviceNeighbours& neighbours) {
  const int others = std::max(1, neighbours.vertex_count - neighbours.inner_count);
  return row_range(context, (others + FAN_CHUNK - 1) / FAN_CHUNK);
}

/// Sums that work-items leave behind, and where they are added up.
struct DeviceSums {
  ClBuffer<float> partials;
  ClBuffer<float> scalars;
};
DeviceSums allocate_sums(ClContext& context, const DeviceNeighbours& neighbours) {
  const std::size_t rows = row_range(context, std::max(neighbours.rows.size, neighbours.column_blocks.size)).global[0];
  const std::size_t others =
      std::max(fans_range(context, neighbours).global[0], other_range(context, neighbours).global[0]);
  const std::size_t vertices = row_range(context, chunks(neighbours.vertex_count)).global[0];
  return {context.allocate<float>(rows + others + vertices), context.allocate<float>(3)};
}
void sum_partials(ClContext& context, const DeviceSums& sums, std::size_t partials, int slot) {
  const std::size_t group =
      context.device().type == "cpu" ? 1 : context.work_group_size({kSolverFile, "sum_partials", kFastSums}, 256);
  context.launch({kSolverFile, "sum_partials", kFastSums}, ClRange({group, 1}, {group, 1}),
                 SolveParameters{static_cast<int>(partials), 0, slot, 0}, sums.partials, ClLocal{group * sizeof(float)},
                 sums.scalars);
}

/// Queues q = is_free (mass_share M + time L) p.
/// \return the number of partial sums of p q
std::size_t queue_operator(ClContext& context, const SurfaceOperator& surface, float mass_share, float time,
                           const ClBuffer<float>& is_free, const DeviceField& p, const DeviceField& q,
                           const ClBuffer<float>& partials) {
  const DeviceNeighbours& n = *surface.neighbours;
  const ClRange rows = rows_range(context, n), fans = fans_range(context, n);
  SurfaceParameters parameters = n.parameters(p.components);
  parameters.mass_share = mass_share;
  parameters.time = time;
  context.launch({kSolverFile, "apply_rows", kFastSums}, rows, parameters, n.rows, surface.weights, surface.mass,
                 is_free, p.values, q.values, partials);
  parameters.first_partial = static_cast<int>(rows.global[0]);
  context.launch({kSolverFile, "apply_fans", kFastSums}, fans, parameters, n.fan_vertices, n.fans, surface.fan_weights,
                 surface.mass, is_free, p.values, q.values, partials);
  return rows.global[0] + fans.global[0];
}

/// The values of a field at the vertices of the coarser lattice.
DeviceField pick_vertices(ClContext& context, const DeviceNeighbours& fine, const DeviceField& field) {
  const ClBuffer<int>& picks = fine.coarser->picks;
  DeviceField picked{field.components, context.allocate<float>(field.components * picks.size)};
  context.launch({kFile, "pick_vertices"}, ClRange(picks.size), fine.parameters(field.components), picks, field.values,
                 picked.values);
  return picked;
}

/// The preconditioner on one lattice and its coarser levels: the sum of solves along rows, solves along columns and the
/// next level's result for the residual. Symmetric and positive.
class Preconditioner {
 public:
  Preconditioner(ClContext& context, const SurfaceOperator& surface, float time, const ClBuffer<float>& is_free,
                 int components)
      : context_(&context),
        surface_(&surface),
        parameters_(surface.neighbours->parameters(components)),
        is_free_(is_free) {
    parameters_.time = time;
    const DeviceNeighbours& n = *surface.neighbours;
    const auto plane = [&] { return context.allocate<float>(n.vertex_count); };
    row_pivots_ = plane(), row_below_ = plane(), row_last_ = plane(), column_pivots_ = plane(), column_below_ = plane();
    context.launch({kSolverFile, "factor_rows", kFastSums}, rows_range(context, n), parameters_, n.rows,
                   surface.weights, surface.mass, surface.stiffness, is_free_, row_pivots_, row_below_, row_last_);
    context.launch({kSolverFile, "factor_columns", kFastSums}, columns(), parameters_, n.column_blocks, surface.weights,
                   surface.mass, surface.stiffness, is_free_, column_pivots_, column_below_);
    between_ = context.allocate<float>(static_cast<std::size_t>(components) * n.vertex_count);
    if (!surface.coarser) return;
    const DeviceField coarse_free = pick_vertices(context, n, {1, is_free});
    coarser_ = std::make_unique<Preconditioner>(context, *surface.coarser, time, coarse_free.values, components);
    coarse_r_ = context.allocate<float>(components * coarse_free.values.size);
    coarse_z_ = context.allocate<float>(coarse_r_.size);
  }

  /// Queues z.
  /// \return the number of partial sums of r z
  std::size_t queue(const ClBuffer<float>& r, const ClBuffer<float>& z, const ClBuffer<float>& partials) const {
    const DeviceNeighbours& n = *surface_->neighbours;
    SurfaceParameters parameters = parameters_;
    if (coarser_) {
      const DeviceCoarseLattice& coarse = *n.coarser;
      context_->launch({kSolverFile, "restrict_field", kFastSums}, ClRange(coarse.picks.size), parameters,
                       coarse.reader_begin, coarse.readers, coarse.reader_shares, r, coarse_r_);
      coarser_->queue(coarse_r_, coarse_z_, partials);
    }
    context_->launch({kSolverFile, "precondition_rows", kFastSums}, rows_range(*context_, n), parameters, n.rows,
                     row_pivots_, row_below_, row_last_, r, z);
    context_->launch({kSolverFile, "precondition_columns", kFastSums}, columns(), parameters, n.column_blocks,
                     column_pivots_, column_below_, is_free_, r, between_, z, partials);
    parameters.first_partial = static_cast<int>(columns().global[0]);
    context_->launch({kSolverFile, "precondition_others", kFastSums}, other_range(*context_, n), parameters,
                     surface_->mass, surface_->stiffness, is_free_, r, z, partials);
    parameters.first_partial += static_cast<int>(other_range(*context_, n).global[0]);
    if (coarser_) {
      const DeviceCoarseLattice& coarse = *n.coarser;
      const ClRange range = row_range(*context_, chunks(n.vertex_count));
      context_->launch({kSolverFile, "add_coarse_field", kFastSums}, range, parameters, coarse.sources, coarse.shares,
                       is_free_, coarse_z_, r, z, partials);
      parameters.first_partial += static_cast<int>(range.global[0]);
    }
    return parameters.first_partial;
  }

 private:
  ClRange columns() const { return row_range(*context_, surface_->neighbours->column_blocks.size); }

  ClContext* context_;
  const SurfaceOperator* surface_;
  SurfaceParameters parameters_;
  ClBuffer<float> is_free_;
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
  const SurfaceParameters parameters = neighbours.parameters(3);
  context.launch({kFile, "weigh_rows"}, rows_range(context, neighbours), parameters, neighbours.rows, points.values,
                 surface.weights, surface.mass, surface.stiffness);
  context.launch({kFile, "weigh_fans"}, fans_range(context, neighbours), parameters, neighbours.fan_vertices,
                 neighbours.fans, points.values, surface.weights, surface.fan_weights, surface.mass, surface.stiffness);
  if (neighbours.coarser)
    surface.coarser = std::make_shared<const SurfaceOperator>(
        make_surface_operator(context, neighbours.coarser->neighbours, pick_vertices(context, neighbours, points)));
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
  const auto field = [&] { return DeviceField{b.components, context.allocate<float>(b.values.size)}; };
  SolveResult result{field(), {}};
  const DeviceField r = field(), p = field(), q = field(), z = field();
  const DeviceSums sums = allocate_sums(context, n);
  const ClRange range = row_range(context, chunks(b.values.size));
  const Preconditioner preconditioner(context, surface, time, is_free, b.components);
  const auto precondition = [&](int slot) {
    sum_partials(context, sums, preconditioner.queue(r.values, z.values, sums.partials), slot);
  };
  const auto parameters = [&](int slot, int other_slot) {
    return SolveParameters{static_cast<int>(b.values.size), n.vertex_count, slot, other_slot};
  };
  const auto turn_direction = [&](int old_rz, int new_rz) {
    context.launch({kSolverFile, "turn_direction", kFastSums}, range, parameters(old_rz, new_rz), sums.scalars,
                   z.values, p.values);
  };

  context.launch({kSolverFile, "begin_solve", kFastSums}, range, parameters(0, 0), is_free, b.values, result.x.values,
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
    context.launch({kSolverFile, "take_step", kFastSums}, range, parameters(old_rz, kPq), sums.scalars, p.values,
                   q.values, result.x.values, r.values);
    precondition(new_rz);
    turn_direction(old_rz, new_rz);
    result.report.steps = step + 1;
    if ((step + 1) % kStepsBetweenLooks == 0 || step + 1 == most_steps)
      result.report.residual = std::sqrt(static_cast<double>(context.download(sums.scalars)[new_rz]) / first);
  }
  return result;
}

SolveResult interpolate_field(ClContext& context, const SurfaceOperator& surface, double time,
                              const std::vector<float>& is_free, const DeviceField& negated) {
  constexpr double kTolerance = 1e-3;
  const auto free = context.upload(is_free);
  const auto float_time = static_cast<float>(time);
  return solve_diffusion(context, surface, float_time, free,
                         apply_operator(context, surface, 1, float_time, free, negated), kTolerance);
}

void add_solve(const SolveReport& solve, SolveReport& all) {
  all.steps += solve.steps;
  all.residual = std::max(all.residual, solve.residual);
}

DeviceField area_vectors(ClContext& context, const DeviceNeighbours& neighbours, const DeviceField& points) {
  DeviceField vectors{3, context.allocate<float>(points.values.size)};
  context.launch({kFile, "sum_row_vectors"}, rows_range(context, neighbours), neighbours.parameters(3), neighbours.rows,
                 points.values, vectors.values);
  context.launch({kFile, "sum_fan_vectors"}, fans_range(context, neighbours), neighbours.parameters(3),
                 neighbours.fan_vertices, neighbours.fans, points.values, vectors.values);
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
