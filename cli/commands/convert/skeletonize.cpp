// SPDX-License-Identifier: MIT
#include "skeletex/skeletonize/skeletonize.h"

#include <fmt/format.h>

#include <memory>

#include "command.h"
#include "files.h"
#include "progress_bar.h"
#include "skeletex/io/atomic_file.h"
#include "skeletex/io/skeleton_file.h"
#include "table.h"

namespace skeletex::cli {
namespace {

struct Arguments {
  std::string mesh, output, device, json, purpose = "pose";
  int bones = 0;
  double detail = 0;
};

std::string text_of(const SkeletonizeResult& result) {
  Table table({"candidate", "bones", "limbs", "error at 128", ""});
  for (std::size_t c = 0; c < result.candidates.size(); ++c) {
    const SkeletonCandidate& candidate = result.candidates[c];
    const bool is_accepted = candidate.refusal.empty();
    table.add({candidate.name, std::to_string(candidate.bones), fmt::format("{} of {}", candidate.limbs, result.limbs),
               is_accepted ? fmt::format("{:.2e}", candidate.error) : "-",
               static_cast<int>(c) == result.chosen ? "chosen"
               : is_accepted                        ? ""
                                                    : "refused"});
  }
  return table.text();
}

Json json_of(const SkeletonizeResult& result, const std::string& output, double seconds) {
  Json list = Json::array();
  for (const SkeletonCandidate& candidate : result.candidates) {
    Json entry{{"name", candidate.name},
               {"bones", candidate.bones},
               {"limbs", candidate.limbs},
               {"accepted", candidate.refusal.empty()}};
    if (candidate.refusal.empty())
      entry["error"] = candidate.error;
    else
      entry["refusal"] = candidate.refusal;
    list.push_back(std::move(entry));
  }
  return {{"output", output},
          {"nodes", result.skeleton.nodes.size()},
          {"bones", result.skeleton.bones.size()},
          {"genus", result.genus},
          {"limbs", result.limbs},
          {"chosen", result.candidates[result.chosen].name},
          {"candidates", std::move(list)},
          {"seconds", seconds}};
}

void run(const Arguments& arguments, const CLI::App& command) {
  Stopwatch watch;
  TriangleMesh mesh = load_mesh(arguments.mesh);
  const TriangleTree tree = require_closed(mesh);
  ClContext context(arguments.device);
  SkeletonizeOptions options;
  options.purpose = arguments.purpose == "size" ? SkeletonPurpose::kSize : SkeletonPurpose::kPose;
  if (command.count("--bones") > 0) options.most_bones = arguments.bones;
  if (command.count("--detail") > 0) options.detail = arguments.detail;
  SkeletonizeResult result;
  {
    ProgressBar bar(context);
    options.progress = [&](const std::string& stage, double done) {
      bar.show(stage, done);
      return true;
    };
    result = skeletonize(context, mesh, tree, options);
  }
  write_text_atomically(arguments.output, skeleton_to_json(result.skeleton).dump(2) + '\n');
  const double seconds = watch.lap_ms() / 1000;
  print(arguments.json,
        text_of(result) + fmt::format("{}: {} bone{}, {} nodes; {:.1f} s\n", arguments.output,
                                      result.skeleton.bones.size(), result.skeleton.bones.size() == 1 ? "" : "s",
                                      result.skeleton.nodes.size(), seconds));
  write_json(arguments.json, json_of(result, arguments.output, seconds));
}

}  // namespace

void add_skeletonize_command(CLI::App& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand("skeletonize", "Make a skeleton for a closed mesh");
  declare_input(command, command.add_option("MESH", arguments->mesh,
                                            "closed triangle mesh: .obj, .ply, .off, .stl, .glb, .gltf or .vrm"))
      ->required();
  declare_output(command, command.add_option("-o,--output", arguments->output, "the skeleton"), {".json"})
      ->required()
      ->type_name("FILE");
  command.add_option("--bones", arguments->bones, "the largest number of bones that works, at most N")
      ->type_name("N")
      ->check(number_in(1, 500));
  command
      .add_option("--detail", arguments->detail,
                  "which limbs get bones: 0 the longest ones, 1 fingers and ears as well (default: several are tried)")
      ->type_name("X")
      ->check(number_in(0.0, 1.0));
  take_one_of(*command
                   .add_option("--for", arguments->purpose,
                               "pose: every limb keeps a bone; size: what gives the least error, down to one bone")
                   ->capture_default_str(),
              {"pose", "size"});
  add_device_option(command, arguments->device);
  add_json_option(command, arguments->json);
  command.footer(
      "Examples:\n"
      "  skeletex skeletonize bear.off -o bear.skeleton.json\n"
      "  skeletex skeletonize bear.off -o bear.skeleton.json --bones 12\n"
      "  skeletex encode bear.off bear.skeleton.json -o bear.skx.exr");
  command.callback([arguments, &command] { run(*arguments, command); });
}

}  // namespace skeletex::cli
