// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <tuple>

#include "skeletex/analysis/findings.h"
#include "skeletex/analysis/orientation.h"
#include "skeletex/geometry/union_find.h"

namespace skeletex {
namespace {

const char* plural(std::size_t count) { return count == 1 ? "" : "s"; }

Vec3 centre_of(const TriangleMesh& mesh, TriangleIndex triangle) {
  const auto [a, b, c] = mesh.triangles[triangle];
  return (mesh.positions[a] + mesh.positions[b] + mesh.positions[c]) / 3;
}

void find_holes(const TriangleMesh& mesh, const ManifoldReport& report, std::vector<Finding>& findings) {
  const auto& edges = report.boundary_edges;
  if (edges.empty()) return;
  UnionFind parts(static_cast<int>(mesh.positions.size()));
  for (const auto& [a, b] : edges) parts.unite(a, b);
  struct Loop {
    int edges = 0;
    Vec3 centre = Vec3::Zero();
  };
  std::map<int, Loop> loops;
  for (const auto& [a, b] : edges) {
    Loop& loop = loops[parts.find(a)];
    ++loop.edges;
    loop.centre += 0.5 * (mesh.positions[a] + mesh.positions[b]);
  }
  std::string places;
  int listed = 0;
  for (const auto& [root, loop] : loops) {
    if (listed++ == 3) {
      places += ", ...";
      break;
    }
    places +=
        fmt::format("{}{} edges around {}", places.empty() ? "" : ", ", loop.edges, text_of(loop.centre / loop.edges));
  }
  // Vertices in one place under two numbers make a mesh look closed that is not.
  std::map<std::tuple<double, double, double>, std::set<int>> at;
  for (const auto& [a, b] : edges)
    for (const int v : {a, b}) at[{mesh.positions[v].x(), mesh.positions[v].y(), mesh.positions[v].z()}].insert(v);
  std::size_t doubled = 0;
  for (const auto& [place, vertices] : at)
    if (vertices.size() > 1) doubled += vertices.size();
  std::string remedy = "fill the holes, or let `encode --close` do it";
  if (doubled > 0)
    remedy = fmt::format(
        "merge vertices that lie in the same place ({} of those at the boundary do), then fill what is left; `encode "
        "--close` does both",
        doubled);
  findings.push_back({Severity::kError, "closed",
                      fmt::format("the mesh is not closed: {} edge{} with only one triangle, in {} boundary loop{}: {}",
                                  edges.size(), plural(edges.size()), loops.size(), plural(loops.size()), places),
                      remedy});
}

void find_components(const TriangleMesh& mesh, const ManifoldReport& report, std::vector<Finding>& findings) {
  if (report.components <= 1) return;
  std::vector<bool> is_bad(mesh.triangles.size(), false);
  for (const int t : report.degenerate_triangles) is_bad[t] = true;
  UnionFind parts(static_cast<int>(mesh.positions.size()));
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    if (!is_bad[t])
      for (int k = 1; k < 3; ++k) parts.unite(mesh.triangles[t][0], mesh.triangles[t][k]);
  struct Component {
    int triangles = 0;
    Vec3 sum = Vec3::Zero();
  };
  std::map<int, Component> by_root;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (is_bad[t]) continue;
    Component& component = by_root[parts.find(mesh.triangles[t][0])];
    ++component.triangles;
    component.sum += centre_of(mesh, static_cast<int>(t));
  }
  std::vector<Component> components;
  for (const auto& [root, component] : by_root) components.push_back(component);
  std::stable_sort(components.begin(), components.end(),
                   [](const Component& a, const Component& b) { return a.triangles > b.triangles; });
  std::string list;
  for (std::size_t i = 0; i < components.size() && i < 5; ++i)
    list += fmt::format("{}{} triangle{} around {}", i ? ", " : "", components[i].triangles,
                        plural(components[i].triangles), text_of(components[i].sum / components[i].triangles));
  if (components.size() > 5) list += ", ...";
  findings.push_back(
      {Severity::kError, "components", fmt::format("the mesh has {} components: {}", components.size(), list),
       "join them to one body (`encode --close` does where they touch or nearly do), or keep the one that "
       "the skeleton lies in and remove the others"});
}

void find_turned_triangles(const TriangleMesh& mesh, const ManifoldReport& report, std::vector<Finding>& findings) {
  if (report.misoriented_edges.empty()) return;
  const auto& [a, b] = report.misoriented_edges.front();
  const std::string edges = fmt::format("{} edge{}, first between vertices {} and {} at {}",
                                        report.misoriented_edges.size(), plural(report.misoriented_edges.size()), a, b,
                                        text_of(0.5 * (mesh.positions[a] + mesh.positions[b])));
  const TriangleTurns turns = triangles_to_turn(mesh, report);
  if (!turns.is_orientable) {
    findings.push_back(
        {Severity::kError, "orientation",
         fmt::format("the surface has one side only, like a Moebius strip: its triangles cannot agree ({})", edges),
         "cut it open where it runs into its own back, and close the body, or let `encode --close` make one of it"});
    return;
  }
  const int first =
      static_cast<int>(std::find(turns.is_turned.begin(), turns.is_turned.end(), true) - turns.is_turned.begin());
  findings.push_back(
      {Severity::kError, "orientation",
       fmt::format("{} of {} triangles are turned against their neighbours ({}); the first is triangle {} at {}",
                   turns.count, mesh.triangles.size(), edges, first, text_of(centre_of(mesh, first))),
       "turn these triangles, so that all run counter-clockwise seen from outside, or let `encode --close` do it"});
}

/// Edges and vertices where more sheets of surface meet than one.
void find_sheets(const TriangleMesh& mesh, const ManifoldReport& report, std::vector<Finding>& findings) {
  if (!report.non_manifold_edges.empty()) {
    const auto& [a, b] = report.non_manifold_edges.front();
    findings.push_back(
        {Severity::kError, "manifold",
         fmt::format("{} edge{} more than two triangles; the first runs between vertices {} and {} at {}",
                     report.non_manifold_edges.size(), report.non_manifold_edges.size() == 1 ? " has" : "s have", a, b,
                     text_of(0.5 * (mesh.positions[a] + mesh.positions[b]))),
         "remove inner faces and doubled triangles, so that two are left at every edge, or let `encode --close` wrap "
         "it"});
  }
  if (!report.non_manifold_vertices.empty()) {
    const int v = report.non_manifold_vertices.front();
    findings.push_back(
        {Severity::kError, "manifold",
         fmt::format("at {} vert{} several sheets of surface touch in a point; the first is vertex {} at {}",
                     report.non_manifold_vertices.size(), report.non_manifold_vertices.size() == 1 ? "ex" : "ices", v,
                     text_of(mesh.positions[v])),
         "give every sheet a vertex of its own and move them apart, or let `encode --close` do it"});
  }
}

void find_flat_triangles(const TriangleMesh& mesh, const ManifoldReport& report, std::vector<Finding>& findings) {
  std::vector<int> flat;
  std::size_t next_bad = 0;
  for (int t = 0; t < report.triangles; ++t) {
    if (next_bad < report.degenerate_triangles.size() && report.degenerate_triangles[next_bad] == t) {
      ++next_bad;
      continue;
    }
    const auto [a, b, c] = mesh.triangles[t];
    const Vec3 &p = mesh.positions[a], &q = mesh.positions[b], &r = mesh.positions[c];
    const double longest = std::max({(q - p).squaredNorm(), (r - q).squaredNorm(), (p - r).squaredNorm()});
    if (2 * area_vector(mesh, mesh.triangles[t]).norm() <= 1e-12 * longest) flat.push_back(t);
  }
  if (!flat.empty())
    findings.push_back(
        {Severity::kWarning, "area",
         fmt::format("{} triangle{} no area; the first is triangle {} at {}", flat.size(),
                     flat.size() == 1 ? " has" : "s have", flat.front(), text_of(centre_of(mesh, flat.front()))),
         "collapse their shortest edges, or turn their longest ones"});
}

}  // namespace

void find_in_mesh(const TriangleMesh& mesh, const ManifoldReport& report, std::vector<Finding>& findings) {
  if (mesh.triangles.empty()) {
    findings.push_back({Severity::kError, "empty", "the mesh has no triangles", "give a mesh with a closed surface"});
    return;
  }
  if (!report.non_finite_vertices.empty()) {
    const int v = report.non_finite_vertices.front();
    const auto count = report.non_finite_vertices.size();
    findings.push_back({Severity::kError, "finite",
                        fmt::format("{} vert{} no finite position; the first is vertex {} at {}", count,
                                    count == 1 ? "ex has" : "ices have", v, text_of(mesh.positions[v])),
                        "give every vertex three finite numbers"});
  }
  if (!report.degenerate_triangles.empty()) {
    const int t = report.degenerate_triangles.front();
    const auto [a, b, c] = mesh.triangles[t];
    const auto is_outside = [&](int v) { return v < 0 || v >= report.vertices; };
    const bool is_index = is_outside(a) || is_outside(b) || is_outside(c);
    findings.push_back(
        {Severity::kError, "degenerate",
         fmt::format("{} triangle{} no triangle: a vertex twice, or one that does not exist; the first is triangle {} "
                     "(vertices {}, {}, {}{})",
                     report.degenerate_triangles.size(), report.degenerate_triangles.size() == 1 ? " is" : "s are", t,
                     a, b, c, is_index ? fmt::format("; there are {}", report.vertices) : ""),
         "remove these triangles"});
  }
  find_holes(mesh, report, findings);
  find_sheets(mesh, report, findings);
  find_components(mesh, report, findings);
  find_turned_triangles(mesh, report, findings);

  find_flat_triangles(mesh, report, findings);
  if (!report.unreferenced_vertices.empty()) {
    const int v = report.unreferenced_vertices.front();
    findings.push_back(
        {Severity::kWarning, "unreferenced",
         fmt::format("{} vert{} in no triangle; the first is vertex {} at {}", report.unreferenced_vertices.size(),
                     report.unreferenced_vertices.size() == 1 ? "ex is" : "ices are", v, text_of(mesh.positions[v])),
         "remove them; they are ignored"});
  }
}

TriangleMesh usable_surface(const TriangleMesh& mesh, const ManifoldReport& report) {
  TriangleMesh surface;
  surface.positions = mesh.positions;
  const TriangleTurns turns = triangles_to_turn(mesh, report);
  if (!turns.is_orientable) return {};
  std::vector<bool> is_bad(mesh.triangles.size(), false);
  for (const int t : report.degenerate_triangles) is_bad[t] = true;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (is_bad[t]) continue;
    auto [a, b, c] = mesh.triangles[t];
    if (!mesh.positions[a].allFinite() || !mesh.positions[b].allFinite() || !mesh.positions[c].allFinite()) continue;
    if (turns.is_turned[t]) std::swap(b, c);
    surface.triangles.push_back({a, b, c});
  }
  // Others would stretch the bounding box.
  if (!surface.triangles.empty())
    for (const int v : report.non_finite_vertices) surface.positions[v] = surface.positions[surface.triangles[0][0]];
  if (signed_volume(surface) < 0)
    for (Triangle& t : surface.triangles) std::swap(t[1], t[2]);
  return surface;
}

}  // namespace skeletex
