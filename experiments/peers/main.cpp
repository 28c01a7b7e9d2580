// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <Eigen/Geometry>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>

#include "bench/stages/subdivide.h"
#include "simplify.h"
#include "skeletex/analysis/manifold.h"
#include "skeletex/io/atomic_file.h"
#include "skeletex/io/mesh_file.h"
#include "skeletex/io/same_file.h"
#include "skeletex/model/error.h"

namespace {

struct Arguments {
  std::string method, mesh, output, like, json;
  int vertices = 0;
  double by = 0;
};

skeletex::TriangleMesh subdivided_to(skeletex::TriangleMesh mesh, int vertices) {
  while (static_cast<int>(mesh.positions.size()) < vertices) mesh = skeletex::subdivided(mesh);
  return mesh;
}

/// Moves each vertex along its normal.
/// \param offset  of a vertex, by its index, world units
template <class Offset>
skeletex::TriangleMesh displaced(skeletex::TriangleMesh mesh, const Offset& offset) {
  using namespace skeletex;
  std::vector<Vec3> normals(mesh.positions.size(), Vec3::Zero());
  for (const Triangle& t : mesh.triangles) {
    const Vec3 normal =
        (mesh.positions[t[1]] - mesh.positions[t[0]]).cross(mesh.positions[t[2]] - mesh.positions[t[0]]);
    for (const int corner : t) normals[corner] += normal;
  }
  for (std::size_t i = 0; i < normals.size(); ++i) mesh.positions[i] += offset(i) * normals[i].stableNormalized();
  return mesh;
}

/// The mesh with each vertex moved along its normal by up to so many diagonals, at random but the same each time.
skeletex::TriangleMesh with_noise(const skeletex::TriangleMesh& mesh, double amplitude) {
  std::mt19937 random(1);
  const double largest = amplitude * bounding_box(mesh).diagonal();
  return displaced(mesh, [&](std::size_t) { return (2.0 * random() / std::mt19937::max() - 1) * largest; });
}

/// What a scanner makes of it: every triangle split into four, and bumps of up to so many diagonals, a hundredth of the
/// diagonal long.
skeletex::TriangleMesh scanned(const skeletex::TriangleMesh& mesh, double amplitude) {
  const double diagonal = bounding_box(mesh).diagonal(), wave = 2 * std::numbers::pi / (0.01 * diagonal);
  const skeletex::TriangleMesh dense = skeletex::subdivided(mesh);
  return displaced(dense, [&](std::size_t i) {
    const skeletex::Vec3 phase = wave * dense.positions[i] + skeletex::Vec3(0, 1, 2);
    return amplitude * diagonal * std::sin(phase.x()) * std::sin(phase.y()) * std::sin(phase.z());
  });
}

/// Methods whose --by is an amount of their own.
bool has_own_amount(const std::string& method) {
  return method == "noise" || method == "scan" || method == "turn" || method == "scale";
}

skeletex::TriangleMesh turned(skeletex::TriangleMesh mesh, double degrees) {
  const Eigen::AngleAxis<double> turn(degrees * std::numbers::pi / 180, skeletex::Vec3(1, 2, 3).normalized());
  for (skeletex::Vec3& position : mesh.positions) position = turn * position;
  return mesh;
}

skeletex::TriangleMesh scaled(skeletex::TriangleMesh mesh, double factor) {
  for (skeletex::Vec3& position : mesh.positions) position *= factor;
  return mesh;
}

/// How many vertices the result is to have.
int wanted_vertices(const Arguments& arguments, int present) {
  if (!arguments.like.empty()) return static_cast<int>(skeletex::read_mesh(arguments.like).mesh.positions.size());
  if (arguments.vertices > 0) return arguments.vertices;
  if (!has_own_amount(arguments.method) && arguments.by > 0)
    return std::max(4, static_cast<int>(std::lround(arguments.by * present)));
  return present;
}

skeletex::TriangleMesh result_of(const Arguments& arguments, const skeletex::TriangleMesh& mesh, int wanted) {
  if (arguments.method == "decimate") return skeletex::decimate(mesh, wanted);
  if (arguments.method == "simplify") return skeletex::simplify(mesh, wanted);
  if (arguments.method == "remesh") return skeletex::remesh(mesh, wanted);
  if (arguments.method == "subdivide") return subdivided_to(mesh, wanted);
  if (arguments.method == "noise") return with_noise(mesh, arguments.by);
  if (arguments.method == "scan") return scanned(mesh, arguments.by);
  if (arguments.method == "turn") return turned(mesh, arguments.by);
  if (arguments.method == "scale") return scaled(mesh, arguments.by);
  return mesh;
}

void run(const Arguments& arguments) {
  using namespace skeletex;
  for (const std::string& output : {arguments.output, arguments.json})
    check_not_an_input(output, {arguments.mesh, arguments.like});
  const TriangleMesh mesh = read_mesh(arguments.mesh).mesh;
  const ManifoldReport report = measure_manifold(mesh);
  if (!report.is_closed_manifold())
    throw InputError(arguments.mesh + ": not a closed manifold; skeletex validate says where");
  const int present = static_cast<int>(mesh.positions.size());
  const int wanted = wanted_vertices(arguments, present);
  const bool can_grow = arguments.method == "remesh" || arguments.method == "subdivide";
  if (!can_grow && wanted > present)
    throw InputError(
        fmt::format("{} has {} vertices, {} cannot make {}", arguments.mesh, present, arguments.method, wanted));
  const auto begin = std::chrono::steady_clock::now();
  if (arguments.by == 0 && has_own_amount(arguments.method)) throw InputError(arguments.method + " needs --by");
  const TriangleMesh result = result_of(arguments, mesh, wanted);
  const double ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
  write_mesh(arguments.output, result);
  const nlohmann::ordered_json json{{"vertices", result.positions.size()},
                                    {"triangles", result.triangles.size()},
                                    {"ms", ms},
                                    {"closed_manifold", measure_manifold(result).is_closed_manifold()}};
  if (!arguments.json.empty()) write_text_atomically(arguments.json, json.dump(2) + "\n");
  fmt::print("{} vertices, {} triangles, {:.0f} ms: {}\n", result.positions.size(), result.triangles.size(), ms,
             arguments.output);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App program("Meshes with a given number of vertices by other libraries, for comparison with reconstructions.",
                   "peers");
  Arguments arguments;
  program
      .add_option("METHOD", arguments.method,
                  "decimate (OpenMesh, quadrics), simplify (meshoptimizer, quadrics), remesh (CGAL, isotropic), "
                  "subdivide (every triangle into four, at least as many as wanted), noise, scan (split into four, "
                  "with bumps), "
                  "turn, scale, or copy (as it is)")
      ->required()
      ->check(CLI::IsMember({"decimate", "simplify", "remesh", "subdivide", "noise", "scan", "turn", "scale", "copy"}));
  program.add_option("MESH", arguments.mesh, "closed triangle mesh")->required();
  program.add_option("-o,--output", arguments.output, "the result: .ply, .obj, .stl or .glb")->required();
  CLI::Option* vertices =
      program.add_option("--vertices", arguments.vertices, "how many vertices (default: as many as there are)")
          ->check(CLI::Range(4, 100000000));
  program.add_option("--like", arguments.like, "as many vertices as this mesh has")->excludes(vertices);
  program
      .add_option("--by", arguments.by,
                  "times as many vertices as there are; noise, scan: diagonals; turn: degrees; scale: the factor")
      ->check(CLI::PositiveNumber)
      ->excludes(vertices);
  program.add_option("--json", arguments.json, "write vertices, triangles, ms, closed_manifold to this file");
  try {
    program.parse(argc, argv);
    run(arguments);
  } catch (const CLI::ParseError& error) {
    return program.exit(error) == 0 ? 0 : 2;
  } catch (const std::exception& error) {
    fmt::print(stderr, "error: {}\n", error.what());
    return 1;
  }
}
