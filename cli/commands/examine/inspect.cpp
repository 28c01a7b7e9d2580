// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <memory>

#include "command.h"
#include "files.h"
#include "skeletex/analysis/manifold.h"
#include "skeletex/geometry/self_intersection.h"
#include "skeletex/io/model_file.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/thin_triangles.h"
#include "table.h"

namespace skeletex::cli {
namespace {

struct Arguments {
  std::string file, json;
  bool has_self_intersections = false;
};

bool is_mesh_file(const std::filesystem::path& path) {
  std::string ending = path.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  constexpr std::array<std::string_view, 7> kEndings{".obj", ".ply", ".off", ".stl", ".glb", ".gltf", ".vrm"};
  return std::find(kEndings.begin(), kEndings.end(), ending) != kEndings.end();
}

/// The items of a list as "3 x 4, 5, true".
std::string in_one_line(const nlohmann::json& value) {
  if (value.is_string()) return value.get<std::string>();
  if (!value.is_structured()) return value.dump();
  std::string text;
  for (const auto& [key, item] : value.items())
    text += (text.empty() ? "" : ", ") + (value.is_object() ? key + " " : "") + in_one_line(item);
  return text;
}

std::string model_text(const nlohmann::json& header, const std::string& path) {
  const auto& skeleton = header.at("skeleton");
  const auto& patches = header.at("patches");
  Table table({"bone", "method", "surface", "columns x rows", "at", "seams at head", "at tail"});
  long texels = 0;
  for (std::size_t i = 0; i < patches.size(); ++i) {
    const auto& patch = patches.at(i);
    const auto r = patch.at("rectangle").get<std::array<int, 4>>();
    texels += static_cast<long>(r[2]) * r[3];
    const auto seams = [&patch](const char* end) {
      const std::size_t count = patch.at("ends").at(end).size();
      return count == 0 ? std::string("pole") : fmt::format("{}", count);
    };
    table.add({skeleton.at("bones").at(i).at("name").get<std::string>(), patch.at("method").get<std::string>(),
               patch.at("topology").get<std::string>(), fmt::format("{} x {}", r[2], r[3]),
               fmt::format("{}, {}", r[0], r[1]), seams("head"), seams("tail")});
  }
  std::size_t samples = 0;
  for (const auto& arc : header.at("arcs")) samples += arc.at("samples").size() / 2;
  double diagonal = header.at("diagonal").get<double>();
  if (header.contains("frame")) diagonal *= header.at("frame").at("scale").get<double>();
  const int width = header.at("texture").at("width").get<int>(), height = header.at("texture").at("height").get<int>();
  std::string text = fmt::format(
      "{}: model, format version {}\n{} x {} texels, {:.1f} % used; {} nodes, {} bones, genus {}; {} seams with {} "
      "samples, {} corners; diagonal of "
      "the input "
      "{:.6g}\n\n{}",
      path, header.at("version").dump(), width, height, 100.0 * static_cast<double>(texels) / width / height,
      skeleton.at("nodes").size(), skeleton.at("bones").size(), header.at("genus").get<int>(), header.at("arcs").size(),
      samples, header.at("corners").size(), diagonal, table.text());
  if (header.contains("encoder")) {
    text += "\nencoder\n";
    for (const auto& [key, value] : header.at("encoder").items())
      text += fmt::format("  {}: {}\n", key, in_one_line(value));
  }
  return text;
}

void inspect_mesh(const Arguments& arguments) {
  const TriangleMesh mesh = load_mesh(arguments.file);
  const ManifoldReport report = measure_manifold(mesh);
  const BoundingBox box = bounding_box(mesh);
  const bool is_closed = report.is_closed_manifold();
  const double area = surface_area(mesh);
  const std::size_t thin = thin_triangles(mesh).size();
  Json json{{"vertices", report.vertices},
            {"edges", report.edges},
            {"triangles", report.triangles},
            {"components", report.components},
            {"closed_manifold", is_closed},
            {"boundary_edges", report.boundary_edges.size()},
            {"non_manifold_edges", report.non_manifold_edges.size()},
            {"misoriented_edges", report.misoriented_edges.size()},
            {"non_manifold_vertices", report.non_manifold_vertices.size()},
            {"unreferenced_vertices", report.unreferenced_vertices.size()},
            {"non_finite_vertices", report.non_finite_vertices.size()},
            {"degenerate_triangles", report.degenerate_triangles.size()},
            {"thin_triangles", thin},
            {"diagonal", box.diagonal()},
            {"lower", {box.lower.x(), box.lower.y(), box.lower.z()}},
            {"upper", {box.upper.x(), box.upper.y(), box.upper.z()}},
            {"area", area}};
  std::string text =
      fmt::format("{}: mesh\n{} vertices, {} edges, {} triangles, {} component{}; diagonal {:.6g}, area {:.6g}\n",
                  arguments.file, report.vertices, report.edges, report.triangles, report.components,
                  report.components == 1 ? "" : "s", box.diagonal(), area);
  if (is_closed) {
    json["genus"] = report.genus;
    json["volume"] = signed_volume(mesh);
    text += fmt::format("closed, oriented, 2-manifold; genus {}, volume {:.6g}\n", report.genus, signed_volume(mesh));
  } else {
    json["genus"] = nullptr;
    text += "not a closed, oriented 2-manifold:\n";
  }
  const auto say = [&text](std::size_t count, const char* what) {
    if (count > 0) text += fmt::format("  {} {}\n", count, what);
  };
  say(report.boundary_edges.size(), "edges with one triangle only");
  say(report.non_manifold_edges.size(), "edges with more than two triangles");
  say(report.misoriented_edges.size(), "edges whose triangles face opposite sides");
  say(report.non_manifold_vertices.size(), "vertices where surfaces only touch");
  say(report.unreferenced_vertices.size(), "vertices without a triangle");
  say(report.non_finite_vertices.size(), "vertices that are not finite numbers");
  say(report.degenerate_triangles.size(), "triangles with a vertex twice");
  text += fmt::format("{} thin triangles, with an angle below 5 degrees ({:.2f} %)\n", thin,
                      100.0 * static_cast<double>(thin) / static_cast<double>(std::max(report.triangles, 1)));
  if (arguments.has_self_intersections) {
    const long pairs = count_self_intersections(mesh);
    json["self_intersections"] = pairs;
    text += fmt::format("{} pairs of triangles that intersect\n", pairs);
  }
  print(arguments.json, text);
  write_json(arguments.json, json);
}

void run(const Arguments& arguments) {
  if (is_mesh_file(arguments.file)) {
    inspect_mesh(arguments);
    return;
  }
  if (arguments.has_self_intersections)
    throw InputError(
        fmt::format("{}: --self-intersections is for meshes; reconstruct the model first", arguments.file));
  const nlohmann::json header = read_model_header(arguments.file);
  std::string levels;
  const std::vector<std::array<int, 2>> sizes = read_model_levels(arguments.file);
  for (std::size_t level = 1; level < sizes.size(); ++level)
    levels += fmt::format("level {}: {} x {}\n", level, sizes[level][0], sizes[level][1]);
  if (arguments.json != "-") print(arguments.json, model_text(header, arguments.file) + levels);
  write_json(arguments.json, Json(header));
}

}  // namespace

void add_inspect_command(CLI::App& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand("inspect", "Say what a model, or a mesh, consists of");
  declare_input(command,
                command.add_option("FILE", arguments->file,
                                   "model (.skx.exr, .skx), or mesh (.obj, .ply, .off, .stl, .glb, .gltf, .vrm)"))
      ->required();
  command.add_flag("--self-intersections", arguments->has_self_intersections,
                   "of a mesh: count the pairs of triangles that intersect");
  add_json_option(command, arguments->json);
  command.footer(
      "Examples:\n"
      "  skeletex inspect bear.skx.exr\n"
      "  skeletex inspect bear.skx.exr --json - | jq '.patches[0]'\n"
      "  skeletex inspect bear.ply\n"
      "The JSON of a model is its header as it stands in the file (docs/file-formats.md); the whole file is "
      "read and checked. Lengths are in the mesh's units.");
  command.callback([arguments] { run(*arguments); });
}

}  // namespace skeletex::cli
