// SPDX-License-Identifier: MIT
#include "skeletex/skeletonize/skeletonize.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <set>

#include "skeletex/analysis/bone_margin.h"
#include "skeletex/analysis/findings.h"
#include "skeletex/analysis/manifold.h"
#include "skeletex/analysis/metro.h"
#include "skeletex/analysis/validate_input.h"
#include "skeletex/io/skeleton_file.h"
#include "skeletex/model/error.h"
#include "skeletex/skeleton/separation_planes.h"
#include "skeletex/skeletonize/body/curve_graph.h"
#include "skeletex/skeletonize/body/fitting_body.h"
#include "skeletex/skeletonize/body/thinning.h"
#include "skeletex/skeletonize/body/tips.h"
#include "skeletex/skeletonize/bones.h"
#include "skeletex/skeletonize/coarse_mesh.h"
#include "skeletex/skeletonize/repair.h"
#include "skeletex/skeletonize/repair_skeleton.h"
#include "support/load_model.h"
#include "support/shapes.h"

namespace skeletex {
namespace {

ClContext& context() {
  static ClContext instance;
  return instance;
}

SkeletonizeResult skeletonized(const TriangleMesh& mesh, const SkeletonizeOptions& options = {}) {
  return skeletonize(context(), mesh, build_triangle_tree(mesh), options);
}

std::string errors_of(TriangleMesh mesh, const Skeleton& skeleton) {
  std::string text;
  for (const Finding& f : validate_input(context(), mesh, skeleton))
    if (f.severity == Severity::kError) text += f.message + '\n';
  return text;
}

/// Share of the way at which a ray first meets a mesh, by looking at every triangle in double precision.
double first_hit_of_all(const TriangleMesh& mesh, const Vec3& origin, const Vec3& direction) {
  double first = std::numeric_limits<double>::infinity();
  for (const Triangle& t : mesh.triangles) {
    Eigen::Matrix3d edges;
    edges << mesh.positions[t[1]] - mesh.positions[t[0]], mesh.positions[t[2]] - mesh.positions[t[0]], -direction;
    const Vec3 x = edges.inverse() * (origin - mesh.positions[t[0]]);
    if (x.allFinite() && x[0] >= 0 && x[1] >= 0 && x[0] + x[1] <= 1 && x[2] >= 0) first = std::min(first, x[2]);
  }
  return first;
}

Skeleton spoilt(Skeleton skeleton, double distance, RandomNumbers& random) {
  for (Node& node : skeleton.nodes) node.position += random.in_ball(distance);
  return skeleton;
}

}  // namespace

TEST(Skeletonize, RaysMeetTheFirstTriangle) {
  const TriangleMesh mesh = creature_shape().mesh;
  const TriangleTree tree = build_triangle_tree(mesh);
  const BoundingBox box = bounding_box(mesh);
  RandomNumbers random(5);
  int hits = 0;
  for (int i = 0; i < 1500; ++i) {
    const Vec3 origin = box.centre() + random.in_ball(box.diagonal()), direction = random.in_ball(2);
    const double expected = first_hit_of_all(mesh, origin, direction),
                 found = find_first_hit(mesh, tree, origin, direction);
    ASSERT_EQ(std::isinf(expected), std::isinf(found)) << i;
    if (std::isinf(expected)) continue;
    ++hits;
    EXPECT_NEAR(found, expected, 1e-5 * box.diagonal() / direction.norm()) << i;
    EXPECT_TRUE(std::isinf(find_first_hit(mesh, tree, origin, direction, 0.999 * expected)));
  }
  EXPECT_GT(hits, 20);
}

TEST(Skeletonize, TheMarginIsThatOfTheSeparationPlanesAndTheSurface) {
  const Shape shape = creature_shape();
  const TriangleTree tree = build_triangle_tree(shape.mesh);
  const std::vector<BoneMargin> margins = bone_margins(shape.mesh, tree, shape.skeleton, 48);
  const SeparationPlanes planes(shape.skeleton);
  int inner = 0;
  for (int b = 0; b < static_cast<int>(shape.skeleton.bones.size()); ++b) {
    if (planes.is_free(b, BoneEnd::kHead) || planes.is_free(b, BoneEnd::kTail)) {
      EXPECT_EQ(margins[b].margin, 1) << "a bone with a free end";
      continue;
    }
    ++inner;
    double least = 1;
    for (int i = 0; i < 480; ++i) {
      const double turn = i / 480.0, head = planes.slope(b, BoneEnd::kHead, turn),
                   tail = planes.slope(b, BoneEnd::kTail, turn);
      const Vec3 o = planes.bases()[b].o, s = planes.radial(b, turn);
      const double rho =
          std::min(first_hit_of_all(shape.mesh, end_position(shape.skeleton, b, BoneEnd::kHead), s + head * o),
                   first_hit_of_all(shape.mesh, end_position(shape.skeleton, b, BoneEnd::kTail), s + tail * o));
      if (head > tail) least = std::min(least, 1 - rho * (head - tail) / bone_length(shape.skeleton, b));
    }
    EXPECT_NEAR(margins[b].margin, least, 0.03) << shape.skeleton.bones[b].name;
  }
  EXPECT_GT(inner, 1);
}

TEST(Skeletonize, ThinnedBodiesHaveTheCyclesOfTheMeshAndEndAtTheAnchorsOnly) {
  for (const NamedShape& shape : all_shapes()) {
    const TriangleTree tree = build_triangle_tree(shape.shape.mesh);
    const Surface surface(shape.shape.mesh, tree);
    const VoxelBody body = make_fitting_body(surface, shape.genus);
    const std::vector<int> anchors{0, body.size() - 1};
    const CurveGraph graph = make_curve_graph(body, thin_body(body, anchors));
    EXPECT_EQ(graph.cycles(), shape.genus) << shape.name;
    const std::vector<int> degrees = graph.degrees();
    for (std::size_t n = 0; n < degrees.size(); ++n) {
      if (degrees[n] != 1) continue;
      EXPECT_TRUE(graph.nodes[n] == body.centres[anchors[0]] || graph.nodes[n] == body.centres[anchors[1]])
          << shape.name;
    }
  }
}

TEST(Skeletonize, MadeShapesGetSkeletonsThatCanBeEncoded) {
  for (const NamedShape& shape : all_shapes()) {
    const SkeletonizeResult result = skeletonized(shape.shape.mesh);
    EXPECT_EQ(result.genus, shape.genus) << shape.name;
    EXPECT_EQ(count_cycles(result.skeleton), shape.genus) << shape.name;
    EXPECT_EQ(errors_of(shape.shape.mesh, result.skeleton), "") << shape.name;
    std::set<std::string> names;
    for (const Bone& bone : result.skeleton.bones) names.insert(bone.name);
    EXPECT_EQ(names.size(), result.skeleton.bones.size()) << shape.name;
  }
}

TEST(Skeletonize, VerticesInNoTriangleAreNone) {
  TriangleMesh mesh = capsule_shape().mesh;
  for (int i = 0; i < 4; ++i) mesh.positions.push_back(Vec3::Constant(i));
  EXPECT_EQ(genus_of(mesh), 0);
  EXPECT_FALSE(skeletonized(mesh).skeleton.bones.empty());
}

TEST(Skeletonize, EveryLimbOfACreatureHasABoneAndTheSameBytesComeAgain) {
  const Shape shape = creature_shape();
  const SkeletonizeResult result = skeletonized(shape.mesh);
  // Every free end of the skeleton that the mesh was made from has a bone near by.
  const auto at_nodes = bones_at_nodes(shape.skeleton);
  const double diagonal = bounding_box(shape.mesh).diagonal();
  for (std::size_t n = 0; n < at_nodes.size(); ++n) {
    if (at_nodes[n].size() != 1) continue;
    double least = diagonal;
    for (const Node& node : result.skeleton.nodes)
      least = std::min(least, (node.position - shape.skeleton.nodes[n].position).norm());
    EXPECT_LT(least, 0.08 * diagonal) << shape.skeleton.nodes[n].name;
  }
  EXPECT_EQ(skeleton_to_json(result.skeleton), skeleton_to_json(skeletonized(shape.mesh).skeleton));
}

TEST(Skeletonize, EveryLegOfASpiderAndItsAbdomenHaveBones) {
  // The deepest place is in the abdomen, behind the body that all legs grow from; feet are near to the next ones.
  Skeleton made;
  std::vector<double> radii;
  const auto node = [&](const Vec3& position, double radius) {
    radii.push_back(radius);
    made.nodes.push_back({"", position});
    return static_cast<int>(made.nodes.size()) - 1;
  };
  const auto bone = [&](int head, int tail) { made.bones.push_back({"", head, tail, {}}); };
  const int body = node({0, 0, 0}, 0.5), waist = node({-0.9, 0, 0.1}, 0.25), abdomen = node({-2.4, 0, 0.4}, 1.0);
  bone(body, waist);
  bone(waist, abdomen);
  std::vector<Vec3> ends{made.nodes[abdomen].position};
  for (const double side : {-1.0, 1.0})
    for (const double along : {-0.35, 0.0, 0.35}) {
      const int knee = node({2.2 * along, 1.5 * side, 0.8}, 0.16);
      ends.emplace_back(1.9 * along, 2.4 * side, -1.2);
      bone(body, knee);
      bone(knee, node(ends.back(), 0.14));
    }
  const TriangleMesh mesh = thickened(made, radii, 0.1, 0.14);
  const SkeletonizeResult result = skeletonized(mesh);
  EXPECT_EQ(result.limbs, 7);
  EXPECT_EQ(result.candidates[result.chosen].limbs, 7);
  for (std::size_t e = 0; e < ends.size(); ++e) {
    double least = std::numeric_limits<double>::infinity();
    for (const Node& other : result.skeleton.nodes) least = std::min(least, (other.position - ends[e]).norm());
    EXPECT_LT(least, e == 0 ? 0.9 : 0.4) << e;
  }
}

TEST(Skeletonize, ALegIsNotReachedByTheBonesOfTheNextOne) {
  Skeleton made;
  made.nodes = {{"", {0, 0, 0}}, {"", {-0.25, 0, -3}}, {"", {0.25, 0, -3}}, {"", {-0.8, 0, 0}}, {"", {0.8, 0, 0}}};
  made.bones = {{"", 3, 0, {}}, {"", 0, 4, {}}, {"", 3, 1, {}}, {"", 4, 2, {}}};
  const TriangleMesh mesh = thickened(made, {0.3, 0.12, 0.12, 0.3, 0.3}, 0.05, 0.08);
  const TriangleTree tree = build_triangle_tree(mesh);
  const Surface surface(mesh, tree);
  const VoxelBody body = make_fitting_body(surface, 0);
  std::vector<int> tips;
  for (const int foot : {1, 2}) {
    const auto distance = [&](const Vec3& centre) { return (centre - made.nodes[foot].position).norm(); };
    const auto nearest = std::min_element(body.centres.begin(), body.centres.end(),
                                          [&](const Vec3& a, const Vec3& b) { return distance(a) < distance(b); });
    tips.push_back(static_cast<int>(nearest - body.centres.begin()));
  }
  const std::vector<LimbTip> feet = places_near(body, tips, 0.6);
  EXPECT_EQ(count_reached(feet, made), 2);
  made.bones.pop_back();
  made.nodes.erase(made.nodes.begin() + 2);
  for (Bone& bone : made.bones)
    for (NodeIndex* node : {&bone.head, &bone.tail})
      if (*node > 2) *node = *node - 1;
  EXPECT_EQ(count_reached(feet, made), 1) << "the foot left is 0.5 away, but not through the body";
}

TEST(Skeletonize, StretchedArmsHaveElbows) {
  Skeleton made;
  made.nodes = {{"", {0, 0, 0}}, {"", {0, 1.5, 0}}, {"", {-3, 0, 0}}, {"", {3, 0, 0}}, {"", {0, -1.2, 0}}};
  for (int n = 1; n < 5; ++n) made.bones.push_back({"", 0, n, {}});
  const TriangleMesh mesh = thickened(made, {0.45, 0.4, 0.18, 0.18, 0.4}, 0.1, 0.1);
  const auto has_node_near = [](const Skeleton& skeleton, const Vec3& place, double distance) {
    return std::any_of(skeleton.nodes.begin(), skeleton.nodes.end(),
                       [&](const Node& node) { return (node.position - place).norm() < distance; });
  };
  const Skeleton posable = skeletonized(mesh).skeleton;
  for (const double x : {-1.7, 1.7}) EXPECT_TRUE(has_node_near(posable, {x, 0, 0}, 0.4)) << x;
  EXPECT_FALSE(has_node_near(posable, {0, 0.8, 0}, 0.3)) << "short limbs have no joint";
  EXPECT_EQ(errors_of(mesh, posable), "");
}

TEST(Skeletonize, ScaleAndPlaceOfTheMeshDoNotMatter) {
  Shape shape = creature_shape();
  const std::size_t bones = skeletonized(shape.mesh).skeleton.bones.size();
  for (Vec3& p : shape.mesh.positions) p = 1e-3 * p + Vec3(3, -2, 1);
  const SkeletonizeResult result = skeletonized(shape.mesh);
  EXPECT_NEAR(static_cast<double>(result.skeleton.bones.size()), static_cast<double>(bones), 2);
  EXPECT_EQ(errors_of(shape.mesh, result.skeleton), "");
  // Candidates are compared with the mesh where it is, and not where it would be at size 1.
  EXPECT_GT(result.candidates.at(result.chosen).error, 0);
  EXPECT_LT(result.candidates.at(result.chosen).error, 0.01);
}

TEST(Skeletonize, TheNumberOfBonesIsALimit) {
  const Shape shape = creature_shape();
  for (const int most : {1, 5}) {
    SkeletonizeOptions options;
    options.most_bones = most;
    const SkeletonizeResult result = skeletonized(shape.mesh, options);
    EXPECT_LE(static_cast<int>(result.skeleton.bones.size()), most);
    EXPECT_GE(static_cast<int>(result.skeleton.bones.size()), most - 2);
    EXPECT_EQ(errors_of(shape.mesh, result.skeleton), "");
  }
}

TEST(Skeletonize, RingsOfManyBonesAreThinnedWithoutCrossings) {
  const Shape shape = torus_shape(40);
  const TriangleTree tree = build_triangle_tree(shape.mesh);
  const Surface surface(shape.mesh, tree);
  Repair repair(surface, shape.skeleton);
  ASSERT_TRUE(repair.run());
  repair.thin_out();
  const Skeleton& thinned = repair.skeleton();
  EXPECT_LT(thinned.bones.size(), 12u);
  EXPECT_EQ(thinned.bones.size(), thinned.nodes.size()) << "not a ring";
  for (const BoneMargin& margin : repair.margins()) EXPECT_GE(margin.margin, kEnoughMargin);
  EXPECT_EQ(errors_of(shape.mesh, thinned), "");
}

TEST(Skeletonize, WheelsGetAnEvenRing) {
  for (const NamedShape& shape : all_shapes()) {
    const TriangleTree tree = build_triangle_tree(shape.shape.mesh);
    const Surface surface(shape.shape.mesh, tree);
    const VoxelBody body = make_fitting_body(surface, shape.genus);
    const CurveGraph graph = make_curve_graph(body, thin_body(body, std::vector<int>{}));
    const Skeleton ring = make_even_ring(surface, body, graph, 5);
    if (shape.genus != 1) {
      EXPECT_TRUE(ring.bones.empty()) << shape.name;
      continue;
    }
    // A torus about z of radii 2 and 0.5: corners are as far outside the circle as the middles of bones are inside.
    ASSERT_EQ(ring.bones.size(), 5) << shape.name;
    for (const Bone& bone : ring.bones) {
      const Vec3 &head = ring.nodes[bone.head].position, &tail = ring.nodes[bone.tail].position;
      EXPECT_NEAR(head.z(), 0, 0.03);
      EXPECT_NEAR(head.head<2>().norm(), 2.21, 0.05);
      EXPECT_NEAR((head - tail).norm(), 2 * 2.21 * std::sin(std::numbers::pi / 5), 0.06);
    }
  }
}

TEST(Skeletonize, SpoiltSkeletonsAreRepaired) {
  RandomNumbers random(7);
  for (const char* name : {"bear", "cactus"}) {
    const TestModel model = load_standard_model(name);
    const TriangleTree tree = build_triangle_tree(model.mesh);
    const double diagonal = bounding_box(model.mesh).diagonal();
    int wrong = 0;
    for (int i = 0; i < 4; ++i) {
      const Skeleton skeleton = spoilt(model.skeleton, 0.05 * diagonal, random);
      wrong += !errors_of(model.mesh, skeleton).empty();
      const RepairResult repaired = repair_skeleton(context(), model.mesh, tree, skeleton);
      EXPECT_EQ(errors_of(model.mesh, repaired.skeleton), "") << name << " " << i;
      EXPECT_FALSE(repaired.changes.empty());
    }
    EXPECT_GT(wrong, 0) << name << ": nothing was spoilt";
  }
}

TEST(Skeletonize, RepairKeepsNodesNearTheirPlaces) {
  const TestModel bear = load_standard_model("bear");
  const TriangleTree tree = build_triangle_tree(bear.mesh);
  const Surface surface(bear.mesh, tree);
  RandomNumbers random(3);
  double freely = 0, near_places = 0, moved_back = 0;
  for (int i = 0; i < 12; ++i) {
    const Skeleton start = spoilt(bear.skeleton, 0.025 * surface.diagonal, random);
    const auto way = [&](const Repair& repair) {
      double sum = 0;
      for (const Node& node : repair.skeleton().nodes)
        for (const Node& before : start.nodes)
          if (before.name == node.name) sum += (before.position - node.position).norm();
      return sum;
    };
    Repair free(surface, start), kept(surface, start, start);
    free.run();
    kept.run();
    freely += way(free);
    near_places += way(kept);
    kept.move_back();
    moved_back += way(kept);
    for (const BoneMargin& margin : kept.margins()) EXPECT_GE(margin.margin, kEnoughMargin);
  }
  EXPECT_GT(freely, 0);
  EXPECT_LT(near_places, 0.9 * freely);
  EXPECT_LT(moved_back, 0.9 * near_places);
}

TEST(Skeletonize, RepairMakesNoBoneWithoutLength) {
  // Nodes that are moved to the middle of a voxel, and bones between them that are bent on their way through voxels.
  const TestModel man = load_standard_model("man");
  RandomNumbers random(4);
  const Skeleton skeleton = spoilt(man.skeleton, 0.05 * bounding_box(man.mesh).diagonal(), random);
  const RepairResult repaired = repair_skeleton(context(), man.mesh, build_triangle_tree(man.mesh), skeleton);
  EXPECT_EQ(errors_of(man.mesh, repaired.skeleton), "");
}

TEST(Skeletonize, RelaxationTakesWhatMarginsLackAway) {
  // Every bone is four, as in rigs with many in a thick body.
  const TestModel bear = load_standard_model("bear");
  const TriangleTree tree = build_triangle_tree(bear.mesh);
  const Surface surface(bear.mesh, tree);
  Skeleton rig = bear.skeleton;
  for (int round = 0; round < 2; ++round)
    for (int b = static_cast<int>(rig.bones.size()) - 1; b >= 0; --b) {
      const std::string number = std::to_string(rig.nodes.size());
      rig.nodes.push_back(
          {"middle_" + number, 0.5 * (end_position(rig, b, BoneEnd::kHead) + end_position(rig, b, BoneEnd::kTail))});
      rig.bones.push_back({"half_" + number, static_cast<int>(rig.nodes.size()) - 1, rig.bones[b].tail, {}});
      rig.bones[b].tail = static_cast<int>(rig.nodes.size()) - 1;
    }
  RandomNumbers random(11);
  rig = spoilt(rig, 0.015 * surface.diagonal, random);
  Repair repair(surface, rig, rig);
  const auto lack = [&] {
    double sum = 0;
    for (const BoneMargin& margin : repair.margins()) sum += std::max(0.0, kEnoughMargin - margin.margin);
    return sum;
  };
  const double before = lack();
  repair.relax();
  EXPECT_LT(lack(), 0.1 * before);
  EXPECT_GT(repair.skeleton().bones.size(), 0.6 * static_cast<double>(rig.bones.size()));
  const std::vector<Node>& nodes = repair.skeleton().nodes;
  for (const Bone& bone : repair.skeleton().bones)
    EXPECT_FALSE(surface.is_between(nodes[bone.head].position, nodes[bone.tail].position));
}

bool has_bone(const Skeleton& skeleton, const std::string& name) {
  return std::any_of(skeleton.bones.begin(), skeleton.bones.end(), [&](const Bone& b) { return b.name == name; });
}

TEST(Skeletonize, RepairTakesSmallBonesOutOfACrowdedNodeFirst) {
  // As the bones of a face, which all begin in one node of a rig.
  const Shape shape = y_shape();
  Skeleton rig = shape.skeleton;
  rig.nodes.push_back({"throat", {0, -0.6, 0}});
  rig.bones[0].tail = 4;
  rig.bones.push_back({"neck", 4, 0, {}});
  for (int i = 0; i < 8; ++i) {
    const double angle = 0.8 * i;
    rig.nodes.push_back(
        {"face_" + std::to_string(i) + "_tip", Vec3(0.3 * std::cos(angle), -0.2, 0.3 * std::sin(angle))});
    rig.bones.push_back({"face_" + std::to_string(i), 0, static_cast<int>(rig.nodes.size()) - 1, {}});
  }
  ASSERT_NE(errors_of(shape.mesh, rig), "");
  const TriangleTree tree = build_triangle_tree(shape.mesh);
  const Surface surface(shape.mesh, tree);
  Repair repair(surface, rig, rig);
  const auto neck_margin = [&] {
    for (std::size_t b = 0; b < repair.margins().size(); ++b)
      if (repair.skeleton().bones[b].name == "neck") return repair.margins()[b].margin;
    return -99.0;
  };
  const double before = neck_margin();
  repair.drop_minor_limbs();
  EXPECT_LT(repair.skeleton().bones.size(), rig.bones.size());
  EXPECT_GT(neck_margin(), before + 0.5);
  const RepairResult repaired = repair_skeleton(context(), shape.mesh, tree, rig);
  EXPECT_EQ(errors_of(shape.mesh, repaired.skeleton), "");
  for (const char* bone : {"stem", "neck", "left", "right"}) {
    EXPECT_TRUE(has_bone(repair.skeleton(), bone)) << bone;
    EXPECT_TRUE(has_bone(repaired.skeleton, bone)) << bone;
  }
}

TEST(Skeletonize, RepairCutsLimbsThatEndInAnotherPart) {
  // A hairpin; a bone from one of its legs ends beside the other leg.
  Skeleton hairpin;
  hairpin.nodes = {
      {"a_tip", {0, 3, 0}}, {"a", {0, 0, 0}}, {"bow", {0.7, -0.7, 0}}, {"b", {1.4, 0, 0}}, {"b_tip", {1.4, 3, 0}}};
  hairpin.bones = {{"a", 0, 1, {}}, {"bow_a", 1, 2, {}}, {"bow_b", 2, 3, {}}, {"b", 3, 4, {}}};
  const TriangleMesh mesh = thickened(hairpin, {0.4, 0.4, 0.4, 0.4, 0.4}, 0.1, 0.12);
  Skeleton rig = hairpin;
  rig.nodes.push_back({"thumb", {0.2, 2.7, 0}});
  rig.nodes.push_back({"thumb_tip", {0.85, 2.7, 0}});
  rig.nodes[0].position.y() = 2.5;
  rig.bones.push_back({"hand", 0, 5, {}});
  rig.bones.push_back({"thumb", 5, 6, {}});
  const RepairResult repaired = repair_skeleton(context(), mesh, build_triangle_tree(mesh), rig);
  EXPECT_EQ(errors_of(mesh, repaired.skeleton), "");
  for (const Bone& bone : hairpin.bones) EXPECT_TRUE(has_bone(repaired.skeleton, bone.name)) << bone.name;
  const double diagonal = bounding_box(mesh).diagonal();
  for (std::size_t n = 0; n < 5; ++n)
    for (const Node& node : repaired.skeleton.nodes) {
      if (node.name != rig.nodes[n].name) continue;
      EXPECT_LT((node.position - rig.nodes[n].position).norm(), 0.03 * diagonal) << node.name;
    }
}

TEST(Skeletonize, ContractionShortensALimbThatCannotBeMadeStraight) {
  // A hooked limb: its first bone is in the way, and no bone from the hub reaches around the corner.
  Skeleton hooked;
  hooked.nodes = {
      {"hub", {0, 0, 0}}, {"left", {-2.5, 0, 0}}, {"right", {2.5, 0, 0}}, {"knee", {0, 3, 0}}, {"foot", {3, 3, 0}}};
  hooked.bones = {{"left", 0, 1, {}}, {"right", 0, 2, {}}, {"thigh", 0, 3, {}}, {"shin", 3, 4, {}}};
  const TriangleMesh mesh = thickened(hooked, {0.4, 0.4, 0.4, 0.4, 0.4}, 0.1, 0.12);
  const TriangleTree tree = build_triangle_tree(mesh);
  const Surface surface(mesh, tree);
  Repair repair(surface, hooked);
  ASSERT_TRUE(repair.contract(2));
  for (const char* bone : {"left", "right", "thigh"}) EXPECT_TRUE(has_bone(repair.skeleton(), bone)) << bone;
  EXPECT_FALSE(has_bone(repair.skeleton(), "shin"));
}

TEST(Skeletonize, LevelsThatLoseLimbsOrTakeTooLongAreGivenUp) {
  const auto given_up = [](const SkeletonizeResult& result, const char* reason) {
    std::vector<SkeletonCandidate> found;
    std::copy_if(result.candidates.begin(), result.candidates.end(), std::back_inserter(found),
                 [&](const SkeletonCandidate& c) { return c.refusal.find(reason) != std::string::npos; });
    return found;
  };
  const SkeletonizeResult elephant = skeletonized(read_mesh(SKELETEX_SOURCE_DIR "/build/meshes/elephant.off").mesh);
  EXPECT_EQ(given_up(elephant, "takes too long").size(), 1u);
  const SkeletonizeResult elk = skeletonized(read_mesh(SKELETEX_SOURCE_DIR "/build/meshes/elk.off").mesh);
  const std::vector<SkeletonCandidate> losing = given_up(elk, "fewer limbs");
  EXPECT_GE(losing.size(), 1u);
  for (const SkeletonCandidate& candidate : losing)
    EXPECT_LT(candidate.limbs, elk.candidates[elk.chosen].limbs) << candidate.name;
}

TEST(Skeletonize, RepairEndsFreeBonesInsideTheBody) {
  const Shape shape = y_shape();
  Skeleton rig = shape.skeleton;
  const int left = 2;
  ASSERT_EQ(rig.nodes[left].name, "left");
  rig.nodes[left].position *= 1.8;  // beyond the end of its limb
  const RepairResult repaired = repair_skeleton(context(), shape.mesh, build_triangle_tree(shape.mesh), rig);
  EXPECT_EQ(errors_of(shape.mesh, repaired.skeleton), "");
  ASSERT_EQ(repaired.skeleton.bones.size(), 3u);
  const Vec3& end = repaired.skeleton.nodes[left].position;
  EXPECT_LT(end.cross(rig.nodes[left].position).norm(), 1e-6) << "it left its bone's line";
  EXPECT_GT(end.norm(), 0.7 * shape.skeleton.nodes[left].position.norm());
}

TEST(Skeletonize, AGoodSkeletonIsNotChangedByRepair) {
  const Shape shape = y_shape();
  const RepairResult repaired = repair_skeleton(context(), shape.mesh, build_triangle_tree(shape.mesh), shape.skeleton);
  EXPECT_TRUE(repaired.changes.empty()) << repaired.changes.front();
  EXPECT_EQ(skeleton_to_json(repaired.skeleton), skeleton_to_json(shape.skeleton));
}

TEST(Skeletonize, AThinShellWithHandlesGetsASkeleton) {
  const TriangleMesh mesh = read_mesh(SKELETEX_SOURCE_DIR "/build/meshes/helmet.off").mesh;
  const Skeleton skeleton = skeletonized(mesh).skeleton;
  EXPECT_EQ(genus_of(mesh), 3);
  EXPECT_EQ(skeleton.bones.size() - skeleton.nodes.size() + 1, 3u);
  EXPECT_EQ(errors_of(mesh, skeleton), "");
}

/// Rings of fewer bones can give a smaller error.
TEST(Skeletonize, RingsAreTriedWithFewerBones) {
  const TriangleMesh mesh = read_mesh(SKELETEX_SOURCE_DIR "/build/meshes/eight.off").mesh;
  const SkeletonizeResult result = skeletonized(mesh);
  const SkeletonCandidate &first = result.candidates.front(), &chosen = result.candidates[result.chosen];
  EXPECT_LT(chosen.bones, first.bones);
  EXPECT_LT(chosen.error, first.error);
  EXPECT_EQ(result.skeleton.bones.size() - result.skeleton.nodes.size() + 1, 2u);
  EXPECT_EQ(errors_of(mesh, result.skeleton), "");
}

/// A candidate that is not the best without joints can be the best with them.
TEST(Skeletonize, JointsAreTriedInMoreThanOneCandidate) {
  const SkeletonizeResult result = skeletonized(load_standard_model("triceratops").mesh);
  const SkeletonCandidate& chosen = result.candidates[result.chosen];
  EXPECT_NE(chosen.name.find(", joints"), std::string::npos) << chosen.name;
  for (const SkeletonCandidate& candidate : result.candidates)
    if (candidate.refusal.empty()) {
      EXPECT_GE(candidate.error, chosen.error) << candidate.name;
    }
}

TEST(Skeletonize, LargeMeshesAreTriedCoarseAndAcceptedWhole) {
  const TriangleMesh mesh = capsule_shape(2, 0.5, 500, 360).mesh;
  ASSERT_GT(mesh.triangles.size(), 350'000u);
  const SkeletonizeResult result = skeletonized(mesh);
  EXPECT_EQ(errors_of(mesh, result.skeleton), "");
  for (const SkeletonCandidate& candidate : result.candidates) {
    EXPECT_EQ(candidate.refusal, "") << candidate.name;
    EXPECT_GT(candidate.error, 0) << candidate.name;
    EXPECT_LT(candidate.error, 1e-3) << candidate.name;
  }
}

TEST(Skeletonize, CoarseMeshesKeepTheirShapeAndHandles) {
  const TestModel model = load_standard_model("eight");
  const TriangleMesh coarse = make_coarse_mesh(model.mesh, 200);
  EXPECT_EQ(coarse.positions.size(), 200u);
  EXPECT_TRUE(measure_manifold(coarse).is_closed_manifold());
  EXPECT_EQ(genus_of(coarse), 2);
  EXPECT_LT(symmetric_mean(measure_metro(context(), model.mesh, coarse, {.samples = 20'000})), 5e-3);
}

TEST(Skeletonize, BodiesOfTooManyHandlesAreRefused) {
  const TriangleMesh mesh = read_mesh(SKELETEX_SOURCE_DIR "/build/meshes/cheese.off").mesh;
  ASSERT_GT(genus_of(mesh), 100);
  EXPECT_THROW(skeletonized(mesh), TopologyError);
}

TEST(Skeletonize, RepairRefusesWhatNoMoveMends) {
  const Shape torus = torus_shape();
  const TriangleTree tree = build_triangle_tree(torus.mesh);
  Skeleton open = torus.skeleton;
  open.bones.pop_back();
  EXPECT_THROW(repair_skeleton(context(), torus.mesh, tree, open), TopologyError);
  Skeleton far = torus.skeleton;
  for (Node& node : far.nodes) node.position *= 1000;
  EXPECT_THROW(repair_skeleton(context(), torus.mesh, tree, far), InputError);
}

}  // namespace skeletex
