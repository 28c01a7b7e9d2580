// SPDX-License-Identifier: MIT
#include "compact_output.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "files.h"
#include "skeletex/io/atomic_file.h"

namespace skeletex::cli {
namespace {

constexpr std::array kOptions{"--max-error", "--max-bytes", "--quality"};
constexpr const char* kLayerSteps = "--layer-steps";

/// What of the model the file does not hold.
void warn_of_losses(const SkeletexModel& model, int layer_steps, const std::string& path) {
  std::vector<std::string> lost;
  bool has_normals = false;
  for (const Layer& layer : model.layers)
    if (layer.kind == LayerKind::kNormal)
      has_normals = true;
    else
      lost.push_back(fmt::format("layer \"{}\"", layer.name));
  if (!model.bone_weights.empty()) lost.emplace_back("painted weights");
  if (layer_steps == 0 && !lost.empty())
    warn(fmt::format("{}: {} 0 leaves out: {}", path, kLayerSteps, fmt::join(lost, ", ")));
  if (has_normals) warn(fmt::format("{}: normals are left out, and derived from the shape", path));
}

}  // namespace

void add_compact_options(CLI::App& command, CompactArguments& arguments) {
  std::vector<CLI::Option*> options;
  options.push_back(command
                        .add_option(kOptions[0], arguments.max_error,
                                    "of a .skx: the fewest bytes with a mean distance, both ways, of this share of the "
                                    "diagonal, 1e-6 to 0.01")
                        ->check(number_in(1e-6, 0.01))
                        ->type_name("X"));
  options.push_back(command
                        .add_option(kOptions[1], arguments.max_bytes,
                                    "of a .skx: the smallest error in a file of so many bytes, 500 to 100000000")
                        ->check(number_in(500, 100'000'000))
                        ->type_name("N")
                        ->default_str(""));
  options.push_back(command
                        .add_option(kOptions[2], arguments.quality,
                                    "of a .skx: quantization without a search, 0 to 100; offsets are in steps of "
                                    "10^-(2 + quality / 25) diagonals")
                        ->check(number_in(0.0, 100.0))
                        ->type_name("X")
                        ->default_str(""));
  command
      .add_option(kLayerSteps, arguments.layer_steps,
                  "of a .skx: steps between the least and the largest value of a layer (colours, numbers, painted "
                  "weights), 0 to 65536; 0 leaves them out")
      ->check(number_in(0, 65536))
      ->type_name("N")
      ->group("Compact file");
  for (CLI::Option* option : options) {
    option->group("Compact file");
    for (CLI::Option* other : options)
      if (other != option) option->excludes(other);
  }
}

bool has_compact_option(const CLI::App& command) {
  return command.count(kLayerSteps) > 0 ||
         std::any_of(kOptions.begin(), kOptions.end(), [&](const char* name) { return command.count(name) > 0; });
}

bool is_compact_path(const std::string& path) { return has_ending(path, ".skx"); }

Json write_compact(ClContext& context, const SkeletexModel& model, const TriangleMesh* reference,
                   const CompactArguments& arguments, const CLI::App& command, int size, const std::string& path) {
  CompactGoal goal;
  if (command.count("--size") > 0) goal.size = size;
  goal.layer_steps = arguments.layer_steps;
  if (command.count(kOptions[2]) > 0)
    goal.quality = arguments.quality;
  else if (command.count(kOptions[1]) > 0)
    goal.max_bytes = arguments.max_bytes;
  else
    goal.max_error = arguments.max_error;
  const CompactResult result = search_compact(context, model, reference, goal);
  write_text_atomically(path, result.bytes);
  warn_of_losses(model, arguments.layer_steps, path);
  return {{"path", path},
          {"kind", "compact model"},
          {"bytes", result.bytes.size()},
          {"layer_bytes", result.layer_bytes},
          {"mean", result.mean},
          {"max", result.max},
          {"size", result.options.size},
          {"step", result.options.step},
          {"bare_levels", result.options.bare_levels},
          {"trials", result.trials}};
}

std::string compact_text(const Json& json) {
  const auto layer_bytes = json["layer_bytes"].get<std::size_t>();
  return fmt::format("{}: {} bytes{}; distance / diagonal, both ways: mean {:.3g}, max {:.3g}\n",
                     json["path"].get<std::string>(), json["bytes"].get<std::size_t>(),
                     layer_bytes > 0 ? fmt::format(", {} of them for layers", layer_bytes) : "",
                     json["mean"].get<double>(), json["max"].get<double>());
}

}  // namespace skeletex::cli
