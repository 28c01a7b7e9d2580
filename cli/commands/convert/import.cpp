// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <optional>

#include "close_mesh.h"
#include "command.h"
#include "files.h"
#include "progress_bar.h"
#include "rig_file.h"
#include "skeletex/analysis/manifold.h"
#include "skeletex/analysis/validate_input.h"
#include "skeletex/convert/layers/read_layers.h"
#include "skeletex/io/atomic_file.h"
#include "skeletex/io/mesh_file.h"
#include "skeletex/io/pose_file.h"
#include "skeletex/io/skeleton_file.h"
#include "skeletex/model/error.h"

namespace skeletex::cli {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::string rig, output, device, json;
  CloseOptions close;
};

/// Characters that file names of no system have trouble with.
std::string file_name(std::string name) {
  for (char& c : name)
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '-' && c != '_' && c != '.') c = '_';
  return name.empty() || name.front() == '.' ? "_" + name : name;
}

void make_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw IoError(fmt::format("{}: the folder cannot be made: {}", folder.string(), error.message()));
}

/// The colour of each vertex, where the file has colours.
std::vector<VertexColour> vertex_colours(const TriangleMesh& mesh, const MeshAttributes& attributes) {
  std::vector<VertexColour> colours;
  if (!has_colour(attributes)) return colours;
  colours.resize(mesh.positions.size());
  const SurfaceColours surface(mesh, attributes);
  for (int t = 0; t < static_cast<int>(mesh.triangles.size()); ++t)
    for (int k = 0; k < 3; ++k) {
      const Colour colour = surface.at({t, Eigen::Vector3f::Unit(k)});
      const auto byte = [&](int i) {
        return static_cast<unsigned char>(std::lround(255 * srgb_from_linear(std::clamp(colour[i], 0.f, 1.f))));
      };
      colours[mesh.triangles[t][k]] = {byte(0), byte(1), byte(2)};
    }
  return colours;
}

/// What stands in the way of encoding it. A mesh that is inside out is turned.
/// \return in words and for the JSON
std::pair<std::string, Json> findings_of(const Skeleton& skeleton, TriangleMesh& mesh) {
  std::string text;
  Json list = Json::array();
  for (const Finding& finding :
       skeleton.bones.empty() ? validate_mesh(mesh) : validate_before_segmentation(mesh, skeleton)) {
    const bool is_error = finding.severity == Severity::kError;
    text += fmt::format("{}: {}\n{}", is_error ? "error" : "note", finding.message,
                        finding.remedy.empty() ? "" : fmt::format("  remedy: {}\n", finding.remedy));
    list.push_back(
        {{"rule", finding.rule}, {"is_error", is_error}, {"message", finding.message}, {"remedy", finding.remedy}});
  }
  return {text, list};
}

void run(const Arguments& arguments) {
  const RigFile file = load_rig(arguments.rig, arguments.close);
  ClContext context(arguments.device);
  std::optional<ProgressBar> bar(std::in_place, context);
  bar->show("importing", 0.2);
  const ImportedRig rig = import_rig(context, file);
  const std::vector<VertexColour> colours = vertex_colours(file.surface.mesh, file.surface.attributes);
  TriangleMesh mesh = file.surface.mesh;
  auto [findings_text, findings] = findings_of(rig.skeleton, mesh);
  const fs::path folder = arguments.output;
  make_folder(folder);
  std::vector<std::string> written{(folder / "mesh.ply").string()};
  WrittenAttributes attributes;
  attributes.vertex_colours = colours;
  write_mesh(written.back(), mesh, attributes);
  if (!rig.skeleton.bones.empty()) {
    written.push_back((folder / "skeleton.json").string());
    write_text_atomically(written.back(), skeleton_to_json(rig.skeleton).dump(1) + "\n");
  }
  Json animations = Json::array();
  for (const NamedAnimation& named : rig.animations) {
    make_folder(folder / "poses");
    written.push_back((folder / "poses" / (file_name(named.name) + ".json")).string());
    write_text_atomically(written.back(), animation_to_json(named.animation, rig.skeleton).dump() + "\n");
    animations.push_back({{"name", named.name},
                          {"file", written.back()},
                          {"frames", named.animation.frames.size()},
                          {"seconds", named.animation.frames.back().time}});
  }
  const ManifoldReport report = measure_manifold(mesh);
  std::string text =
      fmt::format("{} vertices, {} triangles, {} component{}, {}; {} joints became {} bones; {} animation{}\n",
                  mesh.positions.size(), mesh.triangles.size(), report.components, report.components == 1 ? "" : "s",
                  report.is_closed_manifold() ? "closed" : "not closed", rig.joints_in_file, rig.skeleton.bones.size(),
                  rig.animations.size(), rig.animations.size() == 1 ? "" : "s");
  text += findings_text;
  for (const std::string& path : written) text += path + "\n";
  bar.reset();
  print(arguments.json, text);
  Json json{{"files", written},
            {"vertices", mesh.positions.size()},
            {"triangles", mesh.triangles.size()},
            {"components", report.components},
            {"closed", report.is_closed_manifold()},
            {"joints", rig.joints_in_file},
            {"bones", rig.skeleton.bones.size()},
            {"animations", std::move(animations)},
            {"notes", rig.notes},
            {"findings", std::move(findings)}};
  if (!file.closing.is_null()) json["close"] = file.closing;
  write_json(arguments.json, json);
}

}  // namespace

void add_import_command(CLI::App& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand(
      "import", "Take a rigged character of another program apart: mesh, skeleton, and poses of its animations");
  declare_input(command, command.add_option("RIG", arguments->rig, "glTF 2.0: .glb, .gltf or .vrm"))->required();
  declare_output_folder(command, command.add_option("-o,--output", arguments->output,
                                                    "folder for mesh.ply, skeleton.json and poses/NAME.json"))
      ->required()
      ->type_name("FOLDER");
  add_close_options(command, arguments->close);
  add_device_option(command, arguments->device);
  add_json_option(command, arguments->json);
  command.footer(
      "Examples:\n"
      "  skeletex import robot.glb -o robot\n"
      "  skeletex encode robot.glb -o robot.skx.exr\n"
      "  skeletex reconstruct robot.skx.exr -o running.ply --pose robot/poses/run.json --time 0.5\n"
      "`encode` takes such a file itself, with the weights of its skin. The skeleton and the mesh may be changed in "
      "between: encode robot.glb robot/skeleton.json. What stands in the way of encoding it is said.");
  command.callback([arguments] { run(*arguments); });
}

}  // namespace skeletex::cli
