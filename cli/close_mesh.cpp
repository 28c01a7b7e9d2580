// SPDX-License-Identifier: MIT
#include "close_mesh.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <cstdlib>
#include <filesystem>
#include <type_traits>

#include "files.h"
#include "program_path.h"
#include "runner/process.h"
#include "skeletex/analysis/manifold.h"
#include "skeletex/close/fill_holes.h"
#include "skeletex/io/gltf/weld.h"
#include "skeletex/io/mesh_file.h"
#include "skeletex/model/error.h"

namespace skeletex::cli {
namespace {

namespace fs = std::filesystem;

/// Vertices nearer to each other are one where a mesh is not closed; diagonals.
constexpr double kSameVertex = 1e-6;

/// A folder for the files that the two programs exchange.
class WorkFolder {
 public:
  WorkFolder() {
    std::string pattern = (fs::temp_directory_path() / "skeletex-close-XXXXXX").string();
    if (::mkdtemp(pattern.data()) == nullptr)
      throw IoError(fmt::format("no folder for temporary files can be made in {}", fs::temp_directory_path().string()));
    path_ = pattern;
  }
  ~WorkFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  WorkFolder(const WorkFolder&) = delete;
  WorkFolder& operator=(const WorkFolder&) = delete;
  fs::path operator/(const char* name) const { return path_ / name; }

 private:
  fs::path path_;
};

/// Vertices in one place become one. Corners keep the values that they have.
void weld(MeshParts& parts) {
  const std::vector<int> targets =
      weld_targets(parts.mesh.positions, kSameVertex * bounding_box(parts.mesh).diagonal());
  for (auto* corners : {&parts.attributes.normals.corners, &parts.attributes.colours.corners,
                        &parts.attributes.texture_coordinates.corners})
    if (corners->empty()) *corners = parts.mesh.triangles;
  if (parts.attributes.normals.values.empty()) parts.attributes.normals.corners.clear();
  if (parts.attributes.colours.values.empty()) parts.attributes.colours.corners.clear();
  if (parts.attributes.texture_coordinates.values.empty()) parts.attributes.texture_coordinates.corners.clear();
  for (Triangle& t : parts.mesh.triangles)
    for (int& corner : t) corner = targets[corner];
}

/// Takes vertices away that no triangle has.
void remove_unused_vertices(MeshParts& parts) {
  std::vector<int> number(parts.mesh.positions.size(), -1);
  for (const Triangle& t : parts.mesh.triangles)
    for (const int corner : t) number[corner] = 0;
  std::vector<std::size_t> kept;
  for (std::size_t v = 0; v < number.size(); ++v)
    if (number[v] == 0) number[v] = static_cast<int>(kept.size()), kept.push_back(v);
  const auto take = [&](auto& values) {
    if (values.empty()) return;
    std::remove_reference_t<decltype(values)> left;
    for (const std::size_t v : kept) left.push_back(std::move(values[v]));
    values = std::move(left);
  };
  take(parts.mesh.positions);
  take(parts.weights);
  for (VertexNumbers& numbers : parts.attributes.numbers) take(numbers.values);
  for (Triangle& t : parts.mesh.triangles)
    for (int& corner : t) corner = number[corner];
}

std::string wrap_program() {
  const fs::path beside = fs::path(program_path()).parent_path() / "skeletex_wrap";
  return fs::is_regular_file(beside) ? beside.string() : "skeletex_wrap";
}

Json wrap(MeshParts& parts, const CloseOptions& options) {
  const WorkFolder folder;
  write_mesh(folder / "mesh.ply", parts.mesh);
  ProcessResult result;
  try {
    result = run_process(wrap_program(),
                         {(folder / "mesh.ply").string(), "-o", (folder / "wrap.ply").string(), "--detail",
                          fmt::format("{}", options.detail)},
                         {}, folder / "errors.txt");
  } catch (const IoError&) {
    result.exit_code = 127;
  }
  if (result.exit_code == 127)
    throw InputError(
        "--close: the program skeletex_wrap, which wraps such meshes, is neither beside skeletex nor on the PATH; it "
        "is "
        "built where CGAL is installed");
  if (result.exit_code != 0) throw InputError(fmt::format("--close: the mesh could not be wrapped: {}", result.errors));
  TriangleMesh wrapped = read_mesh(folder / "wrap.ply").mesh;
  const double diagonal = bounding_box(parts.mesh).diagonal();
  const VertexDistances there = vertex_distances(parts.mesh, wrapped), back = vertex_distances(wrapped, parts.mesh);
  CarriedOver carried =
      carry_over(parts.mesh, build_triangle_tree(parts.mesh), parts.attributes, parts.weights, wrapped);
  const int components = measure_manifold(wrapped).components;
  warn(
      fmt::format("wrapped in a closed mesh of {} triangles. Its distance from the file's, in diagonals: {:.2g} mean, "
                  "{:.2g} at most; vertices of the file are up to {:.2g} away, inner parts among them. A smaller "
                  "--close-detail (now {:.3g}) comes nearer and takes longer",
                  wrapped.triangles.size(), back.mean / diagonal, back.largest / diagonal, there.largest / diagonal,
                  options.detail));
  if (components > 1)
    warn(fmt::format("the wrap has {} parts that do not touch; a larger --close-detail joins them", components));
  parts = {std::move(wrapped), std::move(carried.attributes), std::move(carried.weights)};
  return {{"method", "wrap"},
          {"triangles", parts.mesh.triangles.size()},
          {"components", components},
          {"distance", {{"mean", back.mean / diagonal}, {"max", back.largest / diagonal}}},
          {"distance_of_vertices", {{"mean", there.mean / diagonal}, {"max", there.largest / diagonal}}}};
}

}  // namespace

void add_close_options(CLI::App& command, CloseOptions& options) {
  CLI::Option* close = command.add_flag(
      "--close", options.is_on,
      "make the mesh closed: small holes are filled; what has large holes or several parts is wrapped");
  command
      .add_option(
          "--close-detail", options.detail,
          "hollows narrower than this are not entered by the wrap, in diagonals, 0.0005 to 0.5 (default: 0.008)")
      ->check(number_in(0.0005, 0.5))
      ->type_name("X")
      ->needs(close);
}

Json close_mesh(MeshParts& parts, const CloseOptions& options) {
  const auto is_closed = [&] {
    const ManifoldReport report = measure_manifold(parts.mesh);
    return report.is_closed_manifold() && report.components == 1;
  };
  if (is_closed()) {
    spdlog::info("--close: the mesh is closed");
    return {{"method", "none"}};
  }
  for (const Vec3& p : parts.mesh.positions)
    if (!p.allFinite()) throw InputError("--close: a coordinate is not finite; take such vertices out first");
  weld(parts);
  TriangleMesh filled = parts.mesh;
  const FillResult result = fill_holes(filled);
  if (!result.obstacle.empty()) {
    spdlog::info("--close: {}, so the mesh is wrapped", result.obstacle);
    return wrap(parts, options);
  }
  std::string places;
  std::size_t listed = 0;
  for (const Hole& hole : result.holes)
    if (++listed <= 3)
      places += fmt::format("{}{} edges around {}", places.empty() ? "" : ", ", hole.loop.size(), text_of(hole.centre));
  spdlog::info("--close: filled {} hole{}: {}{}", result.holes.size(), result.holes.size() == 1 ? "" : "s", places,
               result.holes.size() > 3 ? ", ..." : "");
  parts.attributes = with_triangles(parts.attributes, parts.mesh.triangles, filled.triangles, result.origins);
  parts.mesh = std::move(filled);
  remove_unused_vertices(parts);
  return {{"method", "fill"}, {"holes", result.holes.size()}};
}

}  // namespace skeletex::cli
