// SPDX-License-Identifier: MIT
#include "skeletex/segment/segment_mesh.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <random>
#include <set>

#include "skeletex/io/mesh_file.h"
#include "skeletex/io/skeleton_file.h"
#include "skeletex/measure/manifold.h"
#include "skeletex/model/error.h"
#include "skeletex/model/walls.h"
#include "skeletex/segment/cells.h"
#include "skeletex/segment/check_skeleton.h"
#include "support/segment_twin.h"
#include "support/shapes.h"

namespace skeletex {
namespace {

ClContext& context() {
  static ClContext instance;
  return instance;
}

Segmentation segment(const TriangleMesh& mesh, const Skeleton& skeleton) {
  return segment_mesh(context(), build_half_edges(mesh), skeleton);
}

std::vector<double> bone_areas(const Segmentation& segmentation) {
  std::vector<double> areas;
  for (const Segment& part : segmentation.segments) areas.push_back(surface_area(part.mesh));
  return areas;
}

/// The vertices of the cut mesh that a segment's loop runs through, from its arcs.
std::vector<int> loop_through_arcs(const Segmentation& s, const BoundaryLoop& loop) {
  std::vector<int> vertices;
  for (const ArcUse& use : loop.arcs) {
    const Arc& arc = s.arcs[use.arc];
    std::vector<int> run = arc.vertices;
    if (arc.is_closed) {
      if (use.is_reversed) std::reverse(run.begin() + 1, run.end());
    } else {
      if (use.is_reversed) std::reverse(run.begin(), run.end());
      run.pop_back();
    }
    vertices.insert(vertices.end(), run.begin(), run.end());
  }
  return vertices;
}

/// Everything that model/segment.h and design section 2 promise.
void expect_sound(const TriangleMesh& mesh, const Skeleton& skeleton, const Segmentation& s) {
  const double diagonal = bounding_box(mesh).diagonal();
  ASSERT_EQ(s.segments.size(), skeleton.bones.size());
  ASSERT_EQ(s.triangle_bones.size(), s.cut_mesh.triangles.size());

  // The cut mesh is the input: same surface, same topology, the input's vertices first.
  const ManifoldReport before = measure_manifold(mesh), after = measure_manifold(s.cut_mesh);
  EXPECT_TRUE(after.is_closed_manifold());
  EXPECT_EQ(after.genus, before.genus);
  EXPECT_EQ(after.components, 1);
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) ASSERT_EQ(s.cut_mesh.positions[v], mesh.positions[v]);
  EXPECT_NEAR(surface_area(s.cut_mesh), surface_area(mesh), 1e-9 * surface_area(mesh));
  EXPECT_NEAR(signed_volume(s.cut_mesh), signed_volume(mesh), 1e-9 * std::pow(diagonal, 3));
  double sum = 0;
  for (const double area : bone_areas(s)) sum += area;
  EXPECT_NEAR(sum, surface_area(mesh), 1e-9 * surface_area(mesh));

  const Walls walls(skeleton);
  const auto at_nodes = bones_at_nodes(skeleton);
  std::vector<int> uses(s.arcs.size(), 0);
  std::vector<int> corner_of(s.cut_mesh.positions.size(), 0);
  for (const Arc& arc : s.arcs) {
    EXPECT_GE(arc.vertices.size(), 3u);
    // On the wall, to the perturbation of 1e-7 diagonals over |d_i - d_j|.
    Vec3 d[2];
    for (int k = 0; k < 2; ++k) {
      const BoneEnd end = skeleton.bones[arc.bones[k]].head == arc.node ? BoneEnd::kHead : BoneEnd::kTail;
      ASSERT_EQ(end_node(skeleton, arc.bones[k], end), arc.node);
      d[k] = direction_from(skeleton, {arc.bones[k], end});
    }
    for (const int v : arc.vertices)
      EXPECT_LE(std::abs((s.cut_mesh.positions[v] - skeleton.nodes[arc.node].position).dot(d[0] - d[1])), 1.01e-7 * diagonal);
    // In the direction of growing angle: from corner to corner in the middle at least (single steps may turn back).
    double turning = 0;
    const auto turn = [&](int v) { return walls.turn_of(arc.bones[0], s.cut_mesh.positions[v] - skeleton.nodes[arc.node].position); };
    const std::size_t steps = arc.is_closed ? arc.vertices.size() : arc.vertices.size() - 1;
    for (std::size_t k = 0; k < steps; ++k) {
      const double step = turn(arc.vertices[(k + 1) % arc.vertices.size()]) - turn(arc.vertices[k]);
      turning += step - std::round(step);
    }
    if (arc.is_closed) {
      EXPECT_NEAR(turning, 1, 1e-9);
    } else if (at_nodes[arc.node].size() == 3) {
      EXPECT_NEAR(turning, 0.5, 1e-5) << "the two corners of three bones lie opposite each other";
    }
  }

  for (const Segment& segment : s.segments) {
    const std::string& name = skeleton.bones[segment.bone].name;
    EXPECT_EQ(segment.source_vertices.size(), segment.mesh.positions.size());
    const ManifoldReport report = measure_manifold(segment.mesh);
    EXPECT_EQ(report.components, 1) << name;
    EXPECT_TRUE(report.non_manifold_edges.empty() && report.misoriented_edges.empty() && report.degenerate_triangles.empty()) << name;
    EXPECT_TRUE(report.unreferenced_vertices.empty()) << name;
    std::size_t boundary = 0;
    int loops = 0;
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) {
      const BoundaryLoop& loop = segment.loops[static_cast<int>(end)];
      const int node = end_node(skeleton, segment.bone, end);
      EXPECT_EQ(loop.vertices.empty(), at_nodes[node].size() < 2) << name;
      if (loop.vertices.empty()) continue;
      ++loops;
      boundary += loop.vertices.size();
      std::vector<int> source;
      for (const int v : loop.vertices) source.push_back(segment.source_vertices[v]);
      EXPECT_EQ(source, loop_through_arcs(s, loop)) << name;
      double turning = 0;
      for (std::size_t k = 0; k < source.size(); ++k) {
        const auto turn = [&](int v) { return walls.turn_of(segment.bone, s.cut_mesh.positions[v] - skeleton.nodes[node].position); };
        const double step = turn(source[(k + 1) % source.size()]) - turn(source[k]);
        turning += step - std::round(step);
      }
      EXPECT_NEAR(turning, 1, 1e-9) << name;
      for (const ArcUse& use : loop.arcs) {
        ++uses[use.arc];
        EXPECT_TRUE(s.arcs[use.arc].bones[0] == segment.bone || s.arcs[use.arc].bones[1] == segment.bone);
        EXPECT_EQ(s.arcs[use.arc].node, node);
      }
    }
    EXPECT_EQ(report.boundary_edges.size(), boundary) << name;
    const int euler = report.vertices - report.edges + report.triangles;
    EXPECT_EQ(euler, 2 - loops) << name;
    EXPECT_EQ(segment.topology, loops == 2 ? SegmentTopology::kAnnulus : loops == 1 ? SegmentTopology::kDisk : SegmentTopology::kSphere);
    for (const Triangle& t : segment.mesh.triangles) EXPECT_GT(area_vector(segment.mesh, t).norm(), 0) << name;
  }
  for (std::size_t a = 0; a < uses.size(); ++a) EXPECT_EQ(uses[a], 2) << "arc " << a;
}

TriangleMesh model_mesh(const std::string& name) { return read_mesh(SKELETEX_SOURCE_DIR "/build/meshes/" + name).mesh; }
Skeleton model_skeleton(const std::string& name) { return read_skeleton(SKELETEX_SOURCE_DIR "/configs/skeletons/" + name + ".skeleton.json"); }

}  // namespace

class SegmentModel : public testing::TestWithParam<std::pair<const char*, const char*>> {};

TEST_P(SegmentModel, IsCutIntoTubesAndCapsThatAddUp) {
  const TriangleMesh mesh = model_mesh(GetParam().first);
  const Skeleton skeleton = model_skeleton(GetParam().second);
  expect_sound(mesh, skeleton, segment(mesh, skeleton));
}

INSTANTIATE_TEST_SUITE_P(Real, SegmentModel,
                         testing::Values(std::pair("armadillo.off", "armadillo"), std::pair("bear.off", "bear"), std::pair("bear_bis.off", "bear_bis"),
                                         std::pair("bull.off", "bull"), std::pair("bull.off", "bull_16"), std::pair("bunny00.off", "bunny00"),
                                         std::pair("bunny00.off", "bunny00_9"), std::pair("cactus.off", "cactus"), std::pair("camel.off", "camel"),
                                         std::pair("camel.off", "camel_16"), std::pair("cow.off", "cow"), std::pair("diplodocus.off", "diplodocus"),
                                         std::pair("double-torus-example.off", "double_torus"), std::pair("eight.off", "eight"),
                                         std::pair("eight.off", "eight_dumbbell"), std::pair("eight.off", "eight_theta"), std::pair("homer.off", "homer"),
                                         std::pair("knot1.off", "knot1"), std::pair("man.off", "man"), std::pair("pinion.off", "pinion"),
                                         std::pair("pinion.off", "pinion_5"), std::pair("triceratops.off", "triceratops"),
                                         std::pair("triceratops.off", "triceratops_17")),
                         [](const auto& test) { return std::string(test.param.second); });

TEST(Segment, CutsEveryGeneratedShape) {
  for (const NamedShape& named : all_shapes()) {
    SCOPED_TRACE(named.name);
    expect_sound(named.shape.mesh, named.shape.skeleton, segment(named.shape.mesh, named.shape.skeleton));
  }
}

}  // namespace skeletex
