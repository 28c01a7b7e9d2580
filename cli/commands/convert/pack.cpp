// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <optional>

#include "command.h"
#include "compact_output.h"
#include "files.h"
#include "progress_bar.h"
#include "result_file.h"
#include "skeletex/convert/resample/resample.h"
#include "skeletex/io/compact/compact_model_file.h"
#include "skeletex/io/model_file.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex::cli {
namespace {

struct PackArguments {
  std::string model, output, device, json;
  int size = 512;
  CompactArguments compact;
};

void pack(const PackArguments& arguments, const CLI::App& command) {
  Stopwatch watch;
  const SkeletexModel model = read_model(arguments.model);
  ClContext context(arguments.device);
  std::optional<ProgressBar> bar(std::in_place, context);
  bar->show("compressing", 0.2);
  Json json;
  json["output"] = write_compact(context, model, nullptr, arguments.compact, command, arguments.size, arguments.output);
  bar.reset();
  json["times_ms"]["total"] = watch.lap_ms();
  json["device"] = context.device().name;
  print(arguments.json, compact_text(json["output"]));
  write_json(arguments.json, json);
}

struct UnpackArguments {
  std::string model, output, device, json;
  int size = 0;
  long bytes = 0;
};

void unpack(const UnpackArguments& arguments, const CLI::App& command) {
  if (!is_compact_file(arguments.model))
    throw InputError(fmt::format("{}: no compact model (.skx); `skeletex pack` makes one", arguments.model));
  CompactFileOptions options;
  if (command.count("--size") > 0) options.size = arguments.size;
  if (command.count("--bytes") > 0) options.bytes = static_cast<std::size_t>(arguments.bytes);
  Stopwatch watch;
  SkeletexModel model = read_compact_model(arguments.model, options);
  Json json;
  json["times_ms"]["decode"] = watch.lap_ms();
  ClContext context(arguments.device);
  std::optional<ProgressBar> bar(std::in_place, context);
  bar->show("reconstructing", 0.5);
  if (options.size && std::max(model.texture.width, model.texture.height) != *options.size)
    model = resample_model(context, model, *options.size);
  json["output"] = write_result(context, model, arguments.output);
  bar.reset();
  json["device"] = context.device().name;
  print(arguments.json,
        fmt::format("{}: {} x {} texels\n", arguments.output, model.texture.width, model.texture.height));
  write_json(arguments.json, json);
}

}  // namespace

void add_pack_command(CLI::App& program) {
  auto arguments = std::make_shared<PackArguments>();
  CLI::App& command =
      *program.add_subcommand("pack", "Make a compact file of a model: some thousand bytes for shape and skeleton");
  command.option_defaults()->always_capture_default();
  declare_input(command, command.add_option("MODEL", arguments->model, "model: .skx.exr, or .skx"))->required();
  declare_output(command, command.add_option("-o,--output", arguments->output, "the compact file: .skx"), {".skx"})
      ->required()
      ->type_name("FILE");
  command
      .add_option("--size", arguments->size,
                  "about the side of the texture that the file decodes to, 32 to 4096 (default: 512, or more where "
                  "--max-error asks for it)")
      ->check(number_in(32, 4096))
      ->type_name("N")
      ->default_str("");
  add_compact_options(command, arguments->compact);
  add_device_option(command, arguments->device);
  add_json_option(command, arguments->json);
  command.footer(
      "Examples:\n"
      "  skeletex pack bear.skx.exr -o bear.skx\n"
      "  skeletex pack bear.skx.exr -o bear.skx --max-error 5e-5\n"
      "  skeletex pack bear.skx.exr -o bear.skx --max-bytes 4000\n"
      "Every command that reads a model reads the file. Errors are measured against the model; `skeletex encode MESH "
      "SKELETON -o FILE.skx` measures them against the mesh.");
  command.callback([arguments, &command] { pack(*arguments, command); });
}

void add_unpack_command(CLI::App& program) {
  auto arguments = std::make_shared<UnpackArguments>();
  CLI::App& command = *program.add_subcommand("unpack", "Make a model of a compact file, of any size");
  declare_input(command, command.add_option("MODEL", arguments->model, "compact model: .skx"))->required();
  add_result_option(command, arguments->output);
  command.add_option("--size", arguments->size, "texels along the longer side, 16 to 8192; else what the file says")
      ->check(number_in(16, 8192))
      ->type_name("N");
  command
      .add_option("--bytes", arguments->bytes,
                  "read no more than the first N bytes, which make a coarser model; also of a file that was cut")
      ->check(number_in(1, 1e9))
      ->type_name("N");
  add_device_option(command, arguments->device);
  add_json_option(command, arguments->json);
  command.footer(
      "Examples:\n"
      "  skeletex unpack bear.skx -o bear.skx.exr\n"
      "  skeletex unpack bear.skx -o bear.skx.exr --size 1024\n"
      "  skeletex unpack bear.skx -o coarse.ply --bytes 2000");
  command.callback([arguments, &command] { unpack(*arguments, command); });
}

}  // namespace skeletex::cli
