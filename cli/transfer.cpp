// SPDX-License-Identifier: MIT
#include "skeletex/edit/transfer.h"

#include <fmt/format.h>

#include <memory>

#include "bone_pairs.h"
#include "command.h"
#include "progress_bar.h"
#include "result_file.h"
#include "skeletex/edit/mirror.h"
#include "skeletex/io/model_file.h"

namespace skeletex::cli {
namespace {

struct Arguments {
  std::string source, target, output, device, json, blend = "cosine", width = "0.25";
  std::vector<std::string> bones;
  bool has_limbs = false, is_mirrored = false;
};

/// "0.2": share of the bone's rows; "12px": rows.
void parse_width(const std::string& text, TransferOptions& options) {
  const bool is_in_texels = text.ends_with("px");
  const std::string number = is_in_texels ? text.substr(0, text.size() - 2) : text;
  double value = -1;
  std::size_t used = 0;
  try {
    value = std::stod(number, &used);
  } catch (const std::exception&) {
  }
  if (used != number.size() || !(value >= 0) || (is_in_texels ? !(value >= 1 && value <= 16384) : value > 1))
    throw CLI::ValidationError("--width", fmt::format("\"{}\" is neither a share from 0 to 1 nor a number of texels such as 12px", text));
  (is_in_texels ? options.width_in_texels : options.width) = value;
}

void run(const Arguments& arguments) {
  const BonePairs pairs = parse_bone_pairs(arguments.bones);
  TransferOptions options;
  options.has_limbs = arguments.has_limbs;
  options.blend = arguments.blend == "cosine" ? TransferBlend::kCosine : arguments.blend == "linear" ? TransferBlend::kLinear : TransferBlend::kNone;
  parse_width(arguments.width, options);
  check_result(arguments.output);
  check_json_target(arguments.json);

  Stopwatch total;
  SkeletexModel source = read_model(arguments.source);
  const SkeletexModel target = read_model(arguments.target);
  for (const auto& [from, to] : pairs) {
    check_bone(arguments.source, source.skeleton, from);
    check_bone(arguments.target, target.skeleton, to);
  }
  if (arguments.is_mirrored) source = mirrored(source);
  ClContext context(arguments.device);
  Json json;
  std::vector<TransferredPart> parts;
  {
    ProgressBar bar;
    bar.show("transferring", 0.3);
    json = write_result(context, transfer(context, source, target, pairs, options, &parts), arguments.output);
  }
  Json bones = Json::array();
  for (std::size_t i = 0; i < pairs.size(); ++i)
    bones.push_back({{"source", pairs[i].first}, {"target", pairs[i].second}, {"scale", parts[i].scale}, {"length_scale", parts[i].length_scale},
                     {"skipped", parts[i].skipped}, {"kept", parts[i].kept}});
  json["bones"] = bones;
  json["seconds"] = total.lap_ms() / 1000;
  json["device"] = context.device().name;
  json["kernels"] = profile_json(context);
  print(arguments.json, fmt::format("{}\n", arguments.output));
  write_json(arguments.json, json);
  context.save_programs();
}

}  // namespace

void add_transfer_command(CLI::App& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand("transfer", "Replace the surface of bones by that of another model's, or of others of the same");
  command.add_option("SOURCE", arguments->source, "model (.skx.exr) to take from")->required();
  command.add_option("TARGET", arguments->target, "model to put it on; may be the same")->required();
  command.add_option("--bones", arguments->bones, "pairs of bones: SOURCE's=TARGET's")->required()->delimiter(',')->type_name("A=B,..");
  command.add_flag("--limb", arguments->has_limbs, "also all bones below them, which must branch alike");
  command.add_flag("--mirror", arguments->is_mirrored, "take from the source's mirror image: a left arm for a right one");
  take_one_of(*command.add_option("--blend", arguments->blend, "how the two fade near the seams (default: cosine)"), {"cosine", "linear", "none"});
  command.add_option("--width", arguments->width, "width of the fade: share of the bone's rows, or rows as 12px (default: 0.25)")->type_name("W|Npx");
  add_result_option(command, arguments->output);
  add_device_option(command, arguments->device);
  add_json_option(command, arguments->json);
  command.footer(
      "Examples:\n"
      "  skeletex transfer triceratops.skx.exr bunny00.skx.exr --bones left_horn=left_ear,right_horn=right_ear -o horned.ply\n"
      "  skeletex transfer man.skx.exr armadillo.skx.exr --bones left_upper_arm=left_upper_arm --limb -o armed.skx.exr\n"
      "  skeletex transfer bear.skx.exr bear.skx.exr --bones left_shoulder=right_shoulder --limb --mirror -o symmetric.ply");
  command.callback([arguments] { run(*arguments); });
}

}  // namespace skeletex::cli
