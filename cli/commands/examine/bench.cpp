// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <memory>

#include "bench/stages/stages.h"
#include "command.h"
#include "deform_option.h"
#include "files.h"
#include "program_path.h"
#include "progress_bar.h"
#include "skeletex/convert/resample/resample.h"
#include "skeletex/io/model_file.h"
#include "skeletex/io/pose_file.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "table.h"

namespace skeletex::cli {
namespace {

struct Arguments {
  std::vector<std::string> models, stages;
  std::string pose, device, json, deform = "smooth";
  int size = 0, repeats = 0;
};

bool is_one_of(const std::string& name, std::initializer_list<const char*> names) {
  return std::find(names.begin(), names.end(), name) != names.end();
}
bool needs_mesh(const std::string& stage) {
  return is_one_of(stage, {"vsm", "spd_rays", "metro", "segment", "encode", "snap"});
}
bool needs_two(const std::string& stage) { return is_one_of(stage, {"morph", "transfer"}); }
bool is_config(const std::string& path) { return has_ending(path, ".json"); }

/// What the stages are made from: the models given, or the project's own. Read and encoded when a stage asks for them.
class Inputs {
 public:
  Inputs(ClContext& context, const Arguments& arguments) : context_(context), arguments_(arguments) {}

  MeshInputPointer mesh(std::size_t number) {
    const std::string name = name_of(number, "armadillo");
    MeshInputPointer& input = meshes_[name];
    if (!input) input = arguments_.models.empty() ? find_mesh_input(name) : read_mesh_input(name);
    return input;
  }

  /// \param size  where none is given: of models that are encoded for it; 0: their own
  TextureInputPointer texture(std::size_t number, const char* own_name, int size) {
    if (arguments_.size > 0) size = arguments_.size;
    const std::string name = name_of(number, own_name);
    TextureInputPointer& input = textures_[{name, size}];
    if (input) return input;
    if (arguments_.models.empty()) {
      input = encode_input(context_, *find_mesh_input(name), size);
    } else if (is_config(name)) {
      input = encode_input(context_, *mesh(number), size);
    } else {
      SkeletexModel model = read_model(name);
      if (arguments_.size > 0) model = resample_model(context_, model, size);
      input = std::make_shared<TextureInput>(TextureInput{name, std::move(model)});
    }
    return input;
  }

 private:
  std::string name_of(std::size_t number, const char* own_name) const {
    return arguments_.models.empty() ? own_name : arguments_.models[number];
  }

  ClContext& context_;
  const Arguments& arguments_;
  std::map<std::string, MeshInputPointer> meshes_;
  std::map<std::pair<std::string, int>, TextureInputPointer> textures_;
};

Stage make_stage(const std::string& name, ClContext& context, Inputs& inputs, const Arguments& arguments) {
  // Frames are those of the paper's largest texture; solvers and the command take the size that models have by default.
  constexpr int kFrameSize = 2048, kModelSize = 512;
  const int size = arguments.size > 0 ? arguments.size : kModelSize;
  if (name == "reconstruct") return reconstruct_stage(context, inputs.texture(0, "armadillo", kFrameSize));
  if (name == "pose") {
    const TextureInputPointer input = inputs.texture(0, "armadillo", kFrameSize);
    std::optional<Pose> pose;
    if (!arguments.pose.empty())
      pose = pose_at(input->model.skeleton, read_animation(arguments.pose, input->model.skeleton), 0);
    return pose_stage(context, input, pose, deformation_of(arguments.deform));
  }
  if (name == "morph")
    return morph_stage(context, inputs.texture(0, "bear", kFrameSize), inputs.texture(1, "bear_bis", kFrameSize));
  if (name == "transfer")
    return transfer_stage(context, inputs.texture(0, "bear", kFrameSize), inputs.texture(1, "bear_bis", kFrameSize));
  if (name == "filter") return filter_stage(context, inputs.texture(0, "armadillo", kModelSize));
  if (name == "vsm") return vsm_stage(context, inputs.mesh(0));
  if (name == "spd_rays") return spd_rays_stage(context, inputs.mesh(0), size);
  if (name == "metro") return metro_stage(context, inputs.mesh(0));
  if (name == "segment") return segment_stage(context, inputs.mesh(0));
  if (name == "encode") return encode_stage(inputs.mesh(0), size, program_path(), arguments.device);
  return snap_stage(inputs.mesh(0), size, program_path(), arguments.device);
}

/// The stages asked for, else all that the models allow, in the order of a report.
std::vector<std::string> stages_of(const Arguments& arguments) {
  const auto lacks = [&](const std::string& stage) -> const char* {
    if (arguments.models.empty()) return nullptr;
    if (needs_mesh(stage) && !is_config(arguments.models[0]))
      return "a mesh and its skeleton: a .json as in configs/models";
    if (needs_two(stage) && arguments.models.size() < 2) return "two models that correspond";
    return nullptr;
  };
  for (const std::string& stage : arguments.stages)
    if (const char* what = lacks(stage)) throw CLI::ValidationError("--stage", stage + " takes " + what);
  std::vector<std::string> chosen;
  for (const std::string& stage : kStageNames)
    if (arguments.stages.empty()
            ? !lacks(stage)
            : std::find(arguments.stages.begin(), arguments.stages.end(), stage) != arguments.stages.end())
      chosen.push_back(stage);
  return chosen;
}

Json row_json(const Stage& stage, const StageSamples& samples, const std::string& device) {
  const double wall = samples.median(&StageSample::wall_ms);
  Json row{{"stage", stage.name},
           {"model", stage.model},
           {"size", stage.size},
           {"ms", samples.median(&StageSample::ms)},
           {"reference", stage.reference},
           {"reference_ms", samples.median(&StageSample::reference_ms)},
           {"ratio", samples.ratio()},
           {"wall_ms", wall},
           {"frames_per_second", 1000 / wall},
           {"ms_min", samples.least(&StageSample::ms)},
           {"ms_max", samples.most(&StageSample::ms)},
           {"device_ms", samples.median(&StageSample::device_ms)},
           {"launches", samples.median(&StageSample::launches)},
           {"repeats", samples.samples.size()},
           {"device", device}};
  if (stage.details)
    for (const auto& [name, value] : stage.details()) row[name] = value;
  return row;
}

void run(const Arguments& arguments) {
  if (arguments.models.size() > 2) throw CLI::ValidationError("one model, or two that correspond");
  const std::vector<std::string> names = stages_of(arguments);
  ClContext context(arguments.device);
  Inputs inputs(context, arguments);
  Repeats repeats;
  if (arguments.repeats > 0) repeats = {.most = arguments.repeats, .least = arguments.repeats};

  Table table({"stage", "model", "size", "ms", "min", "max", "wall ms", "reference ms", "ratio", "against"});
  Json json = Json::array();
  {
    ProgressBar bar(context);
    for (std::size_t i = 0; i < names.size(); ++i) {
      const auto show = [&](double done) {
        bar.show(names[i], (static_cast<double>(i) + done) / static_cast<double>(names.size()));
      };
      show(0);
      const Stage stage = make_stage(names[i], context, inputs, arguments);
      const Json row = row_json(stage, measure(context, stage, repeats, show), context.device().name);
      const auto cell = [&](const char* key) { return fmt::format("{:.2f}", row.at(key).get<double>()); };
      table.add({stage.name, stage.model, fmt::format("{}", stage.size), cell("ms"), cell("ms_min"), cell("ms_max"),
                 cell("wall_ms"), cell("reference_ms"), cell("ratio"), stage.reference});
      json.push_back(row);
    }
  }
  print(arguments.json, table.text() + fmt::format("medians; on {}\n", context.device().name));
  write_json(arguments.json, json);
}

}  // namespace

void add_bench_command(CLI::App& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command =
      *program.add_subcommand("bench", "Time the stages on your device, each beside what it is measured against");
  declare_input(command, command.add_option("MODEL", arguments->models,
                                            "model (.skx.exr), or mesh and skeleton (.json as in configs/models), and "
                                            "for morph and transfer another one whose skeleton corresponds "
                                            "(default: models of the project)"));
  CLI::Option& stages = *command.add_option("--stage", arguments->stages, "these stages only")->delimiter(',');
  take_one_of(stages, kStageNames);
  stages.type_name("NAME,..");
  command
      .add_option("--size", arguments->size,
                  "texels along the longer side (default: the model's; of others 2048 for frames, else 512)")
      ->check(number_in(4, 16384))
      ->type_name("N");
  declare_input(command,
                command.add_option("--pose", arguments->pose, "pose: .json (default: the skeleton bent by 40 degrees)"))
      ->type_name("FILE");
  add_deform_option(command, arguments->deform);
  command
      .add_option("--repeats", arguments->repeats,
                  "runs that are timed, after one that is not (default: up to 15, 3 at least, in 2 s)")
      ->check(number_in(1, 10000))
      ->type_name("N");
  add_device_option(command, arguments->device);
  add_json_option(command, arguments->json);
  command.footer(
      "Examples:\n"
      "  skeletex bench\n"
      "  skeletex bench bear.skx.exr bear_bis.skx.exr --size 2048 --stage pose,morph\n"
      "  skeletex bench configs/models/bunny00.json --stage vsm,encode\n"
      "Stages: reconstruct, pose, morph, transfer, filter; of a mesh also vsm, spd_rays, metro, segment, encode, snap. "
      "The first five count the kernels' time,\n"
      "beside a device copy that moves the bytes that they must; the others all time, beside another library's on the "
      "same data, snap beside the parameterization.");
  command.callback([arguments] { run(*arguments); });
}

}  // namespace skeletex::cli
