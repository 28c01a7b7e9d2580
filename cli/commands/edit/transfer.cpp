// SPDX-License-Identifier: MIT
#include "skeletex/edit/transfer/transfer.h"

#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <optional>

#include "bone_pairs.h"
#include "command.h"
#include "files.h"
#include "progress_bar.h"
#include "result_file.h"
#include "skeletex/analysis/folds.h"
#include "skeletex/edit/live.h"
#include "skeletex/edit/transfer/mirror.h"
#include "skeletex/io/model_file.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex::cli {
namespace {

struct Arguments {
  std::string source, target, output, device, json, blend = "cosine", width = "auto", scale = "auto", keep = "auto",
                                                    skip = "auto";
  std::vector<std::string> bones;
  double share = 1;
  bool has_limbs = false, is_mirrored = false, has_creases = false;
};

/// A number from the whole text; nothing where it is none.
std::optional<double> parse_number(const std::string& text) {
  double value = 0;
  std::size_t used = 0;
  try {
    value = std::stod(text, &used);
  } catch (const std::exception&) {
    return {};
  }
  if (used != text.size() || !std::isfinite(value)) return {};
  return value;
}

/// "0.2": share of the bone's rows; "12px": rows.
void parse_width(const std::string& text, TransferOptions& options) {
  if (text == "auto") return;
  const bool is_in_texels = text.ends_with("px");
  const double value = parse_number(is_in_texels ? text.substr(0, text.size() - 2) : text).value_or(-1);
  if (!(value >= 0) || (is_in_texels ? !(value >= 1 && value <= 16384) : value > 1))
    throw CLI::ValidationError(
        "--width",
        fmt::format("\"{}\" is neither auto, a share from 0 to 1 nor a number of texels such as 12px", text));
  (is_in_texels ? options.width_in_texels : options.width) = value;
}

void parse_scale(const std::string& text, TransferOptions& options) {
  if (text == "auto" || text == "length" || text == "girth") {
    options.scale = text == "auto"     ? TransferScale::kAuto
                    : text == "length" ? TransferScale::kLength
                                       : TransferScale::kGirth;
    return;
  }
  const std::optional<double> factor = parse_number(text);
  if (!factor || !(*factor > 0))
    throw CLI::ValidationError("--scale",
                               fmt::format("\"{}\" is neither auto, length, girth nor a number above 0", text));
  options.scale = TransferScale::kFactor;
  options.factor = *factor;
}

/// auto: -1.
double parse_share(const char* option, const std::string& text) {
  if (text == "auto") return -1;
  const std::optional<double> share = parse_number(text);
  if (!share || !(*share >= 0 && *share <= 0.9))
    throw CLI::ValidationError(option, fmt::format("\"{}\" is neither auto nor a share from 0 to 0.9", text));
  return *share;
}

void run(const Arguments& arguments) {
  const BonePairs pairs = parse_bone_pairs(arguments.bones);
  TransferOptions options;
  options.has_limbs = arguments.has_limbs;
  options.blend = arguments.blend == "cosine"   ? TransferBlend::kCosine
                  : arguments.blend == "linear" ? TransferBlend::kLinear
                                                : TransferBlend::kNone;
  options.is_smooth = !arguments.has_creases;
  parse_width(arguments.width, options);
  parse_scale(arguments.scale, options);
  options.keep = parse_share("--keep", arguments.keep);
  options.skip = parse_share("--skip", arguments.skip);

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
    ProgressBar bar(context);
    bar.show("transferring", 0.3);
    SkeletexModel result = transfer(context, source, target, pairs, options, &parts);
    if (arguments.share != 1) result = LiveBlend(context, target, result).at(arguments.share);
    json = write_result(context, result, arguments.output);
    if (!arguments.json.empty()) {
      bar.show("measuring", 0.8);
      const auto folded = [&](const SkeletexModel& model) {
        return measure_folds(reconstruct_mesh(context, model)).folded_edges;
      };
      json["folded_edges"] = folded(result);
      json["folded_edges_of_target"] = folded(target);
    }
  }
  Json bones = Json::array();
  for (std::size_t i = 0; i < pairs.size(); ++i)
    bones.push_back({{"source", pairs[i].first},
                     {"target", pairs[i].second},
                     {"scale", parts[i].scale},
                     {"length_scale", parts[i].length_scale},
                     {"skipped", parts[i].skipped},
                     {"kept", parts[i].kept}});
  json["bones"] = bones;
  json["seconds"] = total.lap_ms() / 1000;
  json["device"] = context.device().name;
  json["kernels"] = profile_json(context);
  print(arguments.json, fmt::format("{}\n", arguments.output));
  write_json(arguments.json, json);
}

}  // namespace

void add_transfer_command(CLI::App& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand(
      "transfer", "Replace the surface of bones by that of another model's, or of others of the same");
  declare_input(command, command.add_option("SOURCE", arguments->source, "model (.skx.exr, .skx) to take from"))
      ->required();
  declare_input(command, command.add_option("TARGET", arguments->target, "model to put it on; may be the same"))
      ->required();
  command.add_option("--bones", arguments->bones, "pairs of bones: SOURCE's=TARGET's")
      ->required()
      ->delimiter(',')
      ->type_name("A=B,..");
  command.add_flag("--limb", arguments->has_limbs, "also all bones below them, which must branch alike");
  command.add_flag("--mirror", arguments->is_mirrored,
                   "take from the source's mirror image: a left arm for a right one");
  take_one_of(*command.add_option("--blend", arguments->blend, "how the two fade near the seams (default: cosine)"),
              {"cosine", "linear", "none"});
  command
      .add_option(
          "--width", arguments->width,
          "width of the fade: share of the bone's rows, or rows as 12px (default: auto, 0.25, between two seams 0.5)")
      ->type_name("auto|W|Npx");
  command
      .add_option("--scale", arguments->scale,
                  "across the bones: by the ratio of lengths or of girths, or a factor (default: auto, their geometric "
                  "mean, between two seams girths)")
      ->type_name("auto|length|girth|X");
  command
      .add_option("--keep", arguments->keep,
                  "share of its rows that the target keeps at its seams (default: auto, up to the limb's root)")
      ->type_name("auto|S");
  command
      .add_option("--skip", arguments->skip,
                  "share of the source's rows that is left out there (default: auto, up to the limb's root)")
      ->type_name("auto|S");
  command.add_flag("--creases", arguments->has_creases,
                   "join each column by itself, within the first bone, which may leave creases");
  command
      .add_option("--share", arguments->share,
                  "weight of the result: 0 keeps the target, 1 (default) gives the transfer")
      ->check(number_in(0.0, 1.0));
  add_result_option(command, arguments->output);
  add_device_option(command, arguments->device);
  add_json_option(command, arguments->json);
  command.footer(
      "Examples:\n"
      "  skeletex transfer triceratops.skx.exr bunny00.skx.exr --bones left_horn=left_ear,right_horn=right_ear -o "
      "horned.ply\n"
      "  skeletex transfer man.skx.exr armadillo.skx.exr --bones left_upper_arm=left_upper_arm --limb -o "
      "armed.skx.exr\n"
      "  skeletex transfer bear.skx.exr bear.skx.exr --bones left_shoulder=right_shoulder --limb --mirror -o "
      "symmetric.ply");
  command.callback([arguments] { run(*arguments); });
}

}  // namespace skeletex::cli
