// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <memory>
#include <numbers>

#include "command.h"
#include "files.h"
#include "skeletex/io/atomic_file.h"
#include "skeletex/io/model_file.h"
#include "skeletex/io/pose_file.h"
#include "skeletex/io/skeleton_file.h"
#include "skeletex/skeleton/pose.h"

namespace skeletex::cli {
namespace {

struct Arguments {
  std::string input, output, json;
  double degrees = 40;
  std::uint64_t seed = 0;
  int frames = 1;
};

void run(const Arguments& arguments) {
  const Skeleton skeleton =
      has_ending(arguments.input, ".json") ? read_skeleton(arguments.input) : read_model(arguments.input).skeleton;
  Json frames = Json::array();
  for (int i = 0; i < arguments.frames; ++i) {
    const Pose pose = make_random_pose(skeleton, arguments.degrees * std::numbers::pi / 180,
                                       arguments.seed + static_cast<std::uint64_t>(i));
    frames.push_back(
        {{"time", i},
         {"name", fmt::format("random_{:g}_{}", arguments.degrees, arguments.seed + static_cast<std::uint64_t>(i))},
         {"pose", pose_to_json(pose, skeleton)}});
  }
  write_text_atomically(arguments.output, Json{{"frames", frames}}.dump(2) + "\n");
  print(arguments.json,
        fmt::format("{} poses of up to {:g} degrees: {}\n", arguments.frames, arguments.degrees, arguments.output));
  write_json(arguments.json, {{"output", arguments.output},
                              {"frames", arguments.frames},
                              {"degrees", arguments.degrees},
                              {"seed", arguments.seed}});
}

}  // namespace

void add_pose_random_command(CLI::App& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand("pose-random", "Make random poses of a skeleton, for sweeps");
  command.option_defaults()->always_capture_default();
  declare_input(command, command.add_option("SKELETON|MODEL", arguments->input, "skeleton (.json) or model (.skx.exr)"))
      ->required();
  declare_output(command,
                 command.add_option("-o,--output", arguments->output, "animation of which each frame is a pose: .json"),
                 {".json"})
      ->required()
      ->type_name("FILE");
  command.add_option("--degrees", arguments->degrees, "the most that a bone turns about its joint, 0 to 180")
      ->check(number_in(0, 180))
      ->type_name("D");
  command.add_option("--seed", arguments->seed, "another number gives other poses; frames take the numbers after it")
      ->check(number_in(0, 4294967295))
      ->type_name("N");
  command.add_option("--frames", arguments->frames, "how many poses")->check(number_in(1, 100000))->type_name("N");
  add_json_option(command, arguments->json);
  command.footer(
      "Example:\n"
      "  skeletex pose-random bear.skeleton.json -o random.json --degrees 40 --seed 1 --frames 10\n"
      "Bones at the root stay as they are. The same seed gives the same poses everywhere.");
  command.callback([arguments] { run(*arguments); });
}

}  // namespace skeletex::cli
