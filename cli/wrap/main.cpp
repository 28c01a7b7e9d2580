// SPDX-License-Identifier: GPL-3.0-or-later
// A program of its own, as CGAL's alpha wrapping is GPL: skeletex runs it for --close.
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/alpha_wrap_3.h>
#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "skeletex/io/mesh_file.h"
#include "skeletex/model/error.h"

namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Surface = CGAL::Surface_mesh<Kernel::Point_3>;

struct Arguments {
  std::string mesh, output;
  double detail = 0.008, offset = 0;
};

skeletex::TriangleMesh wrapped(const skeletex::TriangleMesh& mesh, const Arguments& arguments) {
  const double diagonal = skeletex::bounding_box(mesh).diagonal();
  std::vector<Kernel::Point_3> points;
  for (const skeletex::Vec3& p : mesh.positions) points.emplace_back(p.x(), p.y(), p.z());
  const double offset = arguments.offset > 0 ? arguments.offset : arguments.detail / 20;
  Surface surface;
  CGAL::alpha_wrap_3(points, mesh.triangles, arguments.detail * diagonal, offset * diagonal, surface);
  skeletex::TriangleMesh result;
  for (const auto vertex : surface.vertices()) {
    const auto& p = surface.point(vertex);
    result.positions.emplace_back(p.x(), p.y(), p.z());
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

}  // namespace

int main(int argc, char** argv) {
  CLI::App program("Wraps any triangles in a closed mesh (CGAL's alpha wrapping); skeletex runs it for --close.",
                   "skeletex_wrap");
  Arguments arguments;
  program.add_option("MESH", arguments.mesh, "triangles of any kind")->required();
  program.add_option("-o,--output", arguments.output, "the closed mesh: .ply")->required();
  program.add_option("--detail", arguments.detail, "the smallest hollow that the wrap enters, in diagonals")
      ->check(CLI::Range(5e-4, 0.5))
      ->capture_default_str();
  program.add_option("--offset", arguments.offset, "how far it stays away, in diagonals (default: detail / 20)")
      ->check(CLI::Range(1e-6, 0.1));
  try {
    program.parse(argc, argv);
    skeletex::write_mesh(arguments.output, wrapped(skeletex::read_mesh(arguments.mesh).mesh, arguments));
  } catch (const CLI::ParseError& error) {
    return program.exit(error) == 0 ? 0 : 2;
  } catch (const std::exception& error) {
    fmt::print(stderr, "error: {}\n", error.what());
    return 1;
  }
}
