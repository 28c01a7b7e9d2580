// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <memory>

#include "command.h"
#include "files.h"
#include "progress_bar.h"
#include "skeletex/io/model_file.h"
#include "skeletex/io/model_json.h"
#include "skeletex/reconstruct/pose/skin.h"

namespace skeletex::cli {
namespace {

struct Arguments {
  std::string model, output, device, json;
  bool is_removed = false, is_edited = false;
};

void run(const Arguments& arguments) {
  Stopwatch watch;
  SkeletexModel model =
      read_model(arguments.model, 0, arguments.is_edited ? ChecksumRule::kIgnore : ChecksumRule::kVerify);
  if (arguments.is_removed) {
    model.bone_weights.clear();
  } else if (!arguments.is_edited) {
    ClContext context(arguments.device);
    ProgressBar bar(context);
    bar.show("weights", 0.2);
    model.bone_weights = weight_planes(context, model);
  }
  write_model(arguments.output, model);
  Json channels = Json::array();
  if (!model.bone_weights.empty())
    for (const std::string& name : weight_channels(model.skeleton)) channels.push_back(name);
  const double ms = watch.lap_ms();
  print(arguments.json,
        arguments.is_removed ? fmt::format("weights removed: {}\n", arguments.output)
        : arguments.is_edited
            ? fmt::format("taken over, {} layers of weights: {}\n", channels.size(), arguments.output)
            : fmt::format("{} layers, {} to {}: {}\n", channels.size(), channels.front().get<std::string>(),
                          channels.back().get<std::string>(), arguments.output));
  write_json(arguments.json,
             {{"output", arguments.output}, {"channels", std::move(channels)}, {"times_ms", {{"total", ms}}}});
}

}  // namespace

void add_weights_command(CLI::App& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand(
      "weights", "Store how much each bone moves each texel in a smooth pose, as layers to paint on");
  declare_input(command, command.add_option("MODEL", arguments->model, "model: .skx.exr or .skx"))->required();
  declare_output(command,
                 command.add_option("-o,--output", arguments->output,
                                    "the model with a layer \"weights.BONE\" per bone: .skx.exr"),
                 {".exr"})
      ->required()
      ->type_name("FILE");
  CLI::Option* remove =
      command.add_flag("--remove", arguments->is_removed, "take such layers away: weights in closed form again");
  command
      .add_flag("--edited", arguments->is_edited,
                "compute nothing: take the model over as another program has changed it, with a new checksum")
      ->excludes(remove);
  add_device_option(command, arguments->device);
  add_json_option(command, arguments->json);
  command.footer(
      "Examples:\n"
      "  skeletex weights bear.skx.exr -o painted.skx.exr\n"
      "  skeletex weights painted.skx.exr --edited -o checked.skx.exr      # painted on in another program\n"
      "  skeletex reconstruct checked.skx.exr -o bear.ply --pose wave.json\n"
      "Weights are at least 0; where they do not sum to 1 they are scaled. Seams take those of the rows next to them.");
  command.callback([arguments] { run(*arguments); });
}

}  // namespace skeletex::cli
