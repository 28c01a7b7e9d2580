// SPDX-License-Identifier: MIT
#include "close_mesh.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <filesystem>
#include <optional>
#include <type_traits>

#include "files.h"
#include "program_path.h"
#include "runner/process.h"
#include "runner/work_folder.h"
#include "skeletex/analysis/manifold.h"
#include "skeletex/close/cut_handles.h"
#include "skeletex/close/fill_holes.h"
#include "skeletex/close/manifold_parts.h"
#include "skeletex/io/gltf/weld.h"
#include "skeletex/io/mesh_file.h"
#include "skeletex/model/error.h"

namespace skeletex::cli {
namespace {

namespace fs = std::filesystem;

/// Vertices nearer to each other are one where a mesh is not closed; diagonals.
constexpr double kSameVertex = 1e-6;
constexpr double kDetail = 0.008;     // of a wrap, diagonals
constexpr double kSmallPart = 0.005;  // of the area
constexpr double kBody = 0.9;         // of the area: a part that is nearly everything
constexpr int kMostUnited = 300;      // parts
constexpr double kHandles = 0.08;     // of a wrap or union: longest loop around a handle that is cut, diagonals
constexpr double kRigHandles = 0.3;   // the same of a rig

/// Values of vertices become those of corners, so that vertices can be joined and split.
void name_corners(MeshParts& parts) {
  const auto name = [&](auto& list) {
    if (!list.empty() && list.corners.empty()) list.corners = parts.mesh.triangles;
  };
  name(parts.attributes.normals);
  name(parts.attributes.colours);
  name(parts.attributes.texture_coordinates);
}

/// Vertices in one place become one. Corners keep the values that they have.
void weld(MeshParts& parts) {
  const std::vector<int> targets =
      weld_targets(parts.mesh.positions, kSameVertex * bounding_box(parts.mesh).diagonal());
  name_corners(parts);
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

/// A wrap of a mesh.
struct Wrap {
  double detail = 0;
  MeshParts parts;  ///< the mesh alone
  ManifoldReport report;
  int removed = 0;  ///< components that were next to nothing
};

/// Runs skeletex_wrap on the mesh in the folder.
/// \return its result; nothing, and what it says, where there is none
std::optional<TriangleMesh> run_wrap(const WorkFolder& folder, const std::vector<std::string>& options,
                                     std::string& errors) {
  std::vector<std::string> arguments{(folder.path() / "mesh.ply").string(), "-o",
                                     (folder.path() / "wrap.ply").string()};
  arguments.insert(arguments.end(), options.begin(), options.end());
  ProcessResult result;
  try {
    result = run_process(wrap_program(), arguments, {}, folder.path() / "errors.txt");
  } catch (const IoError&) {
    result.exit_code = 127;
  }
  if (result.exit_code == 127)
    throw InputError(
        "--close: the program skeletex_wrap, which wraps such meshes, is neither beside skeletex nor on the PATH; it "
        "is built where CGAL is installed");
  errors = result.errors;
  if (errors.starts_with("error: ")) errors.erase(0, std::string("error: ").size());
  if (result.exit_code != 0) return {};
  return read_mesh(folder.path() / "wrap.ply").mesh;
}

Wrap wrap_with(double detail, const WorkFolder& folder) {
  std::string errors;
  std::optional<TriangleMesh> mesh = run_wrap(folder, {"--detail", fmt::format("{}", detail)}, errors);
  if (!mesh) throw InputError(fmt::format("--close: the mesh could not be wrapped: {}", errors));
  Wrap wrap{detail, {std::move(*mesh), {}, {}}, {}, 0};
  wrap.removed = remove_small_components(wrap.parts.mesh, kSmallPart);  // a lone triangle gets a wrap of its own
  remove_unused_vertices(wrap.parts);
  wrap.report = measure_manifold(wrap.parts.mesh);
  return wrap;
}

void warn_of_small_parts(int count) {
  if (count > 0)
    warn(fmt::format("{} part{} with less than {} % of the area {} left out", count, count == 1 ? "" : "s",
                     100 * kSmallPart, count == 1 ? "is" : "are"));
}

/// Takes the union of closed parts in place of a mesh, where it is one closed body.
/// \param filled  the mesh with its holes filled
/// \return for the JSON; null: it is not
Json take_union(MeshParts& parts, const TriangleMesh& filled, const WorkFolder& folder) {
  const ManifoldReport before = measure_manifold(filled);
  if (!before.is_closed_manifold() || before.components > kMostUnited) return {};
  std::string errors;
  std::optional<TriangleMesh> mesh = run_wrap(folder, {"--union"}, errors);
  if (!mesh) {
    spdlog::info("--close: its parts have no union: {}", errors);
    return {};
  }
  const int left_out = remove_small_components(*mesh, kSmallPart);
  MeshParts united{std::move(*mesh), {}, {}};
  remove_unused_vertices(united);
  const ManifoldReport after = measure_manifold(united.mesh);
  if (!after.is_closed_manifold() || after.components != 1) {
    spdlog::info("--close: the union of its parts is no single closed body");
    return {};
  }
  spdlog::info("--close: the {} parts are united in a mesh of {} triangles", before.components,
               united.mesh.triangles.size());
  warn_of_small_parts(left_out);
  CarriedOver carried =
      carry_over(parts.mesh, build_triangle_tree(parts.mesh), parts.attributes, parts.weights, united.mesh);
  parts = {std::move(united.mesh), std::move(carried.attributes), std::move(carried.weights)};
  return {{"method", "union"}, {"parts", before.components}, {"triangles", parts.mesh.triangles.size()}};
}

Json take_wrap(MeshParts& parts, const TriangleMesh& filled, Wrap wrap) {
  const TriangleMesh& wrapped = wrap.parts.mesh;
  const double diagonal = bounding_box(parts.mesh).diagonal();
  const VertexDistances there = distances_of_vertices(parts.mesh, wrapped),
                        back = distances_of_vertices(wrapped, filled);
  CarriedOver carried =
      carry_over(parts.mesh, build_triangle_tree(parts.mesh), parts.attributes, parts.weights, wrapped);
  warn(fmt::format(
      "wrapped in a closed mesh of {} triangles. Its distance from the file's, in diagonals: {:.2g} mean, "
      "{:.2g} at most; vertices of the file are up to {:.2g} away, inner parts among them. A smaller "
      "--close-detail (now {:.3g}) comes nearer and takes longer",
      wrapped.triangles.size(), back.mean / diagonal, back.largest / diagonal, there.largest / diagonal, wrap.detail));
  warn_of_small_parts(wrap.removed);
  if (wrap.report.components > 1)
    warn(fmt::format("the wrap has {} parts that do not touch; a larger --close-detail joins them",
                     wrap.report.components));
  parts = {std::move(wrap.parts.mesh), std::move(carried.attributes), std::move(carried.weights)};
  return {{"method", "wrap"},
          {"detail", wrap.detail},
          {"triangles", parts.mesh.triangles.size()},
          {"components", wrap.report.components},
          {"genus", wrap.report.genus},
          {"distance", {{"mean", back.mean / diagonal}, {"max", back.largest / diagonal}}},
          {"distance_of_vertices", {{"mean", there.mean / diagonal}, {"max", there.largest / diagonal}}}};
}

/// Per new vertex what its original has.
void copy_vertices(MeshParts& parts, const std::vector<int>& copies) {
  for (const int v : copies) {
    if (!parts.weights.empty()) parts.weights.push_back(parts.weights[v]);
    for (VertexNumbers& numbers : parts.attributes.numbers) numbers.values.push_back(numbers.values[v]);
  }
}

/// \return fillings that intersect the surface
std::size_t say_filled(const FillResult& filling, double diagonal) {
  std::string places;
  std::size_t listed = 0, intersecting = 0;
  for (const Hole& hole : filling.holes) {
    intersecting += hole.is_intersecting ? 1 : 0;
    if (++listed <= 3)
      places += fmt::format("{}{} edges around {}, {:.1f} % of the diagonal across", places.empty() ? ": " : "; ",
                            hole.loop.size(), text_of(hole.centre), 100 * hole.size / diagonal);
  }
  const std::size_t count = filling.holes.size();
  if (filling.turned > 0) spdlog::info("--close: triangles turned to agree with most others: {}", filling.turned);
  if (count == 0 && filling.turned == 0)
    spdlog::info("--close: the mesh has no holes once vertices in one place are one");
  if (count > 0)
    spdlog::info("--close: filled {} hole{}{}{}", count, count == 1 ? "" : "s", places, count > 3 ? "; ..." : "");
  if (!filling.copies.empty())
    spdlog::info("--close: {} added where sheets met in one vertex alone",
                 filling.copies.size() == 1 ? "1 vertex was" : fmt::format("{} vertices were", filling.copies.size()));
  if (intersecting > 0)
    warn(fmt::format("{} of the fillings intersect{} the surface", intersecting, intersecting == 1 ? "s" : ""));
  if (filling.removed > 0)
    warn(fmt::format("{} triangles at non-manifold or misoriented edges are taken away", filling.removed));
  return intersecting;
}

/// Triangles with the vertices that there were before some were copied.
std::vector<Triangle> with_originals(const TriangleMesh& mesh, const std::vector<int>& copies) {
  std::vector<Triangle> triangles = mesh.triangles;
  const int first = static_cast<int>(mesh.positions.size() - copies.size());
  for (Triangle& t : triangles)
    for (int& corner : t)
      if (corner >= first) corner = copies[corner - first];
  return triangles;
}

/// Takes a mesh whose holes are filled.
Json take_filled(MeshParts& parts, TriangleMesh filled, const FillResult& filling) {
  const std::size_t intersecting = say_filled(filling, bounding_box(filled).diagonal());
  copy_vertices(parts, filling.copies);
  const std::vector<Triangle> before = std::move(parts.mesh.triangles), after = with_originals(filled, filling.copies);
  parts.attributes = with_triangles(parts.attributes, before, after, filling.origins);
  if (filling.turned > 0) flip_inward_normals(filled, before, after, filling.origins, parts.attributes.normals);
  parts.mesh = std::move(filled);
  remove_unused_vertices(parts);
  return {{"method", "fill"},
          {"holes", filling.holes.size()},
          {"intersecting", intersecting},
          {"turned_triangles", filling.turned},
          {"removed_triangles", filling.removed},
          {"split_vertices", filling.copies.size()}};
}

/// Says which handles were cut.
/// \return for the JSON
Json say_cuts(const HandleCuts& cuts, double diagonal, int handles_left) {
  Json loops = Json::array();
  std::string places;
  for (const CutLoop& loop : cuts.loops) {
    if (loops.size() < 3)
      places += fmt::format("{}around {}, {:.2g} diagonals long", places.empty() ? "" : "; ", text_of(loop.centre),
                            loop.length / diagonal);
    loops.push_back(
        {{"centre", {loop.centre.x(), loop.centre.y(), loop.centre.z()}}, {"length", loop.length / diagonal}});
  }
  const std::size_t count = cuts.loops.size();
  if (cuts.shortest_left > 0)
    spdlog::info(
        "--close: {} handle{} left; the shortest loop found around one is {:.2g} diagonals long "
        "(--close-handles)",
        handles_left, handles_left == 1 ? " is" : "s are", cuts.shortest_left / diagonal);
  if (count > 0)
    warn(fmt::format("{} handle{} cut off and filled: along {}loop{} {}{}", count, count == 1 ? " is" : "s are",
                     count == 1 ? "a " : "", count == 1 ? "" : "s", places, count > 3 ? "; ..." : ""));
  if (cuts.is_stuck) warn("a handle could not be cut off, as its rim has no filling");
  return loops;
}

}  // namespace

void add_close_options(CLI::App& command, CloseOptions& options) {
  CLI::Option* close = command.add_flag(
      "--close", options.is_on,
      "make the mesh closed: holes are filled, closed parts that overlap are united; all else is wrapped");
  command
      .add_option(
          "--close-detail", options.detail,
          "hollows narrower than this are not entered by the wrap, in diagonals, 0.0005 to 0.5 (default: 0.008)")
      ->check(number_in(0.0005, 0.5))
      ->type_name("X")
      ->needs(close);
  command
      .add_option(
          "--close-handles", options.handles,
          "narrow tunnels are plugged, and thin bridges cut, where a loop around them is no longer than this, in "
          "diagonals, 0 to 2 (default: 0; 0.08 for a union or a wrap, 0.3 for a rig; 2 where no skeleton works)")
      ->check(number_in(0, kLongestHandleLoop))
      ->type_name("X")
      ->needs(close);
}

namespace {

/// Makes it closed and of one part, as far as that goes.
Json fill_or_wrap(MeshParts& parts, const CloseOptions& options) {
  for (const Vec3& p : parts.mesh.positions)
    if (!p.allFinite()) throw InputError("--close: a coordinate is not finite; take such vertices out first");
  weld(parts);
  TriangleMesh filled = parts.mesh;
  FillResult filling = fill_holes(filled);
  if (filling.obstacle.empty()) return take_filled(parts, std::move(filled), filling);
  const WorkFolder folder;
  write_mesh(folder.path() / "mesh.ply", filled);
  if (!options.detail)
    if (Json json = take_union(parts, filled, folder); !json.is_null()) return json;
  spdlog::info("--close: {}, so the mesh is wrapped", filling.obstacle);
  Wrap wrap = wrap_with(options.detail.value_or(kDetail), folder);
  if (!options.detail && wrap.report.genus > 0) {
    TriangleMesh body = filled;
    const double share = keep_largest_component(body, filling.origins);
    if (share > kBody && measure_manifold(body).genus < wrap.report.genus) {
      warn(fmt::format(
          "the wrap has {} handle{}, as parts nearly touch; the largest part, with {:.1f} % of the area, is "
          "taken alone instead. Other parts are left out; --close-detail wraps them all",
          wrap.report.genus, wrap.report.genus == 1 ? "" : "s", 100 * share));
      return take_filled(parts, std::move(body), filling);
    }
  }
  return take_wrap(parts, filled, std::move(wrap));
}

}  // namespace

Json cut_handles_off(MeshParts& parts, double longest) {
  const double diagonal = bounding_box(parts.mesh).diagonal();
  TriangleMesh cut = parts.mesh;
  const HandleCuts cuts = cut_handles(cut, longest * diagonal);
  if (!cuts.loops.empty()) {
    name_corners(parts);
    copy_vertices(parts, cuts.copies);
    parts.attributes =
        with_triangles(parts.attributes, parts.mesh.triangles, with_originals(cut, cuts.copies), cuts.origins);
    parts.mesh = std::move(cut);
  }
  return say_cuts(cuts, diagonal, measure_manifold(parts.mesh).genus);
}

Json close_mesh(MeshParts& parts, const CloseOptions& options) {
  const auto is_closed = [&] {
    const ManifoldReport report = measure_manifold(parts.mesh);
    return report.is_closed_manifold() && report.components == 1;
  };
  Json json{{"method", "none"}};
  if (is_closed())
    spdlog::info("--close: the mesh is closed");
  else
    json = fill_or_wrap(parts, options);
  const bool is_new = json["method"] == "wrap" || json["method"] == "union";
  const double longest = options.handles.value_or(options.has_rig ? kRigHandles : is_new ? kHandles : 0);
  json["cut_loops"] = longest > 0 && is_closed() ? cut_handles_off(parts, longest) : Json::array();
  return json;
}

}  // namespace skeletex::cli
