// SPDX-License-Identifier: MIT
#include "skeletex/edit/filter/filter.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <set>

#include "command.h"
#include "files.h"
#include "progress_bar.h"
#include "result_file.h"
#include "skeletex/edit/filter/differential.h"
#include "skeletex/edit/regular_grid.h"
#include "skeletex/io/mesh_file.h"
#include "skeletex/io/model_file.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/layers/layer_values.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/render/colours.h"

namespace skeletex::cli {
namespace {

struct Arguments {
  std::string model, filter, output, device, json, layer;
  FilterRegion region;
  SmoothOptions smooth;
  EnhanceOptions enhance;
  NoiseOptions noise;
  double scale = 0;  ///< 0: the filter's own
};

/// Options that only some filters take.
const std::map<std::string, std::set<std::string>> kFiltersOfOption{{"--bones", {"smooth", "enhance", "noise"}},
                                                                    {"--falloff", {"smooth", "enhance", "noise"}},
                                                                    {"--scale", {"smooth", "enhance", "curvature"}},
                                                                    {"--layer", {"smooth", "enhance"}},
                                                                    {"--iterations", {"smooth"}},
                                                                    {"--keep-volume", {"smooth"}},
                                                                    {"--gain", {"enhance"}},
                                                                    {"--amplitude", {"noise"}},
                                                                    {"--wavelength", {"noise"}},
                                                                    {"--octaves", {"noise"}},
                                                                    {"--seed", {"noise"}}};

void check_options(const CLI::App& command, const Arguments& arguments) {
  for (const auto& [option, filters] : kFiltersOfOption)
    if (command.get_option(option)->count() > 0 && !filters.count(arguments.filter))
      throw CLI::ValidationError(
          fmt::format("{} is for {}, not for {}", option, fmt::join(filters, ", "), arguments.filter));
  if (arguments.layer.empty()) return;
  for (const char* option : {"--iterations", "--keep-volume"})
    if (command.get_option(option)->count() > 0)
      throw CLI::ValidationError(fmt::format("{} is for the surface, not for --layer", option));
}

Json solver_json(const SolveReport& solver) { return {{"steps", solver.steps}, {"residual", solver.residual}}; }

/// What 95 of 100 values lie within, either side of 0.
double usual_size(const std::vector<float>& values) {
  std::vector<float> sizes(values.size());
  std::transform(values.begin(), values.end(), sizes.begin(), [](float value) { return std::abs(value); });
  const auto at = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() * 95 / 100);
  std::nth_element(sizes.begin(), at, sizes.end());
  return static_cast<double>(*at);
}

/// Writes the mesh with normals, the mean curvature as a property, and colours.
void run_curvature(const Arguments& arguments) {
  if (!has_ending(arguments.output, ".ply"))
    throw CLI::ValidationError(
        "--output", fmt::format("\"{}\" must end in .ply: curvature is a mesh with values", arguments.output));
  const SkeletexModel stored = read_model(arguments.model);
  ClContext context(arguments.device);
  std::optional<ProgressBar> bar(std::in_place, context);
  bar->show("filtering", 0.2);
  Stopwatch watch;
  const SkeletexModel model = regular_grid(context, stored);  // as for filters: slivers slow the solver down
  const ModelSurface surface = upload_surface(context, model);
  const CurvatureResult result = mean_curvature(context, model, surface, arguments.scale);
  const std::vector<Vec3> normals = vertex_normals(context, surface);
  const double ms = watch.lap_ms();
  const double colour_scale = usual_size(result.mean_curvature);
  std::vector<VertexColour> colours;
  for (const float value : result.mean_curvature)
    colours.push_back(viridis(colour_scale > 0 ? 0.5 + 0.5 * value / colour_scale : 0.5));
  WrittenAttributes attributes;
  attributes.vertex_normals = normals;
  attributes.vertex_colours = colours;
  attributes.vertex_numbers = {{"mean_curvature", result.mean_curvature}};
  write_mesh(arguments.output, reconstruct_mesh(context, model), attributes);
  bar.reset();
  print(arguments.json, fmt::format("mean curvature at {} vertices, averaged over {:.3g} diagonals; colours from "
                                    "{:.4g} to {:.4g}\n{:.0f} ms on {}\n{}\n",
                                    normals.size(), result.scale, -colour_scale, colour_scale, ms,
                                    context.device().name, arguments.output));
  write_json(arguments.json, {{"filter", arguments.filter},
                              {"output", {{"path", arguments.output}, {"kind", "mesh"}, {"vertices", normals.size()}}},
                              {"scale", result.scale},
                              {"ply_scale", colour_scale},
                              {"solver", solver_json(result.solver)},
                              {"times_ms", {{"filter", ms}}},
                              {"device", context.device().name},
                              {"kernels", profile_json(context)}});
}

FilterResult apply_filter(ClContext& context, const SkeletexModel& model, Arguments arguments) {
  if (arguments.filter == "noise") return add_noise(context, model, arguments.noise, arguments.region);
  if (arguments.filter == "enhance") {
    if (arguments.scale > 0) arguments.enhance.scale = arguments.scale;
    return enhance_model(context, model, arguments.enhance, arguments.region);
  }
  if (arguments.scale > 0) arguments.smooth.scale = arguments.scale;
  return smooth_model(context, model, arguments.smooth, arguments.region);
}

/// Filters a layer alone.
void run_layer(const Arguments& arguments) {
  const SkeletexModel model = read_model(arguments.model);
  if (find_layer(model, arguments.layer) == nullptr) {
    std::vector<std::string> names;
    for (const Layer& layer : model.layers) names.push_back(layer.name);
    throw InputError(fmt::format("--layer: {} has no layer \"{}\"; it has {}", arguments.model, arguments.layer,
                                 names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "))));
  }
  ClContext context(arguments.device);
  std::optional<ProgressBar> bar(std::in_place, context);
  bar->show("filtering", 0.2);
  Stopwatch watch;
  LayerFilterOptions options{.layer = arguments.layer};
  if (arguments.scale > 0) options.scale = arguments.scale;
  if (arguments.filter == "enhance") options.gain = arguments.enhance.gain;
  const SkeletexModel result = filter_layer(context, model, options, arguments.region);
  const double filter_ms = watch.lap_ms();
  const Json output = write_result(context, result, arguments.output);
  bar.reset();
  print(arguments.json, fmt::format("{} of layer \"{}\": {:.0f} ms on {}\n{}\n", arguments.filter, arguments.layer,
                                    filter_ms, context.device().name, arguments.output));
  write_json(arguments.json, {{"filter", arguments.filter},
                              {"layer", arguments.layer},
                              {"output", output},
                              {"times_ms", {{"filter", filter_ms}}},
                              {"device", context.device().name},
                              {"kernels", profile_json(context)}});
}

void run(const Arguments& arguments) {
  if (!arguments.layer.empty()) {
    run_layer(arguments);
    return;
  }
  if (arguments.filter == "curvature") {
    run_curvature(arguments);
    return;
  }
  const SkeletexModel model = read_model(arguments.model);
  ClContext context(arguments.device);
  std::optional<ProgressBar> bar(std::in_place, context);
  bar->show("filtering", 0.2);
  Stopwatch watch;
  const FilterResult result = apply_filter(context, model, arguments);
  const double filter_ms = watch.lap_ms();
  const Json output = write_result(context, result.model, arguments.output);
  bar.reset();
  const double write_ms = watch.lap_ms();
  const FilterReport& report = result.report;
  print(arguments.json,
        fmt::format("{}: surface moved by {:.3g} diagonals in the mean, {:.3g} at most; volume {:+.3g} %\n"
                    "{} solver steps, filter {:.0f} ms, write {:.0f} ms, on {}\n{}\n",
                    arguments.filter, report.mean_move, report.largest_move,
                    100 * (report.volume_after / report.volume_before - 1), report.solver.steps, filter_ms, write_ms,
                    context.device().name, arguments.output));
  write_json(
      arguments.json,
      {{"filter", arguments.filter},
       {"output", output},
       {"moved", {{"mean", report.mean_move}, {"max", report.largest_move}, {"max_seam_slide", report.largest_slide}}},
       {"volume", {{"before", report.volume_before}, {"after", report.volume_after}}},
       {"solver", solver_json(report.solver)},
       {"times_ms", {{"filter", filter_ms}, {"write", write_ms}}},
       {"device", context.device().name},
       {"kernels", profile_json(context)}});
}

}  // namespace

void add_filter_command(CLI::App& program) {
  auto arguments = std::make_shared<Arguments>();
  Arguments& a = *arguments;
  CLI::App& command =
      *program.add_subcommand("filter", "Smooth a model, enhance its detail, add noise, or measure its curvature");
  declare_input(command, command.add_option("MODEL", a.model, "model: .skx.exr or .skx"))->required();
  take_one_of(*command.add_option("FILTER", a.filter, "what to do")->required(),
              {"smooth", "enhance", "noise", "curvature"});
  add_result_option(command, a.output);
  const auto add = [&command](const char* group, const char* name, auto& value,
                              const char* description) -> CLI::Option& {
    return *command.add_option(name, value, description)->group(group);
  };
  add("Region", "--bones", a.region.bones, "filter these bones only (names with commas between them)")
      .delimiter(',')
      ->type_name("NAMES");
  add("Region", "--falloff", a.region.falloff, "over what distance the effect fades out inside them, in diagonals")
      .check(number_in(0, 1))
      ->capture_default_str()
      ->type_name("D");
  add("Smooth, enhance, curvature", "--scale", a.scale,
      "size of detail, in diagonals (default: 0.01; curvature: three spacings of vertices)")
      .check(number_above(0))
      ->type_name("D");
  add("Smooth, enhance, curvature", "--layer", a.layer,
      "smooth, enhance: filter this layer (normal, colour, ..) and leave the surface")
      .type_name("NAME");
  add("Smooth, enhance, curvature", "--iterations", a.smooth.iterations, "smooth: steps to divide the way into")
      .check(number_in(1, 1000))
      ->capture_default_str()
      ->type_name("N");
  command.add_flag("--keep-volume", a.smooth.keeps_volume, "smooth: keep the volume that the surface encloses")
      ->group("Smooth, enhance, curvature");
  add("Smooth, enhance, curvature", "--gain", a.enhance.gain,
      "enhance: how many times the detail is added; negative takes away")
      .check(number_in(-1, 100))
      ->capture_default_str()
      ->type_name("K");
  add("Noise", "--amplitude", a.noise.amplitude, "height of the largest waves, in diagonals")
      .check(number_in(0, 1))
      ->capture_default_str()
      ->type_name("D");
  add("Noise", "--wavelength", a.noise.wavelength, "length of the largest waves, in diagonals")
      .check(number_above(0))
      ->capture_default_str()
      ->type_name("D");
  add("Noise", "--octaves", a.noise.octaves, "how many sizes of waves, each half the one before")
      .check(number_in(1, 16))
      ->capture_default_str()
      ->type_name("N");
  add("Noise", "--seed", a.noise.seed, "another number gives another noise")
      .check(number_in(0, 4294967295))
      ->capture_default_str()
      ->type_name("N");
  add_device_option(command, a.device);
  add_json_option(command, a.json);
  command.footer(
      "Examples:\n"
      "  skeletex filter bear.skx.exr smooth -o smooth.skx.exr --scale 0.02 --keep-volume\n"
      "  skeletex filter bear.skx.exr enhance -o sharp.ply --gain 2 --bones head,neck\n"
      "  skeletex filter bear.skx.exr noise -o bark.skx.exr --amplitude 0.005 --wavelength 0.1\n"
      "  skeletex filter bear.skx.exr curvature -o curvature.ply\n"
      "Filters work on the surface, not on the texture: they do not see seams, poles or the density of texels.");
  command.callback([arguments, &command] {
    check_options(command, *arguments);
    run(*arguments);
  });
}

}  // namespace skeletex::cli
