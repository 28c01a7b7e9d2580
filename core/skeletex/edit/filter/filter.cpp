// SPDX-License-Identifier: MIT
#include "skeletex/edit/filter/filter.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "skeletex/edit/filter/move_surface.h"
#include "skeletex/edit/regular_grid.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/layers/layer_values.h"
#include "skeletex/skeleton/find_bone.h"

namespace skeletex {
namespace {

void check_length(double value, const char* what, double least, double most) {
  if (!(value >= least && value <= most))
    throw InputError(fmt::format("{} is {}; give {} to {} diagonals", what, value, least, most));
}

/// What a filter needs of the model that it works on.
struct FilterJob {
  ClContext& context;
  const SkeletexModel& given;
  SkeletexModel model;  ///< the given one on a regular grid, where the solver takes far fewer steps
  ModelSurface surface;
  SurfaceOperator laplace;
  std::vector<float> weights;  ///< of the region, per vertex
  double volume = 0;           ///< world units cubed
  SolveReport solver;

  FilterJob(ClContext& on, const SkeletexModel& of, const FilterRegion& region);
  double unit() const { return model.diagonal; }
};

/// Vertices whose bones all belong to the region.
std::vector<float> inside_region(const SkeletexModel& model, const Lattice& lattice, const FilterRegion& region) {
  std::vector<bool> is_chosen(model.patches.size(), region.bones.empty());
  for (const std::string& name : region.bones) {
    const std::optional<int> bone = find_bone(model.skeleton, name);
    if (!bone) throw InputError(fmt::format("the skeleton has no bone \"{}\" to filter", name));
    is_chosen[*bone] = true;
  }
  std::vector<float> inside(lattice.vertex_count, 0.f);
  for (std::size_t bone = 0; bone < model.patches.size(); ++bone) {
    if (!is_chosen[bone]) continue;
    const Rectangle& rectangle = model.patches[bone].rectangle;
    std::fill_n(inside.begin() + lattice.first_inner[bone], rectangle.width * (rectangle.height - 2), 1.f);
  }
  mark_ends(model, lattice, is_chosen, inside);
  return inside;
}

/// 0 at the boundary and outside, towards 1 inside: the solution of (M + falloff^2 L) w = M, which approaches 1 as
/// exp(-distance / falloff) falls, made smooth at 0.
std::vector<float> weigh_region(ClContext& context, const SurfaceOperator& laplace, std::vector<float> inside,
                                double falloff, SolveReport& report) {
  if (std::find(inside.begin(), inside.end(), 0.f) == inside.end() || falloff == 0) return inside;
  const DeviceField masses{1, laplace.mass};
  SolveResult solved =
      solve_diffusion(context, laplace, static_cast<float>(falloff * falloff), context.upload(inside), masses);
  add_solve(solved.report, report);
  std::vector<float> weights = context.download(solved.x.values);
  for (std::size_t i = 0; i < weights.size(); ++i) {
    const float w = std::clamp(weights[i], 0.f, 1.f);
    weights[i] = inside[i] * w * w * (3 - 2 * w);
  }
  return weights;
}

FilterJob::FilterJob(ClContext& on, const SkeletexModel& of, const FilterRegion& region)
    : context(on),
      given(of),
      model(regular_grid(on, of)),
      surface(upload_surface(on, model)),
      laplace(make_surface_operator(on, surface.neighbours, surface.points)) {
  check_length(region.falloff, "the fall-off at the region's boundary", 0, 1);
  volume = enclosed_volume(model, surface.positions, area_vectors_at(on, model, surface, surface.positions));
  weights = weigh_region(context, laplace, inside_region(model, surface.lattice, region), region.falloff, solver);
}

/// The moves of a surface that diffuses, world units: the solution of (M + time L) d = -time L x.
std::vector<Vec3> diffusion_moves(FilterJob& job, const DeviceField& points, const SurfaceOperator& laplace,
                                  double scale) {
  const auto time = static_cast<float>(scale * scale);
  const auto everywhere = job.context.upload(std::vector<float>(job.weights.size(), 1.f));
  const DeviceField b = apply_operator(job.context, laplace, 0, -time, everywhere, points);
  const SolveResult solved = solve_diffusion(job.context, laplace, time, everywhere, b);
  add_solve(solved.report, job.solver);
  std::vector<Vec3> moves = download_vectors(job.context, solved.x);
  for (Vec3& move : moves) move *= job.unit();
  return moves;
}

/// Sets the texels outside of the region to those of the given model.
void keep_outside(const FilterJob& job, SkeletexModel& model) {
  bool has_outside = false;
  for (std::size_t bone = 0; bone < model.patches.size(); ++bone) {
    const auto [x, y, width, height] = model.patches[bone].rectangle;
    for (int row = 1; row + 1 < height; ++row)
      for (int j = 0; j < width; ++j) {
        if (job.weights[job.surface.lattice.first_inner[bone] + (row - 1) * width + j] != 0) continue;
        has_outside = true;
        const std::size_t texel = static_cast<std::size_t>(y + row) * model.texture.width + x + j;
        model.texture.along[texel] = job.given.texture.along[texel];
        model.texture.around[texel] = job.given.texture.around[texel];
        model.texture.out[texel] = job.given.texture.out[texel];
        for (Layer& layer : model.layers)
          if (const Layer* const given = find_layer(job.given, layer.name))
            for (std::size_t k = 0; k < std::min(layer.planes.size(), given->planes.size()); ++k)
              layer.planes[k][texel] = given->planes[k][texel];
      }
  }
  if (!has_outside) return;
  model.diagonals = job.given.diagonals;
  model.sampling = job.given.sampling;
}

/// The model with its surface moved, by the region's weights.
FilterResult finish(FilterJob& job, std::vector<Vec3> moves) {
  for (std::size_t i = 0; i < moves.size(); ++i) moves[i] *= static_cast<double>(job.weights[i]);
  MovedModel moved = move_surface(job.context, job.model, job.surface, job.laplace, moves);
  add_solve(job.solver, moved.report.solver);
  keep_outside(job, moved.model);
  return {std::move(moved.model), {moved.report, job.volume}};
}

/// Adds moves along the normals that restore the volume, by Newton's method.
void restore_volume(const FilterJob& job, std::vector<Vec3>& moves) {
  for (int round = 0; round < 4; ++round) {
    std::vector<Vec3> positions = job.surface.positions;
    for (std::size_t i = 0; i < positions.size(); ++i) positions[i] += static_cast<double>(job.weights[i]) * moves[i];
    const std::vector<Vec3> vectors = area_vectors_at(job.context, job.model, job.surface, positions);
    double area = 0;
    for (std::size_t i = 0; i < vectors.size(); ++i) area += static_cast<double>(job.weights[i]) * vectors[i].norm();
    if (!(area > 0)) return;
    const double offset = (job.volume - enclosed_volume(job.model, positions, vectors)) / area;
    for (std::size_t i = 0; i < moves.size(); ++i) moves[i] += offset * vectors[i].normalized();
  }
}

}  // namespace

std::vector<float> region_weights(ClContext& context, const SkeletexModel& model, const FilterRegion& region) {
  return FilterJob(context, model, region).weights;
}

FilterResult smooth_model(ClContext& context, const SkeletexModel& model, const SmoothOptions& options,
                          const FilterRegion& region) {
  check_length(options.scale, "the scale of smoothing", 0, 1);
  if (options.iterations < 1 || options.iterations > 1000)
    throw InputError(fmt::format("{} iterations of smoothing; give 1 to 1000", options.iterations));
  FilterJob job(context, model, region);
  const double scale = options.scale / std::sqrt(options.iterations);
  std::vector<Vec3> moves = diffusion_moves(job, job.surface.points, job.laplace, scale);
  for (int iteration = 1; iteration < options.iterations; ++iteration) {
    std::vector<Vec3> positions = job.surface.positions;
    for (std::size_t i = 0; i < positions.size(); ++i) positions[i] += moves[i];
    const DeviceField points = upload_points(context, positions, job.model.origin, job.unit());
    const std::vector<Vec3> more =
        diffusion_moves(job, points, make_surface_operator(context, job.surface.neighbours, points), scale);
    for (std::size_t i = 0; i < moves.size(); ++i) moves[i] += more[i];
  }
  if (options.keeps_volume) restore_volume(job, moves);
  return finish(job, moves);
}

FilterResult enhance_model(ClContext& context, const SkeletexModel& model, const EnhanceOptions& options,
                           const FilterRegion& region) {
  check_length(options.scale, "the scale of detail", 0, 1);
  if (!(options.gain >= -1 && options.gain <= 100))
    throw InputError(fmt::format("a gain of {}; give -1 (no detail) to 100", options.gain));
  FilterJob job(context, model, region);
  std::vector<Vec3> moves = diffusion_moves(job, job.surface.points, job.laplace, options.scale);
  for (Vec3& move : moves) move *= -options.gain;
  return finish(job, moves);
}

FilterResult add_noise(ClContext& context, const SkeletexModel& model, const NoiseOptions& options,
                       const FilterRegion& region) {
  check_length(options.amplitude, "the noise's amplitude", 0, 1);
  check_length(options.wavelength, "the noise's wavelength", 1e-5, 100);
  if (options.octaves < 1 || options.octaves > 16)
    throw InputError(fmt::format("{} octaves of noise; give 1 to 16", options.octaves));
  FilterJob job(context, model, region);
  std::vector<Vec3> moves = area_vectors_at(job.context, job.model, job.surface, job.surface.positions);
  const auto heights = context.allocate<float>(moves.size());
  context.launch({"filter.cl", "noise_at_points"}, ClRange(moves.size()),
                 NoiseParameters{static_cast<int>(moves.size()), options.octaves, options.seed,
                                 static_cast<float>(1 / options.wavelength)},
                 job.surface.points.values, heights);
  const std::vector<float> noise = context.download(heights);
  for (std::size_t i = 0; i < moves.size(); ++i)
    moves[i] = options.amplitude * job.unit() * static_cast<double>(noise[i]) * moves[i].normalized();
  return finish(job, moves);
}

namespace {

/// The attributes that a layer makes, alone.
MeshAttributes attributes_of_layer(const SkeletexModel& model, const Layer& layer) {
  MeshAttributes all = vertex_attributes(model), one;
  if (layer.kind == LayerKind::kNormal) one.normals = std::move(all.normals);
  if (layer.kind == LayerKind::kColour) one.colours = std::move(all.colours);
  for (VertexNumbers& numbers : all.numbers)
    if (layer.kind == LayerKind::kNumber && numbers.name == layer.name) one.numbers.push_back(std::move(numbers));
  return one;
}

/// Calls act(vertex, component, value) with the values of a layer, which it may change.
template <class Act>
void for_each_value(MeshAttributes& attributes, const Act& act) {
  for (std::size_t i = 0; i < attributes.normals.values.size(); ++i)
    for (int k = 0; k < 3; ++k) act(i, static_cast<std::size_t>(k), attributes.normals.values[i][k]);
  for (std::size_t i = 0; i < attributes.colours.values.size(); ++i)
    for (int k = 0; k < 4; ++k) act(i, static_cast<std::size_t>(k), attributes.colours.values[i][k]);
  for (VertexNumbers& numbers : attributes.numbers)
    for (std::size_t i = 0; i < numbers.values.size(); ++i) act(i, std::size_t{0}, numbers.values[i]);
}

}  // namespace

SkeletexModel filter_layer(ClContext& context, const SkeletexModel& model, const LayerFilterOptions& options,
                           const FilterRegion& region) {
  check_length(options.scale, "the scale of detail", 0, 1);
  if (!(options.gain >= -1 && options.gain <= 100))
    throw InputError(fmt::format("a gain of {}; give -1 (no detail) to 100", options.gain));
  const Layer* const layer = find_layer(model, options.layer);
  if (layer == nullptr) throw InputError(fmt::format("the model has no layer \"{}\" to filter", options.layer));
  SkeletexModel still = model;
  still.sampling.is_snapped = false;  // the texels stay at their places
  FilterJob job(context, still, region);
  MeshAttributes attributes = attributes_of_layer(model, *layer);
  const std::vector<Layer> before = layers_of_vertices(model, attributes);

  const std::size_t count = job.weights.size();
  const int components = layer->kind == LayerKind::kNormal ? 3 : layer->kind == LayerKind::kColour ? 4 : 1;
  std::vector<float> values(static_cast<std::size_t>(components) * count);
  for_each_value(attributes,
                 [&](std::size_t i, std::size_t k, auto& value) { values[k * count + i] = static_cast<float>(value); });
  const auto time = static_cast<float>(options.scale * options.scale);
  const auto everywhere = context.upload(std::vector<float>(count, 1.f));
  std::vector<float> moves;
  const auto solve = [&](int first, int solved) {
    const auto begin = values.begin() + static_cast<std::ptrdiff_t>(first * count);
    const std::vector<float> part(begin, begin + static_cast<std::ptrdiff_t>(solved * count));
    const DeviceField b = apply_operator(context, job.laplace, 0, -time, everywhere, {solved, context.upload(part)});
    const std::vector<float> found =
        context.download(solve_diffusion(context, job.laplace, time, everywhere, b).x.values);
    moves.insert(moves.end(), found.begin(), found.end());
  };
  solve(0, std::min(components, 3));
  if (components > 3) solve(3, components - 3);  // opacity
  for_each_value(attributes, [&](std::size_t i, std::size_t k, auto& value) {
    using Value = std::decay_t<decltype(value)>;
    value -= static_cast<Value>(options.gain * static_cast<double>(job.weights[i]) *
                                static_cast<double>(moves[k * count + i]));
  });
  for (Vec3& normal : attributes.normals.values) normal.normalize();

  const std::vector<Layer> after = layers_of_vertices(model, attributes);
  SkeletexModel result = model;
  Layer& filtered = result.layers[static_cast<std::size_t>(layer - model.layers.data())];
  for (std::size_t k = 0; k < std::min(filtered.planes.size(), after[0].planes.size()); ++k)
    for (std::size_t i = 0; i < filtered.planes[k].size(); ++i)
      if (before[0].planes[k][i] != after[0].planes[k][i]) filtered.planes[k][i] = after[0].planes[k][i];
  return result;
}

}  // namespace skeletex
