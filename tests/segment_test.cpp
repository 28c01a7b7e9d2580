// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <set>

#include "skeletex/analysis/manifold.h"
#include "skeletex/convert/segment/cells.h"
#include "skeletex/convert/segment/segment_mesh.h"
#include "skeletex/geometry/half_edge.h"
#include "skeletex/model/error.h"
#include "skeletex/skeleton/check_skeleton.h"
#include "skeletex/skeleton/separation_planes.h"
#include "support/load_model.h"
#include "support/random_skeleton.h"
#include "support/segment_twin.h"
#include "support/shapes.h"

namespace skeletex {
namespace {

ClContext& context() {
  static ClContext instance;
  return instance;
}

Segmentation segment(const TriangleMesh& mesh, const Skeleton& skeleton) {
  return segment_mesh(context(), mesh, skeleton);
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

  const SeparationPlanes separation(skeleton);
  const auto at_nodes = bones_at_nodes(skeleton);
  std::vector<int> uses(s.arcs.size(), 0);
  for (const Arc& arc : s.arcs) {
    EXPECT_GE(arc.vertices.size(), 3u);
    // On the separation plane, to the perturbation of 1e-7 diagonals over |d_i - d_j|.
    Vec3 d[2];
    for (int k = 0; k < 2; ++k) {
      const BoneEnd end = skeleton.bones[arc.bones[k]].head == arc.node ? BoneEnd::kHead : BoneEnd::kTail;
      ASSERT_EQ(end_node(skeleton, arc.bones[k], end), arc.node);
      d[k] = direction_from(skeleton, {arc.bones[k], end});
    }
    for (const int v : arc.vertices)
      EXPECT_LE(std::abs((s.cut_mesh.positions[v] - skeleton.nodes[arc.node].position).dot(d[0] - d[1])),
                1.01e-7 * diagonal);
    // In the direction of growing angle: from corner to corner in the middle at least (single steps may turn back).
    double turning = 0;
    const auto turn = [&](int v) {
      return separation.turn_of(arc.bones[0], s.cut_mesh.positions[v] - skeleton.nodes[arc.node].position);
    };
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
    EXPECT_TRUE(report.non_manifold_edges.empty() && report.misoriented_edges.empty() &&
                report.degenerate_triangles.empty())
        << name;
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
        const auto turn = [&](int v) {
          return separation.turn_of(segment.bone, s.cut_mesh.positions[v] - skeleton.nodes[node].position);
        };
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
    EXPECT_EQ(segment.topology, loops == 2   ? SegmentTopology::kAnnulus
                                : loops == 1 ? SegmentTopology::kDisk
                                             : SegmentTopology::kSphere);
    for (const Triangle& t : segment.mesh.triangles) EXPECT_GT(area_vector(segment.mesh, t).norm(), 0) << name;
  }
  for (std::size_t a = 0; a < uses.size(); ++a) EXPECT_EQ(uses[a], 2) << "arc " << a;

  // Triangles along a seam lie in their bone's cell.
  std::vector<std::set<int>> nodes_at(s.cut_mesh.positions.size());
  for (const Arc& arc : s.arcs)
    for (const int v : arc.vertices) nodes_at[v].insert(arc.node);
  const std::vector<NodeCells> cells = node_cells(skeleton, kMostPerturbation * diagonal);
  for (std::size_t t = 0; t < s.cut_mesh.triangles.size(); ++t) {
    const auto [a, b, c] = s.cut_mesh.triangles[t];
    if (nodes_at[a].empty() && nodes_at[b].empty() && nodes_at[c].empty()) continue;
    const Vec3 centre = (s.cut_mesh.positions[a] + s.cut_mesh.positions[b] + s.cut_mesh.positions[c]) / 3;
    for (const NodeCells& node : cells)
      if (nodes_at[a].contains(node.node) || nodes_at[b].contains(node.node) || nodes_at[c].contains(node.node)) {
        double own = -1e300, best = -1e300;
        for (std::size_t k = 0; k < node.cells.size(); ++k) {
          best = std::max(best, node.value(static_cast<int>(k), centre));
          if (node.cells[k].bone.bone == s.triangle_bones[t]) own = node.value(static_cast<int>(k), centre);
        }
        EXPECT_GE(own, best - 1e-13 * diagonal) << "triangle " << t;
      }
  }
}

/// What segmenting says when it refuses; empty when it does not.
std::string refusal(const TriangleMesh& mesh, const Skeleton& skeleton) {
  try {
    segment(mesh, skeleton);
  } catch (const TopologyError& error) {
    return error.what();
  }
  return "";
}

testing::AssertionResult mentions(const std::string& message, const std::vector<std::string>& parts) {
  for (const std::string& part : parts)
    if (message.find(part) == std::string::npos)
      return testing::AssertionFailure() << "no '" << part << "' in: " << message;
  return testing::AssertionSuccess();
}

/// A skeleton by its nodes, and bones as pairs of them; names n0, n1, ..., b0, b1, ...
Skeleton skeleton_of(const std::vector<Vec3>& nodes, const std::vector<std::array<int, 2>>& bones) {
  Skeleton skeleton;
  for (std::size_t n = 0; n < nodes.size(); ++n) skeleton.nodes.push_back({"n" + std::to_string(n), nodes[n]});
  for (std::size_t b = 0; b < bones.size(); ++b)
    skeleton.bones.push_back({"b" + std::to_string(b), bones[b][0], bones[b][1], std::nullopt});
  return skeleton;
}

TriangleMesh octahedron() {
  return {{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}},
          {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}}};
}

TriangleMesh tetrahedron() {
  return {{{1, 1, 1}, {-1, -1, 1}, {-1, 1, -1}, {1, -1, -1}}, {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}};
}

}  // namespace

class SegmentModel : public testing::TestWithParam<const char*> {};

TEST_P(SegmentModel, IsCutIntoTubesAndCapsThatAddUp) {
  const TestModel model = load_standard_model(GetParam());
  expect_sound(model.mesh, model.skeleton, segment(model.mesh, model.skeleton));
}

INSTANTIATE_TEST_SUITE_P(Real, SegmentModel,
                         testing::Values("armadillo", "bear", "bear_bis", "bull", "bull_16", "bunny00", "bunny00_9",
                                         "cactus", "camel", "camel_16", "cow", "diplodocus", "double_torus", "eight",
                                         "eight_dumbbell", "eight_theta", "homer", "knot1", "man", "pinion", "pinion_5",
                                         "triceratops", "triceratops_17"),
                         [](const auto& test) { return std::string(test.param); });

TEST(Segment, CutsEveryGeneratedShape) {
  for (const NamedShape& named : all_shapes()) {
    SCOPED_TRACE(named.name);
    expect_sound(named.shape.mesh, named.shape.skeleton, segment(named.shape.mesh, named.shape.skeleton));
  }
}

TEST(Segment, CutsCoarseBodiesWhoseTrianglesHoldWholeCells) {
  const unsigned seed = 20181;
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 random(seed);
  for (int run = 0; run < 60; ++run) {
    SCOPED_TRACE("run " + std::to_string(run));
    const TriangleMesh mesh = run % 2 == 0 ? octahedron() : tetrahedron();
    const int count = run % 3 == 0 ? 40 : 2 + run % 7;
    std::vector<Vec3> nodes{Vec3::Zero()};
    std::vector<std::array<int, 2>> bones;
    for (int b = 0; b < count; ++b) {
      nodes.push_back(0.2 * test::random_direction(random));
      bones.push_back({0, b + 1});
    }
    const Skeleton skeleton = skeleton_of(nodes, bones);
    expect_sound(mesh, skeleton, segment(mesh, skeleton));
  }
}

TEST(Segment, CutsCoCircularDirectionsThroughVerticesAndEdgesOfTheMesh) {
  // The octahedron's own axes and diagonals: every separation plane runs through vertices, edges or along both.
  std::vector<std::vector<Vec3>> stars{
      {{1, 0, 0}, {-1, 0, 0}},
      {{1, 0, 0}, {0, 1, 0}},
      {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}},
      {{1, 1, 0}, {-1, 1, 0}, {-1, -1, 0}, {1, -1, 0}},
      {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}},
      {{1, 1, 1}, {-1, 1, 1}, {1, -1, 1}, {-1, -1, 1}, {1, 1, -1}, {-1, 1, -1}, {1, -1, -1}, {-1, -1, -1}},
  };
  for (std::size_t k = 0; k < stars.size(); ++k) {
    SCOPED_TRACE("star " + std::to_string(k));
    std::vector<Vec3> nodes{Vec3::Zero()};
    std::vector<std::array<int, 2>> bones;
    for (const Vec3& d : stars[k]) {
      nodes.push_back(0.2 * d);
      bones.push_back({0, static_cast<int>(nodes.size()) - 1});
    }
    const Skeleton skeleton = skeleton_of(nodes, bones);
    const Segmentation s = segment(octahedron(), skeleton);
    expect_sound(octahedron(), skeleton, s);
    if (k == 1) continue;
    for (const double area : bone_areas(s))
      EXPECT_NEAR(area, surface_area(octahedron()) / static_cast<double>(stars[k].size()), 1e-5) << "symmetric";
  }
}

TEST(Segment, GivesTheBonesOfARegularRingEqualAreas) {
  const Shape torus = torus_shape(5, 2, 0.5, 60, 24);
  const Segmentation s = segment(torus.mesh, torus.skeleton);
  for (const double area : bone_areas(s)) EXPECT_NEAR(area, surface_area(torus.mesh) / 5, 1e-6 * area);
}

TEST(Segment, GivesSegmentsThatDoNotDependOnNumbering) {
  const unsigned seed = 7;
  SCOPED_TRACE("seed " + std::to_string(seed));
  for (const char* name : {"bear_bis", "eight", "cow", "knot1"}) {
    SCOPED_TRACE(name);
    const TestModel model = load_standard_model(name);
    const std::vector<double> areas = bone_areas(segment(model.mesh, model.skeleton));
    const double total = surface_area(model.mesh);

    const auto vertices = random_permutation(static_cast<int>(model.mesh.positions.size()), seed);
    const auto triangles = random_permutation(static_cast<int>(model.mesh.triangles.size()), seed + 1);
    const auto bones = random_permutation(static_cast<int>(model.skeleton.bones.size()), seed + 2);
    const auto nodes = random_permutation(static_cast<int>(model.skeleton.nodes.size()), seed + 3);
    TriangleMesh mesh = with_triangles_renumbered(with_vertices_renumbered(model.mesh, vertices), triangles);
    for (std::size_t t = 0; t < mesh.triangles.size(); t += 3)
      std::rotate(mesh.triangles[t].begin(), mesh.triangles[t].begin() + 1, mesh.triangles[t].end());
    Skeleton skeleton = with_nodes_renumbered(with_bones_renumbered(model.skeleton, bones), nodes);
    for (std::size_t b = 0; b < skeleton.bones.size(); b += 2)
      std::swap(skeleton.bones[b].head, skeleton.bones[b].tail);

    const Segmentation s = segment(mesh, skeleton);
    expect_sound(mesh, skeleton, s);
    const std::vector<double> renumbered = bone_areas(s);
    for (std::size_t b = 0; b < areas.size(); ++b)
      EXPECT_NEAR(renumbered[bones[b]], areas[b], 1e-9 * total) << "bone " << b;
  }
}

TEST(Segment, FollowsARigidMotionAndAScaling) {
  const TestModel model = load_standard_model("triceratops");
  const std::vector<double> areas = bone_areas(segment(model.mesh, model.skeleton));
  for (const std::uint64_t seed : {1, 2, 3}) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Similarity map = random_similarity(seed);
    const std::vector<double> moved =
        bone_areas(segment(transformed(model.mesh, map), transformed(model.skeleton, map)));
    // The perturbation is dealt out anew: each boundary, shorter than two diagonals, moves by less than 1e-7 diagonals.
    const double tolerance = 4 * 1e-7 * std::pow(bounding_box(model.mesh).diagonal(), 2);
    for (std::size_t b = 0; b < areas.size(); ++b) EXPECT_NEAR(moved[b] / (map.scale * map.scale), areas[b], tolerance);
  }
}

TEST(Segment, GivesTheSameResultTwice) {
  const TestModel model = load_standard_model("man");
  const Segmentation a = segment(model.mesh, model.skeleton), b = segment(model.mesh, model.skeleton);
  EXPECT_EQ(a.cut_mesh.positions, b.cut_mesh.positions);
  EXPECT_EQ(a.cut_mesh.triangles, b.cut_mesh.triangles);
  EXPECT_EQ(a.triangle_bones, b.triangle_bones);
}

TEST(Segment, LeavesALoneBoneItsWholeMesh) {
  const Shape capsule = capsule_shape();
  const Segmentation s = segment(capsule.mesh, capsule.skeleton);
  EXPECT_EQ(s.cut_mesh.triangles.size(), capsule.mesh.triangles.size());
  EXPECT_EQ(s.segments[0].topology, SegmentTopology::kSphere);
  EXPECT_TRUE(s.arcs.empty());
}

TEST(Segment, DoesNotCutAnotherLimbThatTheSeparationPlaneReaches) {
  // A hairpin: the separation plane in the middle of one leg reaches through the other.
  const Skeleton hairpin =
      skeleton_of({{0, 0, 0}, {2, 0, 0}, {4, 0, 0}, {4, 2, 0}, {0, 2, 0}}, {{0, 1}, {1, 2}, {2, 3}, {3, 4}});
  const TriangleMesh mesh = thickened(hairpin, {0.5, 0.5, 0.5, 0.5, 0.5}, 0.1, 0.2);
  const Segmentation s = segment(mesh, hairpin);
  expect_sound(mesh, hairpin, s);
  EXPECT_EQ(s.arcs.size(), 3u);
  for (const Arc& arc : s.arcs)
    if (arc.node == 1) {
      for (const int v : arc.vertices) EXPECT_LT(s.cut_mesh.positions[v].y(), 1);
    }
}

TEST(SegmentRefusal, NamesANodeOutsideAndItsBone) {
  Shape y = y_shape();
  y.skeleton.nodes[2].position = {-2.5, 3.2, 0};
  EXPECT_TRUE(
      mentions(refusal(y.mesh, y.skeleton), {"node \"left\"", "bone \"left\"", "outside", "(-2.5, 3.2, 0)", "move"}));
}

TEST(SegmentRefusal, SaysThatTheMeshIsInsideOut) {
  const Shape y = y_shape(0.3);
  EXPECT_TRUE(mentions(refusal(inside_out(y.mesh), y.skeleton), {"inside out", "reverse"}));
}

TEST(SegmentRefusal, NamesABoneThatLeavesTheMeshAndThePlace) {
  const Shape chain = chain_shape(3, 0.9);
  const Skeleton shortcut{chain.skeleton.nodes,
                          {{"shortcut", chain.skeleton.bones[0].head, chain.skeleton.bones[2].tail, std::nullopt}}};
  EXPECT_TRUE(mentions(refusal(chain.mesh, shortcut), {"bone \"shortcut\" leaves the mesh at (", "move"}));
  try {
    segment(chain.mesh, shortcut);
  } catch (const TopologyError& error) {
    EXPECT_EQ(error.bone(), 0);
  }
}

TEST(SegmentRefusal, NamesTheBoneWhoseSeparationPlanesCross) {
  const TriangleMesh ball = capsule_shape(0.01, 1).mesh;
  const Skeleton skeleton =
      skeleton_of({{-0.6, -0.5, 0}, {-0.05, 0, 0}, {0.05, 0, 0}, {0.6, -0.5, 0}}, {{0, 1}, {1, 2}, {2, 3}});
  EXPECT_TRUE(mentions(refusal(ball, skeleton), {"bone \"b1\"", "\"n1\"", "\"n2\"", "cross", "at (", "move"}));
}

TEST(SegmentRefusal, NamesTheBonesWhereAHandleHasNoRing) {
  const Shape torus = torus_shape(5);
  Skeleton open = torus.skeleton;
  open.bones.pop_back();
  EXPECT_TRUE(mentions(refusal(torus.mesh, open), {"bone \"", "handle", "ring"}));
  Skeleton lone = open;
  lone.bones.resize(1);
  EXPECT_TRUE(mentions(refusal(torus.mesh, lone), {"bone \"" + lone.bones[0].name + "\"", "handle", "ring"}));
}

TEST(SegmentRefusal, NamesBonesApartAndBonesInOneDirection) {
  const TriangleMesh ball = capsule_shape(0.01, 1).mesh;
  EXPECT_TRUE(
      mentions(refusal(ball, skeleton_of({{-0.5, 0, 0}, {-0.2, 0, 0}, {0.2, 0, 0}, {0.5, 0, 0}}, {{0, 1}, {2, 3}})),
               {"\"b1\"", "\"b0\"", "node"}));
  EXPECT_TRUE(mentions(refusal(ball, skeleton_of({{0, 0, 0}, {0.2, 0, 0}, {0.5, 0, 0}}, {{0, 1}, {0, 2}})),
                       {"\"b0\"", "\"b1\"", "\"n0\"", "direction"}));
  EXPECT_THROW(segment(ball, skeleton_of({{0, 0, 0}, {0, 0, 0}}, {{0, 1}})), InputError);
  EXPECT_THROW(segment(ball, Skeleton{}), InputError);
}

TEST(SegmentRefusal, NeverCrashesOnMovedNodes) {
  const unsigned seed = 99;
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 random(seed);
  int sound = 0, refused = 0;
  for (const char* name : {"cow", "eight", "homer", "triceratops"}) {
    const TestModel model = load_standard_model(name);
    const double diagonal = bounding_box(model.mesh).diagonal();
    for (int run = 0; run < 12; ++run) {
      SCOPED_TRACE(name + std::to_string(run));
      Skeleton skeleton = model.skeleton;
      const double amplitude = diagonal * std::pow(10.0, -1.3 - 0.15 * run);
      for (Node& node : skeleton.nodes)
        node.position += amplitude * test::random_between(random, 0, 1) * test::random_direction(random);
      try {
        const Segmentation s = segment(model.mesh, skeleton);
        expect_sound(model.mesh, skeleton, s);
        ++sound;
      } catch (const TopologyError& error) {
        EXPECT_TRUE(mentions(error.what(), {"bone", "(", "; "}));
        ++refused;
      }
    }
  }
  EXPECT_GT(sound, 10);
  EXPECT_GT(refused, 5);
}

TEST(HalfEdge, KeepsNumbersAndCounts) {
  const Shape y = y_shape(0.3);
  const HalfEdgeMesh mesh = build_half_edges(y.mesh);
  ASSERT_EQ(mesh.n_vertices(), y.mesh.positions.size());
  ASSERT_EQ(mesh.n_faces(), y.mesh.triangles.size());
  EXPECT_EQ(2 * mesh.n_edges(), 3 * mesh.n_faces());
  for (const auto f : mesh.faces()) {
    std::set<int> vertices;
    for (const auto v : mesh.fv_range(f)) vertices.insert(v.idx());
    EXPECT_EQ(vertices, std::set<int>(y.mesh.triangles[f.idx()].begin(), y.mesh.triangles[f.idx()].end()));
  }
}

TEST(CutMesh, LinksTheHalfEdgesOfClosedSurfacesAndRefusesAllElse) {
  const TriangleMesh closed = y_shape(0.3).mesh;
  const CutMesh mesh = cut_mesh_of(closed);
  ASSERT_EQ(mesh.origins.size(), 3 * closed.triangles.size());
  for (int h = 0; h < static_cast<int>(mesh.origins.size()); ++h) {
    EXPECT_EQ(mesh.origins[h], closed.triangles[h / 3][(h + 2) % 3]);
    EXPECT_EQ(mesh.opposites[mesh.opposites[h]], h);
    EXPECT_EQ(mesh.origins[mesh.opposites[h]], mesh.target(h));
  }
  TriangleMesh open = closed;
  open.triangles.pop_back();
  EXPECT_THROW(cut_mesh_of(open), InputError);
  TriangleMesh twice = closed;
  twice.triangles.push_back(closed.triangles[0]);
  EXPECT_THROW(cut_mesh_of(twice), InputError);
  TriangleMesh beyond = closed;
  beyond.triangles[5][1] = static_cast<int>(closed.positions.size());
  EXPECT_THROW(cut_mesh_of(beyond), InputError);
  // Two bodies that share a vertex.
  TriangleMesh touching = closed;
  const int count = static_cast<int>(closed.positions.size());
  for (const Vec3& p : closed.positions) touching.positions.push_back(p + Vec3(9, 0, 0));
  for (Triangle t : closed.triangles) {
    for (int& v : t) v = v == 0 ? 0 : v + count;
    touching.triangles.push_back(t);
  }
  EXPECT_THROW(cut_mesh_of(touching), InputError);
}

TEST(HalfEdge, RefusesWhatIsNoSurfaceAndNamesTheTriangle) {
  const auto message = [](const TriangleMesh& mesh) {
    try {
      build_half_edges(mesh);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  TriangleMesh fin = octahedron();
  fin.positions.push_back({0, 0, 3});
  fin.triangles.push_back({0, 2, 6});
  EXPECT_TRUE(mentions(message(fin), {"triangle 8"}));
  TriangleMesh turned = octahedron();
  std::swap(turned.triangles[7][0], turned.triangles[7][1]);
  EXPECT_TRUE(mentions(message(turned), {"triangle 7"}));
  TriangleMesh beyond = octahedron();
  beyond.triangles[3][2] = 6;
  EXPECT_TRUE(mentions(message(beyond), {"triangle 3", "vertex 6"}));
  TriangleMesh twice = octahedron();
  twice.triangles[2][1] = twice.triangles[2][0];
  EXPECT_TRUE(mentions(message(twice), {"triangle 2"}));
  TriangleMesh open = octahedron();
  open.triangles.pop_back();
  EXPECT_THROW(segment(open, skeleton_of({{0, 0, 0}, {0.1, 0, 0}}, {{0, 1}})), InputError);
}

TEST(WindingNumber, IsTheSolidAngle) {
  const unsigned seed = 5;
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 random(seed);
  const TriangleMesh mesh = theta_shape(0.3).mesh;
  const CutMesh half_edges = cut_mesh_of(mesh);
  const BoundingBox box = bounding_box(mesh);
  for (int k = 0; k < 300; ++k) {
    Vec3 p;
    for (int d = 0; d < 3; ++d) p[d] = test::random_between(random, box.lower[d], box.upper[d]);
    if (k % 3 == 0) p.y() = mesh.positions[k].y();  // level with a vertex
    if (k % 6 == 0) p.x() = mesh.positions[k].x();  // under or over it
    double angle = 0;
    for (const Triangle& t : mesh.triangles) {
      const Vec3 a = mesh.positions[t[0]] - p, b = mesh.positions[t[1]] - p, c = mesh.positions[t[2]] - p;
      angle += 2 * std::atan2(a.dot(b.cross(c)), a.norm() * b.norm() * c.norm() + a.dot(b) * c.norm() +
                                                     b.dot(c) * a.norm() + c.dot(a) * b.norm());
    }
    EXPECT_EQ(winding_number(half_edges.positions, half_edges.origins, p), std::lround(angle / (4 * std::numbers::pi)))
        << p.transpose();
  }
}

TEST(ClassifyPoints, AgreesWithItsTwinOutsideTheMarginAndIsNeverWrong) {
  const unsigned seed = 11;
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 random(seed);
  for (int run = 0; run < 6; ++run) {
    // Stars of 2 to 60 bones; points all over, on the separation planes, at the nodes, far off, and the same one often.
    Skeleton skeleton;
    std::vector<Vec3> points;
    for (int star = 0; star < 4; ++star) {
      const Vec3 centre = 3 * test::random_direction(random);
      const int count = run == 5 ? 60 : 2 + star + run;
      const int first = static_cast<int>(skeleton.nodes.size());
      skeleton.nodes.push_back({"c" + std::to_string(star), centre});
      std::vector<Vec3> directions;
      for (int b = 0; b < count; ++b) {
        directions.push_back(test::random_direction(random));
        skeleton.nodes.push_back({"e", centre + directions.back()});
        skeleton.bones.push_back({"b", first, first + b + 1, std::nullopt});
      }
      for (int k = 0; k < 2000; ++k) {
        const Vec3 normal = (directions[k % count] - directions[(k + 1) % count]).normalized();
        Vec3 x = test::random_between(random, 0, 2) * test::random_direction(random);
        x -= x.dot(normal) * normal;
        points.push_back(centre + x + (k % 4) * 1e-7 * normal);
        points.push_back(centre + test::random_between(random, 0, 3) * test::random_direction(random));
      }
      points.push_back(centre);
    }
    points.push_back({1e3, 0, 0});
    points.insert(points.end(), 10, points[0]);
    const std::vector<NodeCells> nodes = node_cells(skeleton, 1e-6);
    const ClassifyTables tables = classify_tables(points, nodes);
    const auto device = classify_on_device(context(), tables);
    const auto twin = classify_points_twin<double>(tables);
    const auto labels = classify_points(context(), points, nodes);
    ASSERT_EQ(device.size(), points.size() * nodes.size());
    int certain = 0;
    for (std::size_t k = 0; k < device.size(); ++k) {
      const NodeCells& node = nodes[k / points.size()];
      const Vec3& p = points[k % points.size()];
      EXPECT_EQ(labels[k], node.cell_of(p));
      if (device[k] == kUncertainCell) continue;
      ++certain;
      EXPECT_EQ(device[k], node.cell_of(p));
      EXPECT_TRUE(twin[k] == kUncertainCell || twin[k] == device[k]);
    }
    EXPECT_GT(certain, 3 * static_cast<int>(device.size()) / 4);
  }
}

}  // namespace skeletex
