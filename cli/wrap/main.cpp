// SPDX-License-Identifier: GPL-3.0-or-later
// A program of its own, as CGAL's alpha wrapping and Boolean operations are GPL: skeletex runs it for --close.
#include <CGAL/Exact_predicates_exact_constructions_kernel.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/connected_components.h>
#include <CGAL/Polygon_mesh_processing/corefinement.h>
#include <CGAL/Polygon_mesh_processing/measure.h>
#include <CGAL/Polygon_mesh_processing/orientation.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/alpha_wrap_3.h>
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <utility>
#include <vector>

#include "skeletex/io/mesh_file.h"
#include "skeletex/model/error.h"

namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Surface = CGAL::Surface_mesh<Kernel::Point_3>;
using ExactPoint = CGAL::Exact_predicates_exact_constructions_kernel::Point_3;
using ExactSurface = CGAL::Surface_mesh<ExactPoint>;
namespace pmp = CGAL::Polygon_mesh_processing;

struct Arguments {
  std::string mesh, output;
  double detail = 0.008, offset = 0;
  bool is_union = false;
};

template <class AnySurface>
skeletex::TriangleMesh triangle_mesh(const AnySurface& surface) {
  skeletex::TriangleMesh result;
  for (const auto vertex : surface.vertices()) {
    const auto& p = surface.point(vertex);
    result.positions.emplace_back(CGAL::to_double(p.x()), CGAL::to_double(p.y()), CGAL::to_double(p.z()));
  }
  for (const auto face : surface.faces()) {
    skeletex::Triangle triangle{};
    int corner = 0;
    for (const auto vertex : surface.vertices_around_face(surface.halfedge(face)))
      triangle[corner++] = static_cast<int>(vertex.idx());
    result.triangles.push_back(triangle);
  }
  return result;
}

/// The closed parts of a mesh, oriented outwards, the largest first.
std::vector<ExactSurface> parts_of(const skeletex::TriangleMesh& mesh) {
  std::vector<ExactPoint> points;
  for (const skeletex::Vec3& p : mesh.positions) points.emplace_back(p.x(), p.y(), p.z());
  ExactSurface whole;
  pmp::polygon_soup_to_polygon_mesh(points, mesh.triangles, whole);
  std::vector<ExactSurface> parts;
  pmp::split_connected_components(whole, parts);
  for (ExactSurface& part : parts) {
    if (!CGAL::is_closed(part)) throw skeletex::InputError("a part is not closed");
    if (!pmp::is_outward_oriented(part)) pmp::reverse_face_orientations(part);
  }
  std::vector<std::pair<double, std::size_t>> sizes;
  for (std::size_t i = 0; i < parts.size(); ++i) sizes.emplace_back(-CGAL::to_double(pmp::volume(parts[i])), i);
  std::sort(sizes.begin(), sizes.end());
  std::vector<ExactSurface> sorted;
  for (const auto& [size, i] : sizes) sorted.push_back(std::move(parts[i]));
  return sorted;
}

/// What is inside any of the closed parts of a mesh.
skeletex::TriangleMesh united(const skeletex::TriangleMesh& mesh) {
  std::vector<ExactSurface> parts = parts_of(mesh);
  if (parts.empty()) throw skeletex::InputError("it has no triangles");
  ExactSurface& result = parts.front();
  for (std::size_t i = 1; i < parts.size(); ++i)
    if (!pmp::corefine_and_compute_union(result, parts[i], result, CGAL::parameters::throw_on_self_intersection(true)))
      throw skeletex::InputError("the union of the parts has an edge of more than two triangles");
  result.collect_garbage();
  return triangle_mesh(result);
}

skeletex::TriangleMesh wrapped(const skeletex::TriangleMesh& mesh, const Arguments& arguments) {
  const double diagonal = skeletex::bounding_box(mesh).diagonal();
  std::vector<Kernel::Point_3> points;
  for (const skeletex::Vec3& p : mesh.positions) points.emplace_back(p.x(), p.y(), p.z());
  const double offset = arguments.offset > 0 ? arguments.offset : arguments.detail / 20;
  Surface surface;
  CGAL::alpha_wrap_3(points, mesh.triangles, arguments.detail * diagonal, offset * diagonal, surface);
  return triangle_mesh(surface);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App program(
      "Wraps any triangles in a closed mesh (CGAL's alpha wrapping), or unites closed parts; skeletex runs it for "
      "--close.",
      "skeletex_wrap");
  Arguments arguments;
  program.add_option("MESH", arguments.mesh, "triangles of any kind")->required();
  program.add_option("-o,--output", arguments.output, "the closed mesh: .ply")->required();
  program.add_option("--detail", arguments.detail, "the smallest hollow that the wrap enters, in diagonals")
      ->check(CLI::Range(5e-4, 0.5))
      ->capture_default_str();
  program.add_option("--offset", arguments.offset, "how far it stays away, in diagonals (default: detail / 20)")
      ->check(CLI::Range(1e-6, 0.1));
  program.add_flag("--union", arguments.is_union,
                   "no wrap, but the union of the closed parts, exactly; none may intersect itself where another does");
  try {
    program.parse(argc, argv);
    const skeletex::TriangleMesh mesh = skeletex::read_mesh(arguments.mesh).mesh;
    skeletex::write_mesh(arguments.output, arguments.is_union ? united(mesh) : wrapped(mesh, arguments));
  } catch (const CLI::ParseError& error) {
    return program.exit(error) == 0 ? 0 : 2;
  } catch (const std::exception& error) {
    fmt::print(stderr, "error: {}\n", error.what());
    return 1;
  }
}
