// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <limits>
#include <optional>
#include <regex>
#include <set>

#include "skeletex/analysis/findings.h"
#include "skeletex/analysis/manifold.h"
#include "skeletex/analysis/surface_probe.h"
#include "skeletex/analysis/validate_input.h"
#include "skeletex/convert/encode_model.h"
#include "skeletex/model/error.h"
#include "support/load_model.h"
#include "support/shapes.h"

namespace skeletex {
namespace {

ClContext& context() {
  static ClContext instance;
  return instance;
}

std::vector<Finding> validated(TriangleMesh mesh, const Skeleton& skeleton) {
  return validate_input(context(), mesh, skeleton);
}

std::string text_of(const std::vector<Finding>& findings) {
  std::string text;
  for (const Finding& f : findings)
    text += std::string(f.severity == Severity::kError     ? "error"
                        : f.severity == Severity::kWarning ? "warning"
                                                           : "note") +
            " [" + f.rule + "] " + f.message + ". " + f.remedy + ".\n";
  return text;
}

/// The first finding of a kind; a failure when there is none.
Finding finding(const std::vector<Finding>& findings, const std::string& rule) {
  for (const Finding& f : findings)
    if (f.rule == rule) return f;
  ADD_FAILURE() << "no finding \"" << rule << "\" in:\n" << text_of(findings);
  return {Severity::kNote, "", "", ""};
}

std::set<std::string> rules(const std::vector<Finding>& findings) {
  std::set<std::string> all;
  for (const Finding& f : findings) all.insert(f.rule);
  return all;
}

/// The last point that a text names.
Vec3 point_in(const std::string& text) {
  const std::regex triple(R"(\(([-+.e\d]+), ([-+.e\d]+), ([-+.e\d]+)\))");
  Vec3 point(std::numeric_limits<double>::quiet_NaN(), 0, 0);
  for (std::sregex_iterator it(text.begin(), text.end(), triple), end; it != end; ++it)
    point = Vec3(std::stod((*it)[1]), std::stod((*it)[2]), std::stod((*it)[3]));
  return point;
}

bool mentions(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

#define EXPECT_MENTIONS(text, part) EXPECT_PRED2(mentions, text, part)

TriangleMesh joined(const TriangleMesh& a, const TriangleMesh& b, const Vec3& offset) {
  TriangleMesh mesh = a;
  const int base = static_cast<int>(a.positions.size());
  for (const Vec3& p : b.positions) mesh.positions.push_back(p + offset);
  for (const Triangle& t : b.triangles) mesh.triangles.push_back({t[0] + base, t[1] + base, t[2] + base});
  return mesh;
}

/// A capsule along z from -1.5 to 1.5 with radius 0.5, and two bones in a line.
Shape two_bones() {
  Shape shape = capsule_shape();
  shape.skeleton = {};
  shape.skeleton.nodes = {{"low", {0, 0, -1}}, {"middle", {0.05, 0, 0}}, {"high", {0, 0, 1}}};
  shape.skeleton.bones = {{"lower", 0, 1, {}}, {"upper", 1, 2, {}}};
  return shape;
}

}  // namespace

TEST(Validate, SharesOfTheDiagonalAreWrittenWithoutExponent) {
  EXPECT_EQ(text_of_distance(2.5, 2), "2.5 (125 % of the diagonal)");
  EXPECT_EQ(text_of_distance(0.05, 2), "0.05 (2.5 % of the diagonal)");
}

TEST(Validate, GeneratedShapesHaveNothingWrong) {
  EXPECT_EQ(text_of(validated(two_bones().mesh, two_bones().skeleton)), "");
  for (const NamedShape& shape : all_shapes())
    EXPECT_EQ(text_of(validated(shape.shape.mesh, shape.shape.skeleton)), "") << shape.name;
}

TEST(Validate, StandardModelsHaveNoErrors) {
  for (const char* name :
       {"bear", "bunny00", "armadillo", "man", "camel", "cow", "eight", "double_torus", "knot1", "pinion"}) {
    const TestModel model = load_standard_model(name);
    const auto findings = validated(model.mesh, model.skeleton);
    EXPECT_FALSE(has_errors(findings)) << name << ":\n" << text_of(findings);
    for (const Finding& f : findings) EXPECT_EQ(f.rule, "self-intersection") << name << ": " << f.message;
  }
}

TEST(Validate, SelfIntersectionsOfAClosedMeshAreCountedAndNoError) {
  const TestModel man = load_standard_model("man");
  const auto findings = validated(man.mesh, man.skeleton);
  const Finding f = finding(findings, "self-intersection");
  EXPECT_EQ(f.severity, Severity::kWarning);
  EXPECT_MENTIONS(f.message, "848 pairs");
  EXPECT_FALSE(has_errors(findings));
}

TEST(Validate, AMeshInsideOutIsTurnedAndSaidSo) {
  Shape shape = two_bones();
  const TriangleMesh outward = shape.mesh;
  for (Triangle& t : shape.mesh.triangles) std::swap(t[0], t[2]);
  const auto findings = validate_input(context(), shape.mesh, shape.skeleton);
  EXPECT_EQ(rules(findings), std::set<std::string>{"orientation"});
  EXPECT_EQ(findings[0].severity, Severity::kNote);
  EXPECT_MENTIONS(findings[0].message, "inside out");
  EXPECT_NEAR(signed_volume(shape.mesh), signed_volume(outward), 1e-12);
}

TEST(Validate, TheTreeItHandsOverIsThatOfTheMeshAsItIsThen) {
  Shape shape = two_bones();
  for (Triangle& t : shape.mesh.triangles) std::swap(t[0], t[2]);
  std::optional<TriangleTree> tree;
  validate_before_segmentation(shape.mesh, shape.skeleton, &tree);
  ASSERT_TRUE(tree);
  const TriangleTree expected = build_triangle_tree(shape.mesh);
  EXPECT_EQ(tree->order, expected.order);
  EXPECT_EQ(tree->points, expected.points);
  EXPECT_EQ(tree->boxes, expected.boxes);

  const TestModel bear = load_standard_model("bear");
  const TriangleTree of_bear = build_triangle_tree(bear.mesh);
  EncodeOptions options;
  options.width = options.height = 40, options.has_snap = true;
  const DisplacementTexture texels = encode_model(context(), bear.mesh, bear.skeleton, options).model.texture;
  options.tree = &of_bear;
  const DisplacementTexture same = encode_model(context(), bear.mesh, bear.skeleton, options).model.texture;
  EXPECT_EQ(same.along, texels.along);
  EXPECT_EQ(same.around, texels.around);
  EXPECT_EQ(same.out, texels.out);
  options.tree = &expected;
  EXPECT_THROW(encode_model(context(), bear.mesh, bear.skeleton, options), InputError);
}

TEST(Validate, AHoleIsFoundWithItsPlace) {
  Shape shape = two_bones();
  // A triangle in the middle of the tube.
  const auto hit = std::min_element(shape.mesh.triangles.begin(), shape.mesh.triangles.end(),
                                    [&](const Triangle& a, const Triangle& b) {
                                      return (shape.mesh.positions[a[0]] - Vec3(0.5, 0, 0)).norm() <
                                             (shape.mesh.positions[b[0]] - Vec3(0.5, 0, 0)).norm();
                                    });
  shape.mesh.triangles.erase(hit);
  const auto findings = validated(shape.mesh, shape.skeleton);
  EXPECT_EQ(rules(findings), std::set<std::string>{"closed"}) << "nodes and bones are judged all the same:\n"
                                                              << text_of(findings);
  const Finding f = finding(findings, "closed");
  EXPECT_EQ(f.severity, Severity::kError);
  EXPECT_MENTIONS(f.message, "3 edges");
  EXPECT_MENTIONS(f.message, "1 boundary loop");
  EXPECT_LT((point_in(f.message) - Vec3(0.5, 0, 0)).norm(), 0.2);
}

TEST(Validate, VerticesThatAreNotMergedAreTheRemedyForManyHoles) {
  const Shape shape = two_bones();
  TriangleMesh apart;
  for (const Triangle& t : shape.mesh.triangles) {
    const int base = static_cast<int>(apart.positions.size());
    for (const int v : t) apart.positions.push_back(shape.mesh.positions[v]);
    apart.triangles.push_back({base, base + 1, base + 2});
  }
  const auto findings = validated(apart, shape.skeleton);
  EXPECT_MENTIONS(finding(findings, "closed").remedy, "merge vertices");
  EXPECT_MENTIONS(finding(findings, "components").message, std::to_string(shape.mesh.triangles.size()) + " components");
}

TEST(Validate, SeveralComponentsAreListedBySize) {
  const Shape shape = two_bones();
  const auto findings = validated(joined(shape.mesh, capsule_shape(1, 0.2, 8, 6).mesh, Vec3(7, 8, 9)), shape.skeleton);
  const Finding f = finding(findings, "components");
  EXPECT_MENTIONS(f.message, "2 components: " + std::to_string(shape.mesh.triangles.size()) + " triangles");
  EXPECT_LT((point_in(f.message) - Vec3(7, 8, 9)).norm(), 0.3);
  EXPECT_FALSE(rules(findings).contains("genus")) << "handles are counted for one body only";
}

TEST(Validate, EdgesAndVerticesOfTooManySheetsAreFound) {
  Shape shape = two_bones();
  TriangleMesh fin = shape.mesh;
  const Triangle t = fin.triangles[100];
  fin.positions.emplace_back(4, 4, 4);
  fin.triangles.push_back({t[0], t[1], static_cast<int>(fin.positions.size()) - 1});
  const auto with_fin = validated(fin, shape.skeleton);
  EXPECT_MENTIONS(finding(with_fin, "manifold").message,
                  "vertices " + std::to_string(std::min(t[0], t[1])) + " and " + std::to_string(std::max(t[0], t[1])));

  // Two bodies that share one vertex.
  TriangleMesh pair = joined(shape.mesh, capsule_shape(1, 0.2, 8, 6).mesh, Vec3(7, 8, 9));
  const int base = static_cast<int>(shape.mesh.positions.size());
  for (Triangle& triangle : pair.triangles)
    for (int& v : triangle)
      if (v == base + 3) v = 42;
  const auto touching = validated(pair, shape.skeleton);
  EXPECT_MENTIONS(finding(touching, "manifold").message, "vertex 42");
  EXPECT_EQ(finding(touching, "unreferenced").severity, Severity::kWarning);
}

TEST(Validate, TurnedTrianglesAreCountedAndTheInsideIsStillKnown) {
  Shape shape = two_bones();
  for (const int t : {30, 31, 400}) std::swap(shape.mesh.triangles[t][0], shape.mesh.triangles[t][1]);
  const auto findings = validated(shape.mesh, shape.skeleton);
  EXPECT_EQ(rules(findings), std::set<std::string>{"orientation"}) << text_of(findings);
  EXPECT_EQ(findings[0].severity, Severity::kError);
  EXPECT_MENTIONS(findings[0].message, "3 of " + std::to_string(shape.mesh.triangles.size()));
  EXPECT_MENTIONS(findings[0].message, "triangle 30 at");
}

TEST(Validate, AMoebiusStripHasOneSide) {
  TriangleMesh strip;
  const int n = 12;
  for (int i = 0; i < n; ++i) {
    const double a = 2 * 3.14159265358979 * i / n;
    const Vec3 across = Vec3(std::cos(a) * std::cos(a / 2), std::sin(a) * std::cos(a / 2), std::sin(a / 2));
    strip.positions.push_back(Vec3(2 * std::cos(a), 2 * std::sin(a), 0) + 0.5 * across);
    strip.positions.push_back(Vec3(2 * std::cos(a), 2 * std::sin(a), 0) - 0.5 * across);
  }
  for (int i = 0; i < n; ++i) {
    const int a = 2 * i, b = 2 * i + 1, c = i + 1 < n ? 2 * i + 2 : 1, d = i + 1 < n ? 2 * i + 3 : 0;
    strip.triangles.push_back({a, c, b});
    strip.triangles.push_back({b, c, d});
  }
  EXPECT_MENTIONS(finding(validated(strip, two_bones().skeleton), "orientation").message, "one side only");
}

TEST(Validate, NumbersThatAreNoneAndTrianglesThatAreNoneDoNotHideTheRest) {
  Shape shape = two_bones();
  shape.mesh.positions[17].y() = std::numeric_limits<double>::quiet_NaN();
  shape.mesh.triangles.push_back({5, 5, 6});
  shape.mesh.triangles.push_back({5, 6, 123456});
  shape.mesh.positions.emplace_back(0, 0, 0);
  shape.skeleton.nodes[2].position = Vec3(0, 0, 1.9);
  const auto findings = validated(shape.mesh, shape.skeleton);
  EXPECT_MENTIONS(finding(findings, "finite").message, "vertex 17");
  EXPECT_MENTIONS(finding(findings, "degenerate").message, "2 triangles");
  EXPECT_MENTIONS(finding(findings, "node-inside").message, "node \"high\"");
  EXPECT_EQ(finding(findings, "unreferenced").severity, Severity::kWarning);
}

TEST(Validate, TrianglesWithoutAreaAreAWarning) {
  Shape shape = two_bones();
  // A vertex on the middle of an edge of one side: its triangle is a line.
  const Triangle t = shape.mesh.triangles[200];
  const int v = static_cast<int>(shape.mesh.positions.size());
  shape.mesh.positions.push_back(0.5 * (shape.mesh.positions[t[0]] + shape.mesh.positions[t[1]]));
  shape.mesh.triangles[200] = {t[0], v, t[2]};
  shape.mesh.triangles.push_back({v, t[1], t[2]});
  shape.mesh.triangles.push_back({t[0], t[1], v});
  ASSERT_TRUE(measure_manifold(shape.mesh).is_closed_manifold());
  const auto findings = validated(shape.mesh, shape.skeleton);
  EXPECT_EQ(finding(findings, "area").severity, Severity::kWarning);
  EXPECT_MENTIONS(finding(findings, "area").message, "triangle " + std::to_string(shape.mesh.triangles.size() - 1));
}

TEST(Validate, ANodeOutsideIsNamedAndItsRemedyHeals) {
  Shape shape = two_bones();
  shape.skeleton.nodes[2].position = Vec3(0, 0, 1.75);  // the cap ends at 1.5
  auto findings = validated(shape.mesh, shape.skeleton);
  const Finding f = finding(findings, "node-inside");
  EXPECT_MENTIONS(f.message, "node \"high\" at (0, 0, 1.75)");
  EXPECT_MENTIONS(f.message, "0.25 (");
  EXPECT_MENTIONS(f.remedy, "more than 0.25 towards");
  EXPECT_MENTIONS(finding(findings, "bone-crossing").message, "bone \"upper\"");
  EXPECT_MENTIONS(finding(findings, "bone-crossing").remedy, "node \"high\"");
  shape.skeleton.nodes[2].position = point_in(f.remedy);
  EXPECT_FALSE(rules(validated(shape.mesh, shape.skeleton)).contains("node-inside"));

  shape = two_bones();
  shape.skeleton.nodes[1].position = Vec3(0.8, 0, 0.1);
  findings = validated(shape.mesh, shape.skeleton);
  shape.skeleton.nodes[1].position = point_in(finding(findings, "node-inside").remedy);
  EXPECT_EQ(text_of(validated(shape.mesh, shape.skeleton)), "");
}

TEST(Validate, ANodeOnTheSurfaceIsNotInside) {
  Shape shape = two_bones();
  shape.skeleton.nodes[1].position = shape.mesh.positions[300];
  const Finding f = finding(validated(shape.mesh, shape.skeleton), "node-inside");
  EXPECT_MENTIONS(f.message, "on the surface");
  shape.skeleton.nodes[1].position = point_in(f.remedy);
  EXPECT_FALSE(rules(validated(shape.mesh, shape.skeleton)).contains("node-inside"));
}

TEST(Validate, ASkeletonInAnotherFrameIsSuspectedAsOne) {
  Shape shape = two_bones();
  for (Node& node : shape.skeleton.nodes) node.position = 100 * node.position + Vec3(500, 0, 0);
  const auto findings = validated(shape.mesh, shape.skeleton);
  EXPECT_MENTIONS(finding(findings, "frame").remedy, "units, axes and origin");
  EXPECT_EQ(rules(findings), std::set<std::string>{"frame"}) << "one message, not one per node";
}

TEST(Validate, ABoneThroughTheSurfaceIsShownWithAllItsCrossings) {
  // A ring's bone that cuts across the hole.
  Shape shape = torus_shape(6);
  const int a = shape.skeleton.bones[0].head, b = shape.skeleton.bones[2].tail;
  shape.skeleton.bones.push_back({"chord", a, b, {}});
  const auto findings = validated(shape.mesh, shape.skeleton);
  const Finding f = finding(findings, "bone-crossing");
  EXPECT_MENTIONS(f.message, "bone \"chord\"");
  EXPECT_MENTIONS(f.message, "out at (");
  EXPECT_MENTIONS(f.message, "in at (");
  const SurfaceProbe probe(shape.mesh);
  EXPECT_GT(probe.winding_numbers(std::vector<Vec3>{point_in(f.remedy)}, true)[0], 0.99)
      << "the new node lies in the body: " << f.remedy;
  EXPECT_MENTIONS(finding(findings, "genus").message,
                  "1 handle (its genus), but the skeleton has 2 independent cycles");
  EXPECT_FALSE(rules(findings).contains("node-inside"));
}

TEST(Validate, TheBodysHolesMustBeTheSkeletonsRings) {
  Shape shape = torus_shape(6);
  shape.skeleton.bones.pop_back();
  const Finding f = finding(validated(shape.mesh, shape.skeleton), "genus");
  EXPECT_MENTIONS(f.message, "1 handle (its genus), but the skeleton has 0 independent cycles");
  EXPECT_MENTIONS(f.remedy, "close 1 more ring");
}

TEST(Validate, BonesOfNoLengthAreNamed) {
  Shape shape = two_bones();
  shape.skeleton.nodes.push_back({"twin", Vec3(0, 0, 1)});
  shape.skeleton.bones.push_back({"nothing", 2, 3, {}});
  shape.skeleton.bones.push_back({"loop", 1, 1, {}});
  const auto findings = validated(shape.mesh, shape.skeleton);
  EXPECT_MENTIONS(finding(findings, "bone-length").message, "bone \"nothing\" has no length");
  EXPECT_MENTIONS(text_of(findings), "bone \"loop\" begins and ends at node \"middle\"");
}

TEST(Validate, PartsOfASkeletonThatAreNotJoinedAreListed) {
  Shape shape = two_bones();
  shape.skeleton.nodes = {{"a", {0, 0, -1}}, {"b", {0, 0, -0.3}}, {"c", {0, 0, 0.3}}, {"d", {0, 0, 1}}};
  shape.skeleton.bones = {{"lower", 0, 1, {}}, {"upper", 2, 3, {}}};
  const Finding f = finding(validated(shape.mesh, shape.skeleton), "connected");
  EXPECT_MENTIONS(f.message, "2 parts");
  EXPECT_MENTIONS(f.remedy, "node \"b\" to node \"c\", which are 0.6 apart");
}

TEST(Validate, ANodeOfNoBoneIsAWarning) {
  Shape shape = two_bones();
  shape.skeleton.nodes.push_back({"spare", Vec3(9, 9, 9)});
  const auto findings = validated(shape.mesh, shape.skeleton);
  EXPECT_EQ(rules(findings), std::set<std::string>{"node-unused"}) << text_of(findings);
  EXPECT_FALSE(has_errors(findings));
}

TEST(Validate, BonesOnTopOfEachOtherAreNamed) {
  Shape shape = two_bones();
  shape.skeleton.bones.push_back({"again", 1, 0, {}});
  EXPECT_MENTIONS(finding(validated(shape.mesh, shape.skeleton), "bone-duplicate").message,
                  "bone \"lower\" and bone \"again\"");

  shape = two_bones();
  shape.skeleton.nodes.push_back({"here", Vec3(0, 0, 1)});
  shape.skeleton.nodes.push_back({"there", Vec3(0, 0.1, 1.2)});
  shape.skeleton.bones.push_back({"tip", 3, 4, {}});
  EXPECT_MENTIONS(finding(validated(shape.mesh, shape.skeleton), "node-duplicate").message,
                  "node \"high\" and node \"here\"");
}

TEST(Validate, BonesInOneDirectionHaveNoSeparationPlaneBetween) {
  Shape shape = two_bones();
  shape.skeleton.nodes.push_back({"beside", Vec3(0.02501, 0, 0.5)});
  shape.skeleton.bones.push_back({"shadow", 1, 3, {}});
  Finding f = finding(validated(shape.mesh, shape.skeleton), "bone-direction");
  EXPECT_EQ(f.severity, Severity::kError);
  EXPECT_MENTIONS(f.message, "node \"middle\"");
  shape.skeleton.nodes[3].position = Vec3(0.045, 0, 0.5);
  f = finding(validated(shape.mesh, shape.skeleton), "bone-direction");
  EXPECT_EQ(f.severity, Severity::kWarning);
  EXPECT_MENTIONS(f.message, "2.29 degrees");
}

TEST(Validate, BonesThatMeetWithoutANodeAreFound) {
  Shape shape = two_bones();
  shape.skeleton.nodes[1].position = Vec3(0, 0, 0);
  shape.skeleton.nodes.push_back({"left", Vec3(-0.3, 0, 0.5)});
  shape.skeleton.nodes.push_back({"right", Vec3(0.3, 0, 0.5)});
  shape.skeleton.bones.push_back({"bar", 3, 4, {}});
  const Finding f = finding(validated(shape.mesh, shape.skeleton), "bone-contact");
  EXPECT_MENTIONS(f.message, "bone \"upper\" and bone \"bar\"");
  EXPECT_LT((point_in(f.message) - Vec3(0, 0, 0.5)).norm(), 1e-9);
}

TEST(Validate, AnAngleAlongTheBoneIsNone) {
  Shape shape = two_bones();
  shape.skeleton.bones[0].s = Vec3(0.05, 0, 1);
  shape.skeleton.bones[1].s = Vec3(0, 0, 0);
  const auto findings = validated(shape.mesh, shape.skeleton);
  EXPECT_EQ(rules(findings), std::set<std::string>{"bone-angle"});
  EXPECT_EQ(findings.size(), 2u);
}

TEST(Validate, BadIndicesAndNumbersOfASkeletonAreNamed) {
  Shape shape = two_bones();
  shape.skeleton.bones[1].tail = 7;
  shape.skeleton.nodes[0].position.x() = std::numeric_limits<double>::infinity();
  const auto findings = validated(shape.mesh, shape.skeleton);
  EXPECT_MENTIONS(finding(findings, "bone-node").message, "bone \"upper\" ends at node 7");
  EXPECT_MENTIONS(finding(findings, "finite").message, "node \"low\"");
  EXPECT_TRUE(rules(validated(shape.mesh, {})).contains("empty"));
  EXPECT_TRUE(rules(validated({}, two_bones().skeleton)).contains("empty"));
}

TEST(Validate, AllSeparationPlanesThatCrossInsideTheBodyAreFoundAtOnce) {
  // Short bones in a fat body with sharp bends.
  Shape shape = two_bones();
  shape.skeleton.nodes = {
      {"a", {-0.2, 0, -0.1}}, {"b", {-0.1, 0, 0.1}}, {"c", {0.1, 0, 0.1}}, {"d", {0.2, 0, -0.1}}, {"e", {0.3, 0, 0.1}}};
  shape.skeleton.bones = {{"first", 0, 1, {}}, {"second", 1, 2, {}}, {"third", 2, 3, {}}, {"fourth", 3, 4, {}}};
  const auto findings = validated(shape.mesh, shape.skeleton);
  EXPECT_EQ(rules(findings), std::set<std::string>{"separation-planes"}) << text_of(findings);
  EXPECT_EQ(findings.size(), 2);
  for (const Finding& f : findings) {
    EXPECT_TRUE(f.bone == 1 || f.bone == 2) << f.bone;
    EXPECT_TRUE(f.position.has_value());
    EXPECT_FALSE(f.remedy.empty());
  }
}

TEST(Validate, EverythingIsSaidAtOnce) {
  Shape shape = two_bones();
  shape.mesh.triangles.erase(shape.mesh.triangles.begin() + 50);
  std::swap(shape.mesh.triangles[300][0], shape.mesh.triangles[300][1]);
  shape.mesh = joined(shape.mesh, capsule_shape(1, 0.2, 8, 6).mesh, Vec3(7, 8, 9));
  shape.mesh.positions.emplace_back(0, 0, 0);
  shape.skeleton.nodes[2].position = Vec3(0, 0, 2);
  shape.skeleton.nodes.push_back({"spare", Vec3(0, 0, 0.1)});
  shape.skeleton.bones.push_back({"again", 0, 1, {}});
  shape.skeleton.bones[0].s = Vec3::Zero();
  const std::set<std::string> expected{"closed",        "orientation", "components", "unreferenced",  "node-inside",
                                       "bone-crossing", "node-unused", "bone-angle", "bone-duplicate"};
  const auto findings = validated(shape.mesh, shape.skeleton);
  EXPECT_EQ(rules(findings), expected) << text_of(findings);
}

TEST(Validate, TheSurfaceProbeKnowsInsideNearestAndCrossings) {
  const TriangleMesh mesh = torus_shape().mesh;  // core radius 2, tube 0.5
  const SurfaceProbe probe(mesh);
  for (const bool is_closed : {true, false}) {
    const std::vector<double> windings =
        probe.winding_numbers(std::vector<Vec3>{{2, 0, 0}, {0, 0, 0}, {0, 2.3, 0.1}, {9, 9, 9}}, is_closed);
    EXPECT_NEAR(windings[0], 1, 1e-9);
    EXPECT_NEAR(windings[1], 0, 1e-9);
    EXPECT_NEAR(windings[2], 1, 1e-9);
    EXPECT_NEAR(windings[3], 0, 1e-9);
  }
  const NearestPoint nearest = probe.nearest(Vec3(2, 0, 1));
  EXPECT_NEAR(nearest.distance, 0.5, 0.01);
  EXPECT_GT(nearest.normal.z(), 0.95);
  const auto crossings = probe.crossings(Vec3(-4, 0.01, 0.02), Vec3(4, 0.01, 0.02));
  ASSERT_EQ(crossings.size(), 4u);
  const double expected[] = {-2.5, -1.5, 1.5, 2.5};
  for (int c = 0; c < 4; ++c) {
    EXPECT_NEAR(crossings[c].point.x(), expected[c], 0.02);
    EXPECT_EQ(crossings[c].is_leaving, c % 2 == 1);
  }
  // Through vertices of the mesh, where many triangles meet, still once each.
  EXPECT_EQ(probe.crossings(Vec3(-4, 0, 0), Vec3(4, 0, 0)).size(), 4u);
  EXPECT_LT((probe.middle_of_body(Vec3(2.5, 0, 0), Vec3(-1, 0, 0)) - Vec3(2, 0, 0)).norm(), 0.02);
}

TEST(Validate, IndependentCyclesAreCounted) {
  EXPECT_EQ(count_cycles(two_bones().skeleton), 0);
  EXPECT_EQ(count_cycles(torus_shape(5).skeleton), 1);
  EXPECT_EQ(count_cycles(theta_shape().skeleton), 2);
}

}  // namespace skeletex
