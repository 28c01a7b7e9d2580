// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>

#include "skeletex/analysis/manifold.h"
#include "skeletex/convert/encode_model.h"
#include "skeletex/convert/layers/surface_points.h"
#include "skeletex/io/gltf/read_gltf.h"
#include "skeletex/io/gltf/write_gltf.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/pose/pose_mesh.h"
#include "skeletex/reconstruct/pose/skin.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/rig/export_rig.h"
#include "skeletex/rig/import_rig.h"
#include "support/scratch.h"
#include "support/shapes.h"
#include "support/synthetic_model.h"

namespace skeletex {
namespace {

ClContext& device() {
  static ClContext context;
  return context;
}

SkeletexModel model_of(const Skeleton& skeleton, double radius) {
  return SyntheticSurface(skeleton, radius).model(std::vector<std::pair<int, int>>(skeleton.bones.size(), {24, 11}));
}

int bone_named(const Skeleton& skeleton, const std::string& name) {
  for (int i = 0; i < static_cast<int>(skeleton.bones.size()); ++i)
    if (skeleton.bones[i].name == name) return i;
  return -1;
}

ImportedRig imported(const GltfScene& scene) { return import_rig(scene, gltf_surface(scene, "test")); }

Pose turned(const Skeleton& skeleton, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1, 1);
  Pose pose;
  for (std::size_t i = 0; i < skeleton.bones.size(); ++i)
    pose.rotations.emplace_back(
        Eigen::AngleAxisd(0.8 * unit(random), Vec3(unit(random), unit(random), unit(random)).normalized()));
  pose.translation = Vec3(unit(random), unit(random), unit(random));
  return pose;
}

GltfScene exported(const SkeletexModel& model, const std::vector<NamedAnimation>& animations = {},
                   const Eigen::Quaterniond& placement = Eigen::Quaterniond::Identity()) {
  return export_rig(device(), model, {.name = "rig", .placement = placement, .animations = animations});
}

/// A rig without leaves of its own that a user may have: the same nodes by name in both skeletons.
void expect_same_skeleton(const Skeleton& expected, const Skeleton& actual, const Similarity& map, double tolerance) {
  ASSERT_EQ(actual.bones.size(), expected.bones.size());
  ASSERT_EQ(actual.nodes.size(), expected.nodes.size());
  for (int bone = 0; bone < static_cast<int>(expected.bones.size()); ++bone) {
    const int same = bone_named(actual, expected.bones[bone].name);
    ASSERT_GE(same, 0) << expected.bones[bone].name;
    const Vec3 a = map(end_position(expected, bone, BoneEnd::kHead)),
               b = map(end_position(expected, bone, BoneEnd::kTail));
    const Vec3 c = end_position(actual, same, BoneEnd::kHead), d = end_position(actual, same, BoneEnd::kTail);
    EXPECT_LT(std::min((a - c).norm() + (b - d).norm(), (a - d).norm() + (b - c).norm()), tolerance)
        << expected.bones[bone].name;
  }
}

TEST(RigImport, AnExportedModelComesBackWithSkeletonWeightsAndPoses) {
  for (const auto& [name, skeleton] :
       std::vector<std::pair<const char*, Skeleton>>{{"chain", chain(4)}, {"tree", random_tree(9, 3)}}) {
    SCOPED_TRACE(name);
    const SkeletexModel model = model_of(skeleton, 0.15);
    PoseAnimation animation;
    for (unsigned i = 0; i < 3; ++i) animation.frames.push_back({0.5 * i, turned(model.skeleton, i)});
    const ScratchFolder folder;
    write_gltf(folder / "rig.glb", exported(model, {{"dance", animation}}));
    const GltfScene scene = read_gltf(folder / "rig.glb");
    const GltfSurface surface = gltf_surface(scene, "rig.glb");
    const TriangleMesh bind = reconstruct_mesh(device(), model);
    EXPECT_TRUE(measure_manifold(surface.mesh).is_closed_manifold());
    EXPECT_EQ(surface.mesh.positions.size(), bind.positions.size());
    const ImportedRig rig = import_rig(scene, surface);
    expect_same_skeleton(model.skeleton, rig.skeleton, {}, 1e-5 * model.diagonal);
    ASSERT_EQ(rig.animations.size(), 1u);
    EXPECT_EQ(rig.animations[0].name, "dance");
    for (const double time : {0.0, 0.3, 0.5, 1.0}) {
      const Skeleton posed = apply_pose(model.skeleton, pose_at(model.skeleton, animation, time));
      const Skeleton again = apply_pose(rig.skeleton, pose_at(rig.skeleton, rig.animations[0].animation, time));
      expect_same_skeleton(posed, again, {}, 1e-4 * model.diagonal);
      // The rig's own weights move its mesh as the model's do.
      const TriangleMesh expected = reconstruct_mesh(device(), model, posed, {Deformation::kLinear});
      const std::vector<BoneMotion> motions = bone_motions(rig.skeleton, again);
      double largest = 0;
      for (std::size_t v = 0; v < expected.positions.size(); ++v) {
        Vec3 place = Vec3::Zero();
        for (const auto& [bone, weight] : rig.weights[v])
          place += weight * (motions[bone].rotation * surface.mesh.positions[v] + motions[bone].translation);
        largest = std::max(largest, (place - expected.positions[v]).norm());
      }
      EXPECT_LT(largest, 2e-4 * model.diagonal);
    }
  }
}

TEST(RigImport, AnAnimationThatMakesNoSenseIsLeftOutAndTheRestRead) {
  const SkeletexModel model = model_of(chain(3), 0.15);
  PoseAnimation animation;
  for (unsigned i = 0; i < 3; ++i) animation.frames.push_back({0.5 * i, turned(model.skeleton, i)});
  GltfScene scene = exported(model, {{"good", animation}, {"backwards", animation}});
  for (GltfTrack& track : scene.animations.at(1).tracks) std::reverse(track.times.begin(), track.times.end());
  const ScratchFolder folder;
  write_gltf(folder / "rig.glb", scene);
  const GltfScene again = read_gltf(folder / "rig.glb");
  ASSERT_EQ(again.animations.size(), 1u);
  EXPECT_EQ(again.animations[0].name, "good");
  ASSERT_EQ(again.notes.size(), 1u);
  EXPECT_NE(again.notes[0].find("backwards"), std::string::npos) << again.notes[0];
}

/// A file as a program writes it whose armature is turned by a quarter and scaled by a hundredth.
GltfScene in_armature(GltfScene scene, const Eigen::Affine3d& armature) {
  // Bound in the armature's coordinates: those of the file's vertices are larger by its inverse.
  GltfNode node;
  node.name = "armature";
  node.matrix = armature.matrix();
  scene.nodes.push_back(node);
  for (GltfNode& other : scene.nodes)
    if (other.name == "rig_rig") other.parent = static_cast<int>(scene.nodes.size()) - 1;
  return scene;
}

TEST(RigImport, ScaledAndTurnedArmaturesStandWhereTheFileShowsThem) {
  const SkeletexModel model = model_of(random_tree(9, 3), 0.15);
  PoseAnimation animation;
  for (unsigned i = 0; i < 2; ++i) animation.frames.push_back({1.0 * i, turned(model.skeleton, i)});
  Similarity map;
  map.scale = 0.01;
  map.rotation = Eigen::AngleAxisd(-std::numbers::pi / 2, Vec3::UnitX()).toRotationMatrix();
  map.translation = Vec3(3, 4, 5);
  Eigen::Affine3d armature = Eigen::Affine3d::Identity();
  armature.linear() = map.scale * map.rotation;
  armature.translation() = map.translation;
  const GltfScene scene = in_armature(exported(model, {{"dance", animation}}), armature);
  const GltfSurface surface = gltf_surface(scene, "test");
  const TriangleMesh bind = reconstruct_mesh(device(), model);
  for (std::size_t v = 0; v < bind.positions.size(); ++v)
    EXPECT_LT((surface.mesh.positions[v] - map(bind.positions[v])).norm(), 1e-6);
  const ImportedRig rig = import_rig(scene, surface);
  expect_same_skeleton(model.skeleton, rig.skeleton, map, 1e-5 * map.scale * model.diagonal);
  expect_same_skeleton(apply_pose(model.skeleton, animation.frames[1].pose),
                       apply_pose(rig.skeleton, rig.animations.at(0).animation.frames.back().pose), map,
                       1e-4 * map.scale * model.diagonal);
}

TEST(RigImport, WholeMeshesBelowJointsMoveWithThemThoughNoneHasTheSkin) {
  const SkeletexModel model = model_of(chain(3), 0.2);
  GltfScene scene = exported(model);
  const int joint = scene.skins[0].joints[1];
  const GltfPrimitive primitive = scene.meshes[0].primitives[0];
  for (GltfNode& node : scene.nodes) {
    if (node.mesh < 0) continue;
    node.mesh = node.skin = -1;
  }
  GltfPrimitive plain;
  plain.positions = primitive.positions;
  plain.triangles = primitive.triangles;
  scene.meshes = {{"part", {plain}}};
  GltfNode part;
  part.name = "part";
  part.mesh = 0;
  part.parent = joint;
  part.translation = Vec3(0, 0.5, 0);
  scene.nodes.push_back(part);
  const GltfSurface surface = gltf_surface(scene, "test");
  const Eigen::Affine3d place = node_transforms(scene.nodes).back();
  for (std::size_t v = 0; v < plain.positions.size(); ++v) {
    EXPECT_LT((surface.mesh.positions[v] - place * plain.positions[v]).norm(), 1e-6 * model.diagonal);
    ASSERT_EQ(surface.weights[v].size(), 1u);
    EXPECT_EQ(surface.weights[v][0].node, joint);
  }
  EXPECT_FALSE(imported(scene).skeleton.bones.empty());
}

/// A file of one triangle with a morph target of weight 1/2.
std::string with_morph_target(bool has_normals) {
  std::string data;
  const auto add = [&](const std::vector<float>& values) {
    data.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float));
  };
  add({0, 0, 0, 1, 0, 0, 0, 1, 0});                          // positions
  add({0, 0, 1, 0, 0, 1, 0, 0, 1});                          // normals
  add({0, 0, 2, 0, 0, 0, 0, 0, 0});                          // changes of positions
  add({-0.5f, -0.5f, 0, -0.5f, -0.5f, 0, -0.5f, -0.5f, 0});  // of normals
  nlohmann::json json = {{"asset", {{"version", "2.0"}}}, {"scene", 0}, {"scenes", {{{"nodes", {0}}}}}};
  json["nodes"] = {{{"mesh", 0}}};
  json["buffers"] = {{{"byteLength", data.size()}}};
  for (int i = 0; i < 4; ++i) {
    json["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", 36 * i}, {"byteLength", 36}});
    json["accessors"].push_back({{"bufferView", i}, {"componentType", 5126}, {"count", 3}, {"type", "VEC3"}});
  }
  json["accessors"][0]["min"] = {0, 0, 0};
  json["accessors"][0]["max"] = {1, 1, 0};
  nlohmann::json target = {{"POSITION", 2}};
  if (has_normals) target["NORMAL"] = 3;
  nlohmann::json primitive = {{"attributes", {{"POSITION", 0}, {"NORMAL", 1}}}};
  primitive["targets"].push_back(target);
  nlohmann::json mesh;
  mesh["primitives"].push_back(primitive);
  mesh["weights"].push_back(0.5);
  json["meshes"].push_back(mesh);
  std::string text = json.dump();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  const auto number = [](std::size_t n) {
    std::string bytes;
    for (int i = 0; i < 4; ++i) bytes += static_cast<char>(n >> (8 * i) & 255);
    return bytes;
  };
  return "glTF" + number(2) + number(28 + text.size() + data.size()) + number(text.size()) + "JSON" + text +
         number(data.size()) + std::string("BIN\0", 4) + data;
}

TEST(RigImport, MorphTargetsTurnNormals) {
  const ScratchFolder folder;
  for (const bool has_normals : {true, false}) {
    std::ofstream(folder / "m.glb", std::ios::binary) << with_morph_target(has_normals);
    const GltfScene scene = read_gltf(folder / "m.glb");
    const GltfPrimitive& primitive = scene.meshes.at(0).primitives.at(0);
    EXPECT_EQ(primitive.positions[0], Vec3(0, 0, 1));
    ASSERT_EQ(primitive.normals.size(), has_normals ? 3u : 0u);
    if (has_normals) {
      EXPECT_LT((primitive.normals[0] - Vec3(-0.25, -0.25, 1)).norm(), 1e-6);
    }
  }
}

TEST(RigImport, TrianglesThatAllVanishAreRefused) {
  GltfScene scene = exported(model_of(chain(2), 0.15));
  for (Triangle& triangle : scene.meshes.at(0).primitives.at(0).triangles) triangle[2] = triangle[0];
  try {
    gltf_surface(scene, "flat.glb");
    FAIL() << "was read";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("has an area"), std::string::npos) << error.what();
  }
}

TEST(RigImport, MirroredAndUnevenlyScaledArmaturesGiveTheMeshThatIsShown) {
  const SkeletexModel model = model_of(random_tree(9, 3), 0.15);
  for (const Vec3& scale : {Vec3(-1, 1, 1), Vec3(1, 2, 0.5), Vec3(-1, -1, -3)}) {
    SCOPED_TRACE(scale.transpose());
    Eigen::Affine3d armature = Eigen::Affine3d::Identity();
    armature.linear() = scale.asDiagonal();
    const GltfSurface surface = gltf_surface(in_armature(exported(model), armature), "test");
    EXPECT_TRUE(measure_manifold(surface.mesh).is_closed_manifold());
    const double volume = signed_volume(reconstruct_mesh(device(), model));
    EXPECT_NEAR(signed_volume(surface.mesh), volume * std::abs(scale.prod()), 1e-4 * volume * std::abs(scale.prod()));
  }
}

TEST(RigImport, TheBindPoseComesFromTheInverseBindMatricesWhateverPoseIsShown) {
  const SkeletexModel model = model_of(random_tree(9, 3), 0.15);
  GltfScene scene = exported(model);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (GltfNode& node : scene.nodes)
    if (node.mesh < 0 && node.name != "root" && node.name != "rig_rig")
      node.rotation = node.rotation * Eigen::Quaterniond(Eigen::AngleAxisd(0.7 * unit(random), Vec3::UnitX()));
  const GltfSurface surface = gltf_surface(scene, "test");
  const TriangleMesh bind = reconstruct_mesh(device(), model);
  double largest = 0;
  for (std::size_t v = 0; v < bind.positions.size(); ++v)
    largest = std::max(largest, (surface.mesh.positions[v] - bind.positions[v]).norm());
  EXPECT_LT(largest, 1e-5 * model.diagonal);
  expect_same_skeleton(model.skeleton, import_rig(scene, surface).skeleton, {}, 1e-5 * model.diagonal);
}

TEST(RigImport, ASkinWithoutInverseBindMatricesIsBoundAsShown) {
  const SkeletexModel model = model_of(chain(4), 0.2);
  GltfScene scene = exported(model);
  // Without these matrices vertices are in the coordinates of their joint: here of one that moves all of them.
  GltfPrimitive& primitive = scene.meshes[0].primitives[0];
  for (std::size_t v = 0; v < primitive.positions.size(); ++v)
    for (int i = 0; i < 4; ++i) {
      primitive.joints[4 * v + i] = 0;
      primitive.weights[4 * v + i] = i == 0;
    }
  scene.skins[0].inverse_binds.clear();
  const ScratchFolder folder;
  write_gltf(folder / "rig.glb", scene);
  const GltfScene read = read_gltf(folder / "rig.glb");
  const GltfSurface surface = gltf_surface(read, "rig.glb");
  const Vec3 root = read.nodes[read.skins[0].joints[0]].translation;
  const TriangleMesh bind = reconstruct_mesh(device(), model);
  for (std::size_t v = 0; v < bind.positions.size(); ++v)
    EXPECT_LT((surface.mesh.positions[v] - bind.positions[v] - root).norm(), 1e-5 * model.diagonal);
}

TEST(RigImport, BordersOfPrimitivesAreWelded) {
  const SkeletexModel model = model_of(random_tree(9, 3), 0.15);
  GltfScene scene = exported(model);
  // Every triangle has vertices of its own, in three primitives, moved by less than the tolerance.
  const GltfPrimitive whole = scene.meshes[0].primitives[0];
  std::vector<GltfPrimitive> parts(3);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (std::size_t t = 0; t < whole.triangles.size(); ++t) {
    GltfPrimitive& part = parts[t % 3];
    part.influences = 4;
    const int first = static_cast<int>(part.positions.size());
    for (const int v : whole.triangles[t]) {
      part.positions.push_back(whole.positions[v] +
                               2e-6 * model.diagonal * Vec3(unit(random), unit(random), unit(random)));
      for (int i = 0; i < 4; ++i) {
        part.joints.push_back(whole.joints[4 * v + i]);
        part.weights.push_back(whole.weights[4 * v + i]);
      }
    }
    part.triangles.push_back({first, first + 1, first + 2});
  }
  scene.meshes[0].primitives = parts;
  const GltfSurface surface = gltf_surface(scene, "test");
  EXPECT_EQ(surface.mesh.positions.size(), whole.positions.size());
  EXPECT_EQ(surface.vertices_in_file, static_cast<int>(3 * whole.triangles.size()));
  EXPECT_TRUE(measure_manifold(surface.mesh).is_closed_manifold());
}

TEST(RigImport, SeveralSkinsOfOneSkeletonAreOneBody) {
  const SkeletexModel model = model_of(random_tree(9, 3), 0.15);
  GltfScene scene = exported(model);
  const GltfScene whole = scene;
  // The second half of the triangles in a mesh and skin of their own, whose vertices are in other units.
  GltfPrimitive& first = scene.meshes[0].primitives[0];
  GltfPrimitive second = first;
  const std::size_t half = first.triangles.size() / 2;
  second.triangles.erase(second.triangles.begin(), second.triangles.begin() + static_cast<std::ptrdiff_t>(half));
  first.triangles.resize(half);
  for (Vec3& p : second.positions) p = 100 * p;
  GltfSkin skin = scene.skins[0];
  for (Eigen::Matrix4d& matrix : skin.inverse_binds)
    matrix = matrix * Eigen::Vector4d(0.01, 0.01, 0.01, 1).asDiagonal();
  scene.skins.push_back(skin);
  scene.meshes.push_back({"second", {second}});
  GltfNode node;
  node.mesh = node.skin = 1;
  scene.nodes.push_back(node);
  const GltfSurface surface = gltf_surface(scene, "test");
  EXPECT_TRUE(measure_manifold(surface.mesh).is_closed_manifold());
  expect_same_skeleton(model.skeleton, import_rig(scene, surface).skeleton, {}, 1e-5 * model.diagonal);
}

TEST(RigImport, JointsThatMoveNothingAndTwistJointsAreNoBones) {
  const SkeletexModel model = model_of(chain(4), 0.2);
  GltfScene scene = exported(model);
  const auto add = [&](const std::string& name, int parent, const Vec3& place) {
    GltfNode node;
    node.name = name;
    node.parent = parent;
    node.translation = place;
    scene.skins[0].joints.push_back(static_cast<int>(scene.nodes.size()));
    Eigen::Matrix4d bind = scene.skins[0].inverse_binds[parent - 2];
    bind.topRightCorner<3, 1>() -= place;
    scene.skins[0].inverse_binds.push_back(bind);
    scene.nodes.push_back(node);
    return static_cast<int>(scene.skins[0].joints.size()) - 1;
  };
  const auto joint = [&](const std::string& name) {
    for (int i = 0; i < static_cast<int>(scene.nodes.size()); ++i)
      if (scene.nodes[i].name == name) return i;
    return -1;
  };
  const std::string second = model.skeleton.bones[1].name;
  add("weapon", joint(second), Vec3(0.1, 0.1, 0));
  const int twist = add("twist", joint(second), Vec3(0, 0.5 * bone_length(model.skeleton, 1), 0));
  GltfPrimitive& primitive = scene.meshes[0].primitives[0];
  int given = 0;
  for (std::size_t i = 0; i < primitive.joints.size(); i += 4)
    if (scene.nodes[scene.skins[0].joints[primitive.joints[i]]].name == second && i % 8 == 0)
      primitive.joints[i] = twist, ++given;
  ASSERT_GT(given, 0);
  const ImportedRig rig = imported(scene);
  expect_same_skeleton(model.skeleton, rig.skeleton, {}, 1e-5 * model.diagonal);
  ASSERT_EQ(rig.notes.size(), 2u);
  EXPECT_NE(rig.notes[0].find("weapon"), std::string::npos);
  EXPECT_NE(rig.notes[1].find("twist"), std::string::npos);
}

TEST(RigImport, JointsWithoutParentsGetTheHierarchyThatTheirWeightsShow) {
  for (const unsigned seed : {1u, 3u, 5u}) {
    const SkeletexModel model = model_of(random_tree(9, seed), 0.15);
    GltfScene scene = exported(model);
    for (const int joint : scene.skins[0].joints)
      if (GltfNode& node = scene.nodes[joint]; !node.name.ends_with("_end")) node.parent = -1;
    expect_same_skeleton(model.skeleton, imported(scene).skeleton, {}, 1e-5 * model.diagonal);
  }
}

TEST(RigImport, LeafBonesEndInsideTheSurfaceThatTheyMove) {
  // Without the joints that show where bones end.
  const SkeletexModel model = model_of(random_tree(9, 3), 0.15);
  GltfScene scene = exported(model);
  for (GltfNode& node : scene.nodes)
    if (node.name.ends_with("_end")) node.name = "";
  GltfSkin& skin = scene.skins[0];
  for (std::size_t j = skin.joints.size(); j-- > 0;)
    if (scene.nodes[skin.joints[j]].name.empty()) {
      skin.joints.erase(skin.joints.begin() + static_cast<std::ptrdiff_t>(j));
      skin.inverse_binds.erase(skin.inverse_binds.begin() + static_cast<std::ptrdiff_t>(j));
    }
  const GltfSurface surface = gltf_surface(scene, "test");
  const ImportedRig rig = import_rig(scene, surface);
  ASSERT_EQ(rig.skeleton.bones.size(), model.skeleton.bones.size());
  for (int bone = 0; bone < static_cast<int>(model.skeleton.bones.size()); ++bone) {
    const int same = bone_named(rig.skeleton, model.skeleton.bones[bone].name);
    ASSERT_GE(same, 0);
    const Vec3 a = direction_from(model.skeleton, {bone, BoneEnd::kHead}),
               b = direction_from(rig.skeleton, {same, BoneEnd::kHead});
    EXPECT_GT(std::abs(a.dot(b)), 0.95) << rig.skeleton.bones[same].name;
    EXPECT_GT(bone_length(rig.skeleton, same), 0.4 * bone_length(model.skeleton, bone));
    EXPECT_LT(bone_length(rig.skeleton, same), 1.4 * bone_length(model.skeleton, bone));
  }
}

TEST(RigImport, WeightsOfTheRigBecomeThoseOfTheModel) {
  const Shape shape = chain_shape(3, 0.4);
  EncodeOptions options;
  options.width = options.height = 64;
  SkeletexModel model = encode_model(device(), shape.mesh, shape.skeleton, options).model;
  // Weights that no closed form has: linear in the height.
  std::vector<std::vector<BoneWeight>> weights;
  const BoundingBox box = bounding_box(shape.mesh);
  const auto share_at = [&](const Vec3& p) { return (p.x() - box.lower.x()) / (box.upper.x() - box.lower.x()); };
  for (const Vec3& p : shape.mesh.positions) weights.push_back({{0, 1 - share_at(p)}, {2, share_at(p)}});
  model.bone_weights = weight_planes(device(), model, shape.mesh, build_triangle_tree(shape.mesh), nullptr, weights);
  const PreparedModel prepared(model);
  const BindMesh bind = reconstruct_bind_mesh(device(), prepared);
  const Skin skin = make_skin(device(), prepared, bind.inner);
  const std::vector<float> last = vertex_weights(skin, 2);
  for (std::size_t v = 0; v < last.size(); ++v) EXPECT_NEAR(last[v], share_at(bind.mesh.positions[v]), 0.02);
}

TEST(RigImport, WeightsAreThoseOfTheOriginalOfAClosedMesh) {
  const GltfScene scene = exported(model_of(chain(3), 0.15));
  GltfSurface surface = gltf_surface(scene, "test");
  const int joint = scene.skins.at(0).joints.at(1);
  AttributedMesh file{surface.mesh, {}, {}};
  file.mesh.positions.emplace_back(surface.mesh.positions[0]);
  file.weights.assign(file.mesh.positions.size(), {{joint, 1.0}});
  surface.attributes.original = std::make_shared<const AttributedMesh>(file);
  const ImportedRig rig = import_rig(scene, surface);
  ASSERT_EQ(rig.weights.size(), file.weights.size());
  for (const std::vector<BoneWeight>& weights : rig.weights) {
    ASSERT_EQ(weights.size(), 1u);
    EXPECT_EQ(weights[0].bone, rig.weights[0][0].bone);
    EXPECT_NEAR(weights[0].weight, 1, 1e-12);
  }
}

TEST(RigImport, WeightsOfPartsDoNotBlendInTheirUnion) {
  const Shape shape = chain_shape(3, 0.4);
  EncodeOptions options;
  options.width = options.height = 64;
  SkeletexModel model = encode_model(device(), shape.mesh, shape.skeleton, options).model;
  // The file has two parts that meet in the middle, each moved by one bone; the mesh is both of them in one.
  const double middle = bounding_box(shape.mesh).centre().x();
  AttributedMesh file;
  for (const Triangle& t : shape.mesh.triangles) {
    const std::array<Vec3, 3> corners{shape.mesh.positions[t[0]], shape.mesh.positions[t[1]],
                                      shape.mesh.positions[t[2]]};
    const int bone = (corners[0] + corners[1] + corners[2]).x() / 3 < middle ? 0 : 2;
    const int first = static_cast<int>(file.mesh.positions.size());
    file.mesh.triangles.push_back({first, first + 1, first + 2});
    for (const Vec3& p : corners) {
      file.mesh.positions.push_back(p);
      file.weights.push_back({{bone, 1.0}});
    }
  }
  const auto planes = weight_planes(device(), model, shape.mesh, build_triangle_tree(shape.mesh), &file, file.weights);
  int first = 0, last = 0;
  for (std::size_t i = 0; i < planes[0].size(); ++i) {
    if (planes[0][i] + planes[2][i] == 0) continue;  // between rectangles
    ASSERT_NEAR(std::max(planes[0][i], planes[2][i]), 1, 1e-6) << i;
    ++(planes[0][i] > 0.5f ? first : last);
  }
  EXPECT_GT(first, 1000);
  EXPECT_GT(last, 1000);
}

TEST(RigImport, AFewTexelsWithTheWeightsOfAnotherPartTakeThoseAround) {
  const Shape shape = chain_shape(3, 0.4);
  EncodeOptions options;
  options.width = options.height = 128;
  const SkeletexModel model = encode_model(device(), shape.mesh, shape.skeleton, options).model;
  const TriangleTree tree = build_triangle_tree(shape.mesh);
  std::vector<std::vector<BoneWeight>> weights;
  for (const Vec3& p : shape.mesh.positions) {
    const double share = std::clamp(0.5 + 0.2 * p.z(), 0.0, 1.0);
    weights.push_back({{0, 1 - share}, {1, share}});
  }
  const auto good = weight_planes(device(), model, shape.mesh, tree, nullptr, weights);
  // A tiny part beside the middle of the surface, nearer to a texel or two than the mesh and of another bone.
  TriangleMesh touched = shape.mesh;
  const int triangle = static_cast<int>(shape.mesh.triangles.size() / 2);
  const Vec3 a = shape.mesh.positions[shape.mesh.triangles[triangle][0]];
  const Vec3 outwards = area_vector(shape.mesh, shape.mesh.triangles[triangle]).normalized();
  const Vec3 along = outwards.unitOrthogonal(), across = outwards.cross(along);
  const int first = static_cast<int>(touched.positions.size());
  for (const Vec3& p :
       {Vec3(a + 0.02 * along), Vec3(a - 0.02 * along + 0.03 * across), Vec3(a - 0.02 * along - 0.03 * across)}) {
    touched.positions.push_back(p + 1e-6 * outwards);
    weights.push_back({{2, 1.0}});
  }
  touched.triangles.push_back({first, first + 1, first + 2});
  const TriangleTree with = build_triangle_tree(touched);
  const PreparedModel prepared(model);
  const std::vector<SurfacePoint> points = surface_points(device(), prepared, touched, with);
  ASSERT_TRUE(std::any_of(points.begin(), points.end(), [&](const SurfacePoint& point) {
    return point.triangle == static_cast<int>(touched.triangles.size()) - 1;
  })) << "no texel is nearest to it";
  const auto planes = weight_planes(device(), model, touched, with, nullptr, weights);
  for (std::size_t b = 0; b < planes.size(); ++b)
    for (std::size_t i = 0; i < planes[b].size(); ++i) ASSERT_NEAR(planes[b][i], good[b][i], 0.1) << b << " " << i;
}

TEST(RigImport, JointsThatMoveAwayFromEachOtherBecomePosesOfNodes) {
  const SkeletexModel model = model_of(chain(4), 0.2);
  GltfScene scene = exported(model);
  const std::string moved = model.skeleton.bones[2].name;
  int joint = 0;
  while (scene.nodes[joint].name != moved) ++joint;
  const Vec3 way(0, 0.3, 0.05);
  GltfTrack track{joint, GltfPath::kTranslation, GltfInterpolation::kLinear, {0, 2}, {}};
  for (const Vec3& place : {scene.nodes[joint].translation, Vec3(scene.nodes[joint].translation + way)})
    track.values.emplace_back(place.x(), place.y(), place.z(), 0);
  scene.animations.push_back({"stretch", {track}});
  const ImportedRig rig = imported(scene);
  ASSERT_EQ(rig.animations.size(), 1u);
  const Skeleton posed = apply_pose(rig.skeleton, pose_at(rig.skeleton, rig.animations[0].animation, 1));
  const int bone = bone_named(rig.skeleton, moved);
  int still = 0;
  for (std::size_t node = 0; node < posed.nodes.size(); ++node) {
    const double distance = (posed.nodes[node].position - rig.skeleton.nodes[node].position).norm();
    EXPECT_LT(std::min(distance, std::abs(distance - 0.5 * way.norm())), 1e-5 * model.diagonal);
    still += distance < 1e-5 * model.diagonal;
  }
  EXPECT_GT((end_position(posed, bone, BoneEnd::kHead) - end_position(rig.skeleton, bone, BoneEnd::kHead)).norm(), 0.1);
  EXPECT_EQ(still, 2);
}

}  // namespace
}  // namespace skeletex
