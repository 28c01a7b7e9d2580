// SPDX-License-Identifier: MIT
#include "skeletex/analysis/validate_input.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "skeletex/analysis/findings.h"
#include "skeletex/convert/segment/segment_mesh.h"
#include "skeletex/geometry/self_intersection.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

/// "what is wrong; what to do" as a finding.
Finding finding_of(const Error& error) {
  const std::string text = error.what();
  const auto cut = text.rfind("; ");
  if (cut == std::string::npos) return {Severity::kError, "segmentation", text, "move the nodes that it names"};
  return {Severity::kError, "segmentation", text.substr(0, cut), text.substr(cut + 2)};
}

const char* plural(std::size_t count) { return count == 1 ? "" : "s"; }

/// Turns a mesh that is inside out.
void check_volume(double diagonal, TriangleMesh& mesh, std::vector<Finding>& findings) {
  const double volume = signed_volume(mesh);
  if (std::abs(volume) <= 1e-12 * std::pow(diagonal, 3)) {
    findings.push_back({Severity::kError, "volume", fmt::format("the mesh encloses no volume ({:.3g})", volume),
                        "give a body, not a sheet"});
  } else if (volume < 0) {
    for (Triangle& t : mesh.triangles) std::swap(t[1], t[2]);
    findings.push_back({Severity::kNote, "orientation",
                        fmt::format("the mesh was inside out (volume {:.6g}); all its triangles were turned", volume),
                        "nothing to do; a file with counter-clockwise triangles avoids this note"});
  }
}

void check_self_intersections(const TriangleMesh& mesh, const TriangleTree& tree, std::vector<Finding>& findings) {
  const auto pairs = find_self_intersections(mesh, tree);
  if (pairs.empty()) return;
  const auto& [a, b] = pairs.front();
  const Vec3 place = (mesh.positions[mesh.triangles[a][0]] + mesh.positions[mesh.triangles[a][1]] +
                      mesh.positions[mesh.triangles[a][2]]) /
                     3;
  findings.push_back({Severity::kWarning, "self-intersection",
                      fmt::format("{} pair{} of triangles intersect; the first are triangles {} and {} at {}",
                                  pairs.size(), plural(pairs.size()), a, b, text_of(place)),
                      "none needed: such a mesh is encoded as it is"});
}

void check_genus(const Skeleton& skeleton, int genus, std::vector<Finding>& findings) {
  const int cycles = count_cycles(skeleton);
  if (cycles == genus) return;
  const int missing = std::abs(genus - cycles);
  findings.push_back(
      {Severity::kError, "genus",
       fmt::format("the mesh has {} handle{} (its genus), but the skeleton has {} independent cycle{} of bones", genus,
                   plural(genus), cycles, plural(cycles)),
       cycles < genus ? fmt::format("close {} more ring{} of bones, one around every hole of the body, or cut small "
                                    "handles off (encode --close --close-handles X)",
                                    missing, plural(missing))
                      : fmt::format("open {} ring{} of bones: only a hole in the body has one around it", missing,
                                    plural(missing))});
}

}  // namespace

namespace {

struct MeshFindings {
  ManifoldReport report;
  double diagonal = 0;
  bool is_good = false;  ///< closed and finite
};

MeshFindings check_mesh(TriangleMesh& mesh, std::optional<TriangleTree>* tree, std::vector<Finding>& findings) {
  MeshFindings found{measure_manifold(mesh)};
  find_in_mesh(mesh, found.report, findings);
  const bool is_finite = found.report.non_finite_vertices.empty();
  found.is_good = found.report.is_closed_manifold() && is_finite;
  found.diagonal = is_finite ? bounding_box(mesh).diagonal() : 0;
  if (found.is_good) {
    check_volume(found.diagonal, mesh, findings);
    TriangleTree own = build_triangle_tree(mesh);
    check_self_intersections(mesh, own, findings);
    if (tree) *tree = std::move(own);
  }
  return found;
}

}  // namespace

std::vector<Finding> validate_mesh(TriangleMesh& mesh, std::optional<TriangleTree>* tree) {
  std::vector<Finding> findings;
  check_mesh(mesh, tree, findings);
  return findings;
}

std::vector<Finding> validate_before_segmentation(TriangleMesh& mesh, const Skeleton& skeleton,
                                                  std::optional<TriangleTree>* tree) {
  std::vector<Finding> findings;
  const MeshFindings found = check_mesh(mesh, tree, findings);
  const TriangleMesh surface = usable_surface(mesh, found.report);
  const double unit = surface.triangles.empty() ? found.diagonal : bounding_box(surface).diagonal();
  if (!find_in_skeleton(skeleton, unit, findings)) return findings;
  if (!surface.triangles.empty()) find_between(SurfaceProbe(surface), found.is_good, skeleton, findings);
  if (found.report.is_closed_manifold() && found.report.components == 1)
    check_genus(skeleton, found.report.genus, findings);
  return findings;
}

std::vector<Finding> validate_input(ClContext& context, TriangleMesh& mesh, const Skeleton& skeleton) {
  std::optional<TriangleTree> tree;
  std::vector<Finding> findings = validate_before_segmentation(mesh, skeleton, &tree);
  if (has_errors(findings)) return findings;
  try {
    const UnitFrame frame = unit_frame(mesh);
    segment_mesh(context, in_unit_frame(mesh, frame), in_unit_frame(skeleton, frame));
  } catch (const TopologyError& error) {
    find_crossing_planes(skeleton, mesh, *tree, findings);
    const auto is_told = [&](const Finding& f) { return f.rule == "separation-planes" && f.bone == error.bone(); };
    if (std::none_of(findings.begin(), findings.end(), is_told)) {
      findings.push_back(finding_of(error));
      findings.back().bone = error.bone();
      findings.back().node = error.node();
    }
  } catch (const InputError& error) {
    findings.push_back(finding_of(error));
  }
  return findings;
}

bool has_errors(const std::vector<Finding>& findings) {
  return std::any_of(findings.begin(), findings.end(), [](const Finding& f) { return f.severity == Severity::kError; });
}

}  // namespace skeletex
