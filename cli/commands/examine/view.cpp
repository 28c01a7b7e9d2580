// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>

#include "bone_pairs.h"
#include "command.h"
#include "files.h"
#include "progress_bar.h"
#include "skeletex/compact/decode_model.h"
#include "skeletex/convert/resample/resample.h"
#include "skeletex/io/atomic_file.h"
#include "skeletex/io/compact/compact_model_file.h"
#include "skeletex/io/model_file.h"
#include "skeletex/page/page.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex::cli {
namespace {

constexpr int kLargest = 512;  // texels along the longer side, unless --size says more: some 2 MB

struct Arguments {
  std::vector<std::string> models, bones;
  std::string output, against, device, json, up;
  int size = 0;
};

/// "models/bear.skx.exr" -> "bear"
std::string name_of(const std::string& path) {
  const std::string name = std::filesystem::path(path).filename().string();
  return name.substr(0, name.find('.', 1));
}

int longer_side(const SkeletexModel& model) { return std::max(model.texture.width, model.texture.height); }

/// The first model. One of a compact file is read at the page's size, and where it is the only one the page holds the
/// numbers of the file.
SkeletexModel read_first(const Arguments& arguments, PageOptions& options) {
  const std::string& path = arguments.models[0];
  if (arguments.models.size() > 1 || !is_compact_file(path)) return read_model(path);
  options.compact.emplace(PageCompact{read_compact_file(path)});
  const CompactModel& compact = options.compact->model;
  const int size = arguments.size > 0 ? arguments.size : std::min(kLargest, decoded_size(compact, 0));
  options.compact->octaves = octaves_for(compact, size);
  return read_compact_model(path, {.bytes = {}, .size = size});
}

void run(const Arguments& arguments) {
  if (arguments.models.size() > 2)
    throw CLI::ValidationError(
        fmt::format("a page shows a model, and one that it morphs to; {} are too many", arguments.models.size()));
  if (!arguments.bones.empty() && arguments.models.size() != 2)
    throw CLI::ValidationError("--bones", "pairs the bones of two models");
  const BonePairs given = parse_bone_pairs(arguments.bones);
  Stopwatch total;
  PageOptions options;
  SkeletexModel model = read_first(arguments, options);
  options.name = name_of(arguments.models[0]);
  if (!arguments.up.empty()) options.is_z_up = arguments.up == "z";
  if (arguments.models.size() == 2) {
    SkeletexModel second = read_model(arguments.models[1]);
    Correspondence correspondence =
        correspond(arguments.models[0], model.skeleton, arguments.models[1], second.skeleton, given);
    options.second.emplace(PageSecond{name_of(arguments.models[1]), std::move(second), std::move(correspondence)});
  }
  std::optional<TriangleMesh> reference;
  if (!arguments.against.empty()) {
    reference = load_mesh(arguments.against);
    options.reference = &*reference;
  }
  const bool has_own_weights = !model.bone_weights.empty();
  ClContext context(arguments.device);
  std::string page;
  const int own_size = longer_side(model), wanted = arguments.size > 0 ? arguments.size : std::min(kLargest, own_size);
  const int size = options.compact ? own_size : wanted;  // a compact model was read at the page's size
  const bool is_reduced = options.compact ? options.compact->octaves < 0 : size < own_size;
  {
    ProgressBar bar(context);
    bar.show("resampling", 0.1);
    if (size != longer_side(model)) model = resample_model(context, model, size);
    bar.show("preparing the page", 0.3);
    page = make_page(context, model, options);
    bar.show("writing", 0.95);
    write_text_atomically(arguments.output, page);
  }
  if (is_reduced && arguments.size == 0)
    warn(fmt::format("the page holds {} texels along the longer side; --size takes more", size));
  if (has_own_weights) warn("the page poses with weights in closed form; those that the model brings are left out");
  print(arguments.json,
        fmt::format("{}: {:.2f} MB, {} x {} texels\n", arguments.output, 1e-6 * static_cast<double>(page.size()),
                    model.texture.width, model.texture.height));
  write_json(arguments.json, {{"output", arguments.output},
                              {"bytes", page.size()},
                              {"size", {model.texture.width, model.texture.height}},
                              {"seconds", total.lap_ms() / 1000},
                              {"device", context.device().name},
                              {"kernels", profile_json(context)}});
}

}  // namespace

void add_view_command(CLI::App& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand(
      "view", "Write a page that shows a model in a browser: to turn, pose, morph and transfer");
  declare_input(command, command.add_option("MODEL", arguments->models,
                                            "model (.skx.exr, .skx), and one that it morphs to and takes bones from"))
      ->required()
      ->type_name("MODEL [MODEL_B]");
  declare_output(command, command.add_option("-o,--output", arguments->output, "the page: .html"), {".html"})
      ->required()
      ->type_name("FILE");
  command
      .add_option(
          "--size", arguments->size,
          fmt::format(
              "texels along the longer side, 4 to 2048 (default: the model's own size, at most {}); of a compact "
              "file at least that many",
              kLargest))
      ->check(number_in(4, 2048))
      ->type_name("N");
  declare_input(command, command.add_option("--against", arguments->against,
                                            "mesh that the page shows the errors to: .obj, .ply, .off or .stl"))
      ->type_name("MESH");
  take_one_of(*command.add_option("--up", arguments->up,
                                  "axis that points up in the picture: y, with z in front, or z, with -y in front "
                                  "(default: the model's own)"),
              {"y", "z"});
  command.add_option("--bones", arguments->bones, "pairs of bones that must correspond; the rest is found")
      ->delimiter(',')
      ->type_name("A=B,..");
  add_device_option(command, arguments->device);
  add_json_option(command, arguments->json);
  command.footer(
      "Examples:\n"
      "  skeletex view bear.skx.exr -o bear.html\n"
      "  skeletex view bear.skx.exr -o bear.html --against bear.off\n"
      "  skeletex view man.skx.exr homer.skx.exr -o morph.html\n"
      "The page is one file without links. It opens from disk in every browser with WebGL 2.");
  command.callback([arguments] { run(*arguments); });
}

}  // namespace skeletex::cli
