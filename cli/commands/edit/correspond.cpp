// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <memory>

#include "bone_pairs.h"
#include "command.h"
#include "files.h"
#include "skeletex/io/model_file.h"
#include "skeletex/io/skeleton_file.h"
#include "table.h"

namespace skeletex::cli {
namespace {

struct Arguments {
  std::string a, b, json;
  std::vector<std::string> bones;
};

Skeleton skeleton_of(const std::string& path) {
  return is_model_path(path) ? read_model(path).skeleton : read_skeleton(path);
}

void run(const Arguments& arguments) {
  const BonePairs given = parse_bone_pairs(arguments.bones);
  const Skeleton a = skeleton_of(arguments.a), b = skeleton_of(arguments.b);
  const Correspondence found = correspond(arguments.a, a, arguments.b, b, given);

  Json bones = Json::array(), nodes = Json::array();
  Table table({arguments.a, arguments.b, ""});
  for (std::size_t i = 0; i < a.bones.size(); ++i) {
    const std::string& to = b.bones[found.bones[i]].name;
    bones.push_back({{"a", a.bones[i].name}, {"b", to}, {"reversed", static_cast<bool>(found.is_reversed[i])}});
    table.add({a.bones[i].name, to, found.is_reversed[i] ? "reversed" : ""});
  }
  for (std::size_t n = 0; n < a.nodes.size(); ++n)
    nodes.push_back({{"a", a.nodes[n].name}, {"b", b.nodes[found.nodes[n]].name}});
  print(arguments.json, fmt::format("{}cost {:.3f}\n", table.text(), found.cost));
  write_json(arguments.json, {{"bones", bones}, {"nodes", nodes}, {"cost", found.cost}});
}

}  // namespace

void add_correspond_command(CLI::App& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand("correspond", "Which bone of one skeleton becomes which of another");
  declare_input(command, command.add_option("A", arguments->a, "model (.skx.exr, .skx) or skeleton (.json)"))
      ->required();
  declare_input(command, command.add_option("B", arguments->b, "another one"))->required();
  command.add_option("--bones", arguments->bones, "pairs that must hold; the rest is found")
      ->delimiter(',')
      ->type_name("A=B,..");
  add_json_option(command, arguments->json);
  command.footer(
      "Examples:\n"
      "  skeletex correspond man.skx.exr homer.skx.exr\n"
      "  skeletex correspond bear.skeleton.json bear_bis.skeleton.json --bones left_leg=right_leg\n"
      "The cost is 0 for equal names, lengths and directions, about 1 for nothing in common. Skeletons without a "
      "correspondence end with 1 and a message "
      "that names the first place where they differ.");
  command.callback([arguments] { run(*arguments); });
}

}  // namespace skeletex::cli
