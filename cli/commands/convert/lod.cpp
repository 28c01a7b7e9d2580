// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <optional>

#include "command.h"
#include "files.h"
#include "progress_bar.h"
#include "result_file.h"
#include "skeletex/convert/resample/levels.h"
#include "skeletex/convert/resample/resample.h"
#include "skeletex/convert/sample/half_texels.h"
#include "skeletex/io/model_file.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex::cli {
namespace {

struct Arguments {
  std::string model, output, device, json;
  int size = 0, smallest = 32;
  bool has_levels = false, is_half = false;
};

void run(const Arguments& arguments) {
  if (arguments.has_levels && !has_ending(arguments.output, ".exr"))
    throw CLI::ValidationError(
        "--output",
        fmt::format("\"{}\" must end in .skx.exr: levels are one model with several parts", arguments.output));
  if (arguments.is_half && !has_ending(arguments.output, ".exr"))
    throw CLI::ValidationError(
        "--output", fmt::format("\"{}\" must end in .skx.exr: half floats are those of a model", arguments.output));
  const SkeletexModel model = read_model(arguments.model);
  ClContext context(arguments.device);
  std::optional<ProgressBar> bar(std::in_place, context);
  bar->show("resampling", 0.2);
  Stopwatch watch;
  Json json;
  std::string text;
  const auto round = [&](SkeletexModel& level) {
    RoundedModel rounded = round_to_half(context, level);
    json["rounding"].push_back(
        {{"nearest", rounded.report.nearest / model.diagonal}, {"chosen", rounded.report.chosen / model.diagonal}});
    level = std::move(rounded.model);
  };
  const ModelFileOptions file{.format = arguments.is_half ? TexelFormat::kHalf : TexelFormat::kFloat};
  if (arguments.has_levels) {
    std::vector<SkeletexModel> levels = make_levels(context, model, arguments.smallest);
    json["times_ms"]["resample"] = watch.lap_ms();
    if (arguments.is_half)
      for (SkeletexModel& level : levels) round(level);
    write_model_levels(arguments.output, levels, file);
    json["output"] = {{"path", arguments.output}, {"kind", "model"}};
    for (const SkeletexModel& level : levels) {
      json["levels"].push_back({level.texture.width, level.texture.height});
      text += fmt::format("level {}: {} x {}\n", json["levels"].size() - 1, level.texture.width, level.texture.height);
    }
  } else {
    SkeletexModel small = resample_model(context, model, arguments.size);
    json["times_ms"]["resample"] = watch.lap_ms();
    if (arguments.is_half) round(small);
    json["output"] = write_result(context, small, arguments.output, file);
    text = fmt::format("{} x {} texels from {} x {}\n", small.texture.width, small.texture.height, model.texture.width,
                       model.texture.height);
  }
  bar.reset();
  json["times_ms"]["write"] = watch.lap_ms();
  json["device"] = context.device().name;
  json["kernels"] = profile_json(context);
  print(arguments.json, text + arguments.output + "\n");
  write_json(arguments.json, json);
}

}  // namespace

void add_lod_command(CLI::App& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command =
      *program.add_subcommand("lod", "Make a smaller model of a model, or a file of all its levels of detail");
  declare_input(command, command.add_option("MODEL", arguments->model, "model: .skx.exr or .skx"))->required();
  add_result_option(command, arguments->output);
  CLI::Option* size = command.add_option("--size", arguments->size, "texels along the longer side, 4 to 16384")
                          ->check(number_in(4, 16384))
                          ->type_name("N");
  CLI::Option* levels = command.add_flag("--levels", arguments->has_levels,
                                         "all levels, each half the size of the one before, in one model file");
  size->excludes(levels);
  command.add_option("--smallest", arguments->smallest, "with --levels: longer side of the smallest level")
      ->check(number_in(4, 16384))
      ->capture_default_str()
      ->type_name("N")
      ->needs(levels);
  command.add_flag(
      "--half", arguments->is_half,
      "16 bits a channel, rounded so that points stay near the surface; at the model's own size all else stays");
  add_device_option(command, arguments->device);
  add_json_option(command, arguments->json);
  command.footer(
      "Examples:\n"
      "  skeletex lod bear.skx.exr --size 128 -o small.skx.exr\n"
      "  skeletex lod bear.skx.exr --levels -o levels.skx.exr\n"
      "  skeletex lod bear.skx.exr --size 512 --half -o half.skx.exr\n"
      "  skeletex reconstruct levels.skx.exr --level 3 -o coarse.ply\n"
      "Seams are kept at every level, so every level reconstructs to a closed mesh. A file of levels is a multi-part "
      "OpenEXR image;\n"
      "commands that take a model read its finest level.");
  command.callback([arguments] {
    if (arguments->size == 0 && !arguments->has_levels) throw CLI::RequiredError("--size or --levels");
    run(*arguments);
  });
}

}  // namespace skeletex::cli
