// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <set>

#include "command.h"
#include "files.h"
#include "progress_bar.h"
#include "skeletex/analysis/validate_input.h"
#include "skeletex/io/atomic_file.h"
#include "skeletex/io/skeleton_file.h"
#include "skeletex/model/error.h"
#include "skeletex/skeletonize/repair_skeleton.h"

namespace skeletex::cli {
namespace {

struct Arguments {
  std::string mesh, skeleton, repaired, device, json;
};

const char* to_word(Severity severity) {
  switch (severity) {
    case Severity::kNote: return "note";
    case Severity::kWarning: return "warning";
    default: return "error";
  }
}

Json json_of(const Vec3& p) { return {p.x(), p.y(), p.z()}; }

/// What to do about a finding, taken from a skeleton that works: the nodes that lie elsewhere there, at the finding's
/// node and bone and at the bones next to it. Null without such a skeleton, or where it says nothing.
Json suggestion_for(const Finding& finding, const Skeleton& skeleton, const Skeleton& repaired) {
  std::set<int> nodes;
  if (finding.node >= 0) nodes.insert(finding.node);
  if (finding.bone >= 0) {
    const Bone& bone = skeleton.bones[finding.bone];
    for (const Bone& next : skeleton.bones)
      for (const int node : {bone.head, bone.tail})
        if (next.head == node || next.tail == node) nodes.insert({next.head, next.tail});
  }
  Json moves = Json::array(), bends = Json::array();
  const auto find = [&](const std::string& name) {
    return std::find_if(repaired.nodes.begin(), repaired.nodes.end(), [&](const Node& n) { return n.name == name; });
  };
  for (const int n : nodes) {
    const auto now = find(skeleton.nodes[n].name);
    if (now == repaired.nodes.end())
      moves.push_back({{"node", skeleton.nodes[n].name}, {"remove", true}});
    else if (now->position != skeleton.nodes[n].position)
      moves.push_back({{"node", skeleton.nodes[n].name}, {"position", json_of(now->position)}});
  }
  if (finding.bone >= 0)
    for (const Node& node : repaired.nodes)
      if (node.name.starts_with(skeleton.bones[finding.bone].name + "_bend")) bends.push_back(json_of(node.position));
  Json suggestion = Json::object();
  if (!moves.empty()) suggestion["nodes"] = std::move(moves);
  if (!bends.empty()) suggestion["bend"] = std::move(bends);
  return suggestion.empty() ? Json() : suggestion;
}

Json json_of(const Finding& finding, const Skeleton& skeleton, const RepairResult* repair) {
  Json json{{"severity", to_word(finding.severity)},
            {"rule", finding.rule},
            {"message", finding.message},
            {"remedy", finding.remedy}};
  if (finding.node >= 0) json["node"] = skeleton.nodes[finding.node].name;
  if (finding.bone >= 0) json["bone"] = skeleton.bones[finding.bone].name;
  if (finding.position) json["position"] = json_of(*finding.position);
  if (repair && finding.severity == Severity::kError)
    if (Json suggestion = suggestion_for(finding, skeleton, repair->skeleton); !suggestion.is_null())
      json["suggestion"] = std::move(suggestion);
  return json;
}

/// A skeleton that works in place of one that does not, where there is one.
/// \param refusal  out: why there is none
std::optional<RepairResult> try_repair(ClContext& context, const TriangleMesh& mesh, const Skeleton& skeleton,
                                       std::string& refusal) {
  TriangleMesh copy = mesh;
  std::optional<TriangleTree> tree;
  if (has_errors(validate_mesh(copy, &tree))) {
    refusal = "the mesh itself has errors, which come first";
    return std::nullopt;
  }
  try {
    return repair_skeleton(context, copy, *tree, skeleton);
  } catch (const DeviceError&) {
    throw;
  } catch (const Error& error) {
    refusal = error.what();
    return std::nullopt;
  }
}

struct Outcome {
  std::vector<Finding> findings;
  std::optional<RepairResult> repair;
  std::string refusal;
  long errors() const { return count(Severity::kError); }
  long warnings() const { return count(Severity::kWarning); }
  long count(Severity severity) const {
    return std::count_if(findings.begin(), findings.end(), [&](const Finding& f) { return f.severity == severity; });
  }
};

std::string text_of(const Arguments& arguments, const Outcome& outcome, const std::string& verdict) {
  std::string text;
  for (const Finding& finding : outcome.findings) {
    text += fmt::format("{} ({}): {}\n", to_word(finding.severity), finding.rule, finding.message);
    if (!finding.remedy.empty()) text += fmt::format("  remedy: {}\n", finding.remedy);
  }
  text += verdict + '\n';
  if (arguments.repaired.empty()) return text;
  if (outcome.repair)
    for (const std::string& change : outcome.repair->changes) text += fmt::format("changed: {}\n", change);
  return text + (outcome.repair
                     ? fmt::format("{}: {} bones, usable\n", arguments.repaired, outcome.repair->skeleton.bones.size())
                     : fmt::format("not repaired: {}\n", outcome.refusal));
}

Outcome check(const Arguments& arguments, TriangleMesh& mesh, const Skeleton& skeleton) {
  Outcome outcome;
  if (arguments.skeleton.empty()) {
    outcome.findings = validate_mesh(mesh);
    return outcome;
  }
  ClContext context(arguments.device);
  ProgressBar bar(context);
  bar.show("checking", 0);
  outcome.findings = validate_input(context, mesh, skeleton);
  if (has_errors(outcome.findings) && (!arguments.json.empty() || !arguments.repaired.empty())) {
    bar.show("repairing", 0.3);
    outcome.repair = try_repair(context, mesh, skeleton, outcome.refusal);
  } else {
    outcome.repair = RepairResult{skeleton, {}};
  }
  return outcome;
}

void run(const Arguments& arguments) {
  TriangleMesh mesh = load_mesh(arguments.mesh);
  const bool has_skeleton = !arguments.skeleton.empty();
  const Skeleton skeleton = has_skeleton ? read_skeleton(arguments.skeleton) : Skeleton{};
  const Outcome outcome = check(arguments, mesh, skeleton);
  const long errors = outcome.errors(), warnings = outcome.warnings();
  const bool is_repaired = !arguments.repaired.empty() && outcome.repair;
  if (is_repaired) write_text_atomically(arguments.repaired, skeleton_to_json(outcome.repair->skeleton).dump(2) + '\n');
  const std::string verdict = fmt::format(
      "{} triangles{}: {}", mesh.triangles.size(), has_skeleton ? fmt::format(", {} bones", skeleton.bones.size()) : "",
      errors > 0     ? fmt::format("{} error{}; not usable as it is", errors, errors == 1 ? "" : "s")
      : warnings > 0 ? fmt::format("usable, {} warning{}", warnings, warnings == 1 ? "" : "s")
                     : "usable");
  print(arguments.json, text_of(arguments, outcome, verdict));
  Json list = Json::array();
  for (const Finding& finding : outcome.findings)
    list.push_back(json_of(finding, skeleton, outcome.repair ? &*outcome.repair : nullptr));
  Json json{{"valid", errors == 0},
            {"errors", errors},
            {"warnings", warnings},
            {"findings", std::move(list)},
            {"vertices", mesh.positions.size()},
            {"triangles", mesh.triangles.size()}};
  if (has_skeleton) json["bones"] = skeleton.bones.size();
  if (!arguments.repaired.empty()) {
    json["repaired"] = is_repaired ? Json(arguments.repaired) : Json();
    if (is_repaired)
      json["changes"] = outcome.repair->changes;
    else
      json["refusal"] = outcome.refusal;
  }
  write_json(arguments.json, json);
  if (errors > 0 && !is_repaired) throw CLI::RuntimeError(kExitBad);
}

}  // namespace

void add_validate_command(CLI::App& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand(
      "validate", "Say everything that is wrong with a mesh, or a mesh and a skeleton, each with its place and remedy");
  declare_input(command, command.add_option("MESH", arguments->mesh,
                                            "triangle mesh: .obj, .ply, .off, .stl, .glb, .gltf or .vrm"))
      ->required();
  CLI::Option* skeleton = command.add_option(
      "SKELETON", arguments->skeleton,
      "skeleton: JSON with nodes and bones, in the mesh's coordinates; without, the mesh alone is checked");
  declare_input(command, skeleton);
  declare_output(command,
                 command.add_option("--repair", arguments->repaired,
                                    "write a skeleton that is usable: nodes are moved, and what no move mends is bent, "
                                    "contracted or taken away"),
                 {".json"})
      ->type_name("FILE")
      ->needs(skeleton);
  add_device_option(command, arguments->device);
  add_json_option(command, arguments->json);
  command.footer(
      "Examples:\n"
      "  skeletex validate bear.off\n"
      "  skeletex validate bear.off bear.skeleton.json\n"
      "  skeletex validate bear.off bear.skeleton.json --repair fixed.skeleton.json\n"
      "Ends with 0 when all is usable (warnings allowed) or was repaired, else with 1.");
  command.callback([arguments] { run(*arguments); });
}

}  // namespace skeletex::cli
