// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <memory>

#include "command.h"
#include "files.h"
#include "progress_bar.h"
#include "skeletex/analysis/validate_input.h"
#include "skeletex/io/skeleton_file.h"

namespace skeletex::cli {
namespace {

struct Arguments {
  std::string mesh, skeleton, device, json;
};

const char* to_word(Severity severity) {
  switch (severity) {
    case Severity::kNote: return "note";
    case Severity::kWarning: return "warning";
    default: return "error";
  }
}

void run(const Arguments& arguments) {
  TriangleMesh mesh = load_mesh(arguments.mesh);
  const Skeleton skeleton = read_skeleton(arguments.skeleton);
  ClContext context(arguments.device);
  std::vector<Finding> findings;
  {
    ProgressBar bar(context);
    bar.show("checking", 0);
    findings = validate_input(context, mesh, skeleton);
  }
  std::string text;
  Json list = Json::array();
  int errors = 0, warnings = 0;
  for (const Finding& finding : findings) {
    errors += finding.severity == Severity::kError;
    warnings += finding.severity == Severity::kWarning;
    text += fmt::format("{} ({}): {}\n", to_word(finding.severity), finding.rule, finding.message);
    if (!finding.remedy.empty()) text += fmt::format("  remedy: {}\n", finding.remedy);
    list.push_back({{"severity", to_word(finding.severity)},
                    {"rule", finding.rule},
                    {"message", finding.message},
                    {"remedy", finding.remedy}});
  }
  text += fmt::format("{} triangles, {} bones: {}\n", mesh.triangles.size(), skeleton.bones.size(),
                      errors > 0     ? fmt::format("{} error{}; not usable as it is", errors, errors == 1 ? "" : "s")
                      : warnings > 0 ? fmt::format("usable, {} warning{}", warnings, warnings == 1 ? "" : "s")
                                     : "usable");
  print(arguments.json, text);
  write_json(arguments.json, {{"valid", errors == 0},
                              {"errors", errors},
                              {"warnings", warnings},
                              {"findings", std::move(list)},
                              {"vertices", mesh.positions.size()},
                              {"triangles", mesh.triangles.size()},
                              {"bones", skeleton.bones.size()}});
  if (errors > 0) throw CLI::RuntimeError(kExitBad);
}

}  // namespace

void add_validate_command(CLI::App& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand(
      "validate", "Say everything that is wrong with a mesh and a skeleton, each with its place and remedy");
  declare_input(command, command.add_option("MESH", arguments->mesh, "triangle mesh: .obj, .ply, .off or .stl"))
      ->required();
  declare_input(command, command.add_option("SKELETON", arguments->skeleton,
                                            "skeleton: JSON with nodes and bones, in the mesh's coordinates"))
      ->required();
  add_device_option(command, arguments->device);
  add_json_option(command, arguments->json);
  command.footer(
      "Example:\n"
      "  skeletex validate bear.off bear.skeleton.json\n"
      "Ends with 0 when the two are usable (warnings allowed), with 1 when they are not.");
  command.callback([arguments] { run(*arguments); });
}

}  // namespace skeletex::cli
