// SPDX-License-Identifier: MIT
#include "skeletex/edit/morph/morph.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>

#include "bone_pairs.h"
#include "command.h"
#include "files.h"
#include "landmark_file.h"
#include "output_names.h"
#include "progress_bar.h"
#include "result_file.h"
#include "skeletex/edit/morph/surface_map.h"
#include "skeletex/io/model_file.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "table.h"

namespace skeletex::cli {
namespace {

struct Arguments {
  std::vector<std::string> models, bones;
  std::vector<double> times, weights;
  std::string output, device, json, landmarks;
  int frames = 0, layout = 0, size = 0;
  bool has_creases = false, has_regular_grid = false;
};

Json distortion_json(const Distortion& d) {
  return {{"area", d.area},
          {"angle", d.angle},
          {"symmetric_dirichlet", d.dirichlet},
          {"area_median", d.area_median},
          {"angle_median", d.angle_median},
          {"symmetric_dirichlet_median", d.dirichlet_median},
          {"collapsed", d.collapsed}};
}

void check_arguments(const Arguments& arguments) {
  if (arguments.models.size() < 2) throw CLI::ValidationError("a morph needs two models or more");
  if (!arguments.times.empty() + !arguments.weights.empty() + (arguments.frames > 0) != 1)
    throw CLI::ValidationError("give one of --t, --weights and --frames");
  if (arguments.weights.empty() && arguments.models.size() != 2)
    throw CLI::ValidationError(fmt::format("--t and --frames lead from one model to another; {} models take --weights",
                                           arguments.models.size()));
  if (!arguments.weights.empty() && arguments.weights.size() != arguments.models.size())
    throw CLI::ValidationError(
        fmt::format("{} weights for {} models; give one per model", arguments.weights.size(), arguments.models.size()));
  if (!arguments.bones.empty() && arguments.models.size() != 2)
    throw CLI::ValidationError("--bones", "pairs the bones of two models");
  if (!arguments.landmarks.empty() && arguments.models.size() != 2)
    throw CLI::ValidationError("--landmarks", "pairs the points of two models");
  if (arguments.layout > static_cast<int>(arguments.models.size()))
    throw CLI::ValidationError(
        fmt::format("--layout {}: there are {} models", arguments.layout, arguments.models.size()));
}

/// Weights of the models, one list for each result.
std::vector<std::vector<double>> weights_of(const Arguments& arguments) {
  std::vector<std::vector<double>> all_weights;
  if (!arguments.weights.empty()) all_weights.push_back(arguments.weights);
  for (const double t : arguments.times) all_weights.push_back({1 - t, t});
  for (int i = 0; i < arguments.frames; ++i) {
    const double t = static_cast<double>(i) / (arguments.frames - 1);
    all_weights.push_back({1 - t, t});
  }
  return all_weights;
}

/// A file for each result.
std::vector<std::string> outputs_of(const Arguments& arguments, const CLI::App& command, std::size_t count) {
  std::vector<std::string> outputs;
  for (std::size_t i = 0; i < count; ++i)
    outputs.push_back(count == 1 && arguments.frames == 0 ? arguments.output : numbered(arguments.output, i));
  for (const std::string& output : outputs) {
    if (output != arguments.output) check_made_output(command, output);
    check_output(output);
  }
  return outputs;
}

/// Distortion of the map from the first model to each other one.
/// \param text  a table of them
Json measure_maps(ClContext& context, const Arguments& arguments, const Morph& morph,
                  const std::vector<Correspondence>& from_first, std::string& text) {
  Json maps = Json::array();
  Table table({"distortion from " + arguments.models[0] + " to", "area", "angle", "symmetric Dirichlet", "collapsed"});
  const TriangleMesh first = reconstruct_mesh(context, morph.models()[0]);
  for (std::size_t m = 1; m < morph.models().size(); ++m) {
    const Distortion d =
        measure_distortion(first, map_surface(context, morph.models()[0], morph.models()[m], from_first[m - 1]));
    table.add({arguments.models[m], fmt::format("{:.3f}", d.area), fmt::format("{:.3f}", d.angle),
               fmt::format("{:.3f}", d.dirichlet), fmt::format("{:.2f} %", 100 * d.collapsed)});
    maps.push_back({{"from", arguments.models[0]},
                    {"to", arguments.models[m]},
                    {"cost", from_first[m - 1].cost},
                    {"distortion", distortion_json(d)}});
  }
  text += table.text() + '\n';
  return maps;
}

/// Makes the landmarks of two models meet.
/// \param text  a table of them
Json meet_landmarks(ClContext& context, const std::string& path, std::vector<SkeletexModel>& models,
                    const Correspondence& first_to_second, std::string& text) {
  const std::vector<Landmark> landmarks = read_landmarks(path);
  const auto distances = [&] { return landmark_distances(context, models[0], models[1], first_to_second, landmarks); };
  const std::vector<double> before = distances();
  try {
    models[1] = align_landmarks(context, models[0], std::move(models[1]), first_to_second, landmarks);
  } catch (const InputError& error) {
    throw InputError(fmt::format("{}: {}", path, error.what()));
  }
  const std::vector<double> after = distances();
  Json json = Json::array();
  Table table({"landmark, distance / diagonal", "without", "with"});
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    table.add({landmarks[i].name, fmt::format("{:.1e}", before[i]), fmt::format("{:.1e}", after[i])});
    json.push_back({{"name", landmarks[i].name}, {"distance_without", before[i]}, {"distance", after[i]}});
  }
  text += table.text() + '\n';
  return json;
}

void run(const Arguments& arguments, const CLI::App& command) {
  check_arguments(arguments);
  const BonePairs given = parse_bone_pairs(arguments.bones);
  const std::vector<std::vector<double>> all_weights = weights_of(arguments);
  const std::vector<std::string> outputs = outputs_of(arguments, command, all_weights.size());

  Stopwatch total;
  std::vector<SkeletexModel> models;
  std::vector<Correspondence> from_first;
  for (const std::string& path : arguments.models) {
    models.push_back(read_model(path));
    if (models.size() > 1)
      from_first.push_back(correspond(arguments.models[0], models[0].skeleton, path, models.back().skeleton, given));
  }
  ClContext context(arguments.device);
  MorphOptions options;
  if (arguments.layout > 0) options.layout = arguments.layout - 1;
  options.size = arguments.size;
  options.is_smooth = !arguments.has_creases;
  options.has_own_texels = !arguments.has_regular_grid;
  Json json{{"maps", Json::array()}, {"results", Json::array()}};
  std::string text;
  if (!arguments.landmarks.empty())
    json["landmarks"] = meet_landmarks(context, arguments.landmarks, models, from_first[0], text);
  const Morph morph(context, std::move(models), from_first, options);

  {
    ProgressBar bar(context);
    bar.show("measuring", 0.05);
    json["maps"] = measure_maps(context, arguments, morph, from_first, text);
    for (std::size_t i = 0; i < all_weights.size(); ++i) {
      bar.show("morphing", 0.1 + 0.9 * static_cast<double>(i) / static_cast<double>(all_weights.size()));
      Json written = write_result(context, morph.at(all_weights[i]), outputs[i]);
      written["weights"] = all_weights[i];
      text += fmt::format("{}\n", outputs[i]);
      json["results"].push_back(std::move(written));
    }
  }
  json["seconds"] = total.lap_ms() / 1000;
  json["device"] = context.device().name;
  json["kernels"] = profile_json(context);
  print(arguments.json, text);
  write_json(arguments.json, json);
}

}  // namespace

void add_morph_command(CLI::App& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand("morph", "In-between models of two models or more");
  declare_input(command,
                command.add_option("MODEL", arguments->models,
                                   "models (.skx.exr, .skx) whose skeletons correspond: two, or more with --weights"))
      ->required();
  add_result_option(command, arguments->output);
  CLI::Option* times =
      command.add_option("--t", arguments->times, "0: the first model, 1: the second; several make numbered files")
          ->delimiter(',')
          ->check(number_in(0.0, 1.0))
          ->type_name("T,..");
  CLI::Option* weights = command.add_option("--weights", arguments->weights, "one per model, none negative, of sum 1")
                             ->delimiter(',')
                             ->check(number_in(0, 1))
                             ->type_name("W,W,..");
  command.add_option("--frames", arguments->frames, "a sequence of numbered files from t = 0 to t = 1: out_000.ply ..")
      ->check(number_in(2, 1000))
      ->excludes(times)
      ->excludes(weights)
      ->type_name("N");
  times->excludes(weights);
  command.add_option("--bones", arguments->bones, "pairs of bones that must correspond; the rest is found")
      ->delimiter(',')
      ->type_name("A=B,..");
  declare_input(command, command.add_option("--landmarks", arguments->landmarks,
                                            "points on both surfaces that are to meet, as JSON: see docs/morph.md"))
      ->type_name("FILE");
  command
      .add_option("--layout", arguments->layout,
                  "take rectangles, names and order of bones from the K-th model (default: that of the largest weight)")
      ->check(number_in(1, 1000))
      ->type_name("K");
  command.add_option("--size", arguments->size, "texels along the longer side (default: the largest model's)")
      ->check(number_in(4, 16384))
      ->type_name("N");
  command.add_flag(
      "--creases", arguments->has_creases,
      "skip the step that removes creases between bones that turn by different angles; live morphs skip it too");
  command.add_flag("--regular-grid", arguments->has_regular_grid,
                   "keep snapped models on regular grids at t = 0 and t = 1 as well; by default the ends have the "
                   "models' own texels");
  add_device_option(command, arguments->device);
  add_json_option(command, arguments->json);
  command.footer(
      "Examples:\n"
      "  skeletex morph man.skx.exr homer.skx.exr --t 0.25 -o quarter.ply\n"
      "  skeletex morph bull.skx.exr camel.skx.exr --frames 30 -o frames/out.ply\n"
      "  skeletex morph a.skx.exr b.skx.exr c.skx.exr --weights 0.5,0.3,0.2 -o mean.skx.exr\n"
      "Also tells how the map between the models distorts area and angles, and its symmetric Dirichlet energy; 1 each "
      "for an isometry.");
  command.callback([arguments, &command] { run(*arguments, command); });
}

}  // namespace skeletex::cli
