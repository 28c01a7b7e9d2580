// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <numbers>
#include <random>

#include "skeletex/analysis/manifold.h"
#include "skeletex/analysis/metro.h"
#include "skeletex/convert/encode_model.h"
#include "skeletex/convert/resample/resample.h"
#include "skeletex/edit/regular_grid.h"
#include "skeletex/io/gltf/read_gltf.h"
#include "skeletex/io/gltf/write_gltf.h"
#include "skeletex/io/mesh_file.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/layers/layer_values.h"
#include "skeletex/reconstruct/pose/linear_skin.h"
#include "skeletex/reconstruct/pose/pose_mesh.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/reconstruct/texture/bake_displacement.h"
#include "skeletex/reconstruct/texture/bake_texture.h"
#include "skeletex/reconstruct/texture/vertex_tangents.h"
#include "skeletex/rig/export_rig.h"
#include "support/load_model.h"
#include "support/picture_at.h"
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

/// A viewer in a few lines: where the file's own skin takes its vertices at the frame of an animation.
std::vector<Vec3> play(const GltfScene& scene, const GltfAnimation* animation, std::size_t frame) {
  std::vector<GltfNode> nodes = scene.nodes;
  if (animation)
    for (const GltfTrack& track : animation->tracks) {
      const Eigen::Vector4d& value = track.values.at(frame);
      if (track.path == GltfPath::kTranslation) nodes[track.node].translation = value.head<3>();
      if (track.path == GltfPath::kScale) nodes[track.node].scale = value.head<3>();
      if (track.path == GltfPath::kRotation) nodes[track.node].rotation = Eigen::Quaterniond(value);
    }
  const auto world = [&](int node) {
    Eigen::Affine3d transform = Eigen::Affine3d::Identity();
    for (; node >= 0; node = nodes[node].parent)
      transform = Eigen::Translation3d(nodes[node].translation) * nodes[node].rotation.normalized() *
                  Eigen::Scaling(nodes[node].scale) * transform;
    return transform;
  };
  std::vector<Eigen::Matrix4d> matrices;
  for (std::size_t j = 0; j < scene.skins[0].joints.size(); ++j)
    matrices.push_back(world(scene.skins[0].joints[j]).matrix() * scene.skins[0].inverse_binds[j]);
  const GltfPrimitive& primitive = scene.meshes[0].primitives[0];
  std::vector<Vec3> moved;
  for (std::size_t v = 0; v < primitive.positions.size(); ++v) {
    Eigen::Vector4d sum = Eigen::Vector4d::Zero();
    for (int i = 0; i < primitive.influences; ++i)
      sum +=
          primitive.weights[4 * v + i] * matrices[primitive.joints[4 * v + i]] * primitive.positions[v].homogeneous();
    moved.push_back(sum.head<3>());
  }
  return moved;
}

double largest_distance(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  EXPECT_EQ(a.size(), b.size());
  double largest = 0;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) largest = std::max(largest, (a[i] - b[i]).norm());
  return largest;
}

GltfScene written_and_read(const GltfScene& scene) {
  const ScratchFolder folder;
  write_gltf(folder / "rig.glb", scene);
  return read_gltf(folder / "rig.glb");
}

Pose turned(const Skeleton& skeleton, unsigned seed, double largest) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1, 1);
  Pose pose;
  for (std::size_t i = 0; i < skeleton.bones.size(); ++i)
    pose.rotations.emplace_back(
        Eigen::AngleAxisd(largest * unit(random), Vec3(unit(random), unit(random), unit(random)).normalized()));
  return pose;
}

Pose moved(const Skeleton& skeleton, unsigned seed, double largest) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-largest, largest);
  Pose pose;
  for (const Node& node : skeleton.nodes)
    pose.nodes.push_back(node.position + Vec3(unit(random), unit(random), unit(random)));
  for (std::size_t i = 0; i < skeleton.bones.size(); ++i) pose.rolls.push_back(unit(random));
  return pose;
}

TEST(RigExport, AnExportedRigMovesAsLinearPosesDo) {
  struct Case {
    const char* name;
    Skeleton skeleton;
    bool is_turned;
  };
  for (const auto& [name, skeleton, is_turned] : std::vector<Case>{{"lone bone", lone_bone(), true},
                                                                   {"chain, turned", chain(4), true},
                                                                   {"tree, turned", random_tree(12, 3), true},
                                                                   {"tree, nodes moved", random_tree(12, 3), false},
                                                                   {"cross, nodes moved", cross(6), false},
                                                                   {"ring, nodes moved", ring_with_arm(6), false}}) {
    SCOPED_TRACE(name);
    const SkeletexModel model = model_of(skeleton, 0.15);
    PoseAnimation animation;
    animation.frames.push_back({2, Pose{}});
    for (unsigned i = 0; i < 3; ++i)
      animation.frames.push_back({2.5 + i, is_turned ? turned(model.skeleton, i, 1.2) : moved(model.skeleton, i, 0.2)});
    const std::vector<NamedAnimation> named{{"dance", animation}};
    const GltfScene scene = written_and_read(export_rig(device(), model, {.animations = named}));
    EXPECT_LT(largest_distance(play(scene, nullptr, 0), reconstruct_mesh(device(), model).positions),
              1e-6 * model.diagonal);
    ASSERT_EQ(scene.animations.size(), 1u);
    EXPECT_EQ(scene.animations[0].name, "dance");
    const std::vector<double>& times = scene.animations[0].tracks.at(0).times;
    EXPECT_EQ(times.front(), 0);
    EXPECT_NEAR(times.back(), 2.5, 1e-6);
    for (std::size_t frame = 0; frame < times.size(); frame += 3) {
      const Skeleton posed = apply_pose(model.skeleton, pose_at(model.skeleton, animation, 2 + times[frame]));
      const TriangleMesh expected = reconstruct_mesh(device(), model, posed, {Deformation::kLinear});
      EXPECT_LT(largest_distance(play(scene, &scene.animations[0], frame), expected.positions), 2e-6 * model.diagonal)
          << frame;
    }
  }
}

TEST(RigExport, TheMeshIsClosedAndItsNormalsPointOutwards) {
  const SkeletexModel model = model_of(random_tree(12, 3), 0.15);
  const GltfScene scene = written_and_read(export_rig(device(), model));
  const GltfPrimitive& primitive = scene.meshes.at(0).primitives.at(0);
  const TriangleMesh mesh{primitive.positions, primitive.triangles};
  EXPECT_TRUE(measure_manifold(mesh).is_closed_manifold());
  ASSERT_EQ(primitive.normals.size(), primitive.positions.size());
  for (std::size_t v = 0; v < primitive.normals.size(); ++v) EXPECT_NEAR(primitive.normals[v].norm(), 1, 1e-6);
  std::size_t against = 0;
  for (const Triangle& t : mesh.triangles)
    for (const int corner : t) against += area_vector(mesh, t).dot(primitive.normals[corner]) < 0;
  EXPECT_LT(against, mesh.triangles.size() / 100);
}

/// A model with colours that vary over its surface.
SkeletexModel coloured(SkeletexModel model) {
  const PreparedModel prepared(model);
  MeshAttributes attributes;
  for (const Vec3& p : reconstruct_mesh(device(), prepared).positions) {
    const auto wave = [](double x) { return static_cast<float>(0.5 + 0.4 * std::sin(3 * x)); };
    attributes.colours.values.emplace_back(wave(p.x()), wave(p.y()), wave(p.z()), 1.f);
  }
  model.layers = layers_of_vertices(prepared, attributes);
  return model;
}

TEST(RigExport, ColoursComeAlongByVertexOrAsAPicture) {
  const SkeletexModel model = coloured(model_of(random_tree(6, 3), 0.15));
  const std::vector<Colour> colours = vertex_attributes(model).colours.values;
  const GltfScene by_vertex = written_and_read(export_rig(device(), model));
  const GltfPrimitive& plain = by_vertex.meshes.at(0).primitives.at(0);
  ASSERT_EQ(plain.colours.size(), colours.size());
  for (std::size_t v = 0; v < colours.size(); ++v) EXPECT_LT((plain.colours[v] - colours[v]).norm(), 1e-6);
  EXPECT_EQ(by_vertex.materials.at(0).base_colour, Colour::Ones());

  const GltfScene scene = written_and_read(export_rig(device(), model, {.texture_size = 256}));
  const GltfPrimitive& textured = scene.meshes.at(0).primitives.at(0);
  ASSERT_EQ(scene.images.size(), 1u);
  EXPECT_EQ(scene.materials.at(textured.material).image, 0);
  EXPECT_TRUE(textured.colours.empty());
  EXPECT_EQ(textured.triangles.size(), plain.triangles.size());
  // Vertices repeat at the borders of patches alone, and move as those that they stand for.
  EXPECT_LT(textured.positions.size(), 1.3 * static_cast<double>(plain.positions.size()));
  EXPECT_LT(largest_distance(play(scene, nullptr, 0), textured.positions), 1e-6 * model.diagonal);
  for (std::size_t t = 0; t < textured.triangles.size(); ++t)
    for (int k = 0; k < 3; ++k) {
      const int own = textured.triangles[t][k], vertex = plain.triangles[t][k];
      ASSERT_EQ(textured.positions[own], plain.positions[vertex]);
      ASSERT_EQ(textured.normals[own], plain.normals[vertex]);
      for (int i = 0; i < 4; ++i) ASSERT_EQ(textured.weights[4 * own + i], plain.weights[4 * vertex + i]);
      const Eigen::Vector2f& uv = textured.texture_coordinates[own];
      const Vec3 seen = picture_at(scene.images[0], {uv.x(), 1 - uv.y()});
      ASSERT_LT((seen - colours[vertex].head<3>().cast<double>()).cwiseAbs().maxCoeff(), 0.02) << t;
    }
  const SkeletexModel bare = model_of(lone_bone(), 0.15);
  // So it is where the mesh has fewer texels than the picture, whose colours are then the original's.
  const SkeletexModel small = resample_model(device(), model, 40);
  const GltfScene coarse = export_rig(device(), small, {.texture_size = 264, .original = &model});
  const GltfPrimitive& surface = coarse.meshes.at(0).primitives.at(0);
  for (const Triangle& triangle : surface.triangles) {
    Eigen::Vector2f uv = Eigen::Vector2f::Zero();
    Vec3 middle = Vec3::Zero();
    for (const int corner : triangle) {
      uv += surface.texture_coordinates[corner] / 3;
      middle += surface.positions[corner] / 3;
    }
    const Vec3 seen = picture_at(coarse.images[0], {uv.x(), 1 - uv.y()});
    for (int k = 0; k < 3; ++k) ASSERT_NEAR(seen[k], 0.5 + 0.4 * std::sin(3 * middle[k]), 0.05);
  }
  EXPECT_THROW(export_rig(device(), bare, {.texture_size = 64}), InputError);
}

/// A picture of vectors between its pixels, as programs read it that repeat it beyond its sides.
Vec3 vector_at(const DisplacementPicture& picture, const Eigen::Vector2d& uv) {
  const double x = uv.x() * picture.width - 0.5, y = (1 - uv.y()) * picture.height - 0.5;
  const int column = static_cast<int>(std::floor(x)), row = static_cast<int>(std::floor(y));
  Vec3 sum = Vec3::Zero();
  for (const int i : {0, 1})
    for (const int j : {0, 1})
      sum += std::abs(1 - i - (y - row)) * std::abs(1 - j - (x - column)) *
             picture.values.at(static_cast<std::size_t>(row + i) * picture.width + column + j).cast<double>();
  return sum;
}

/// The coarse mesh with its triangles cut into steps^2 each, every point moved by the picture.
/// \param vector_of  what a vector of the picture is at a point of a triangle, given by its share of the corners
TriangleMesh displaced(
    const TriangleMesh& base, const DisplacementPicture& picture, int steps,
    const std::function<Vec3(std::size_t t, const Vec3& share, const Vec3& vector)>& vector_of =
        [](std::size_t, const Vec3&, const Vec3& vector) { return vector; }) {
  TriangleMesh result;
  for (std::size_t t = 0; t < base.triangles.size(); ++t) {
    const auto point = [&](int i, int j) {
      const Vec3 share = Vec3(steps - i - j, i, j) / steps;
      Vec3 place = Vec3::Zero();
      Eigen::Vector2d uv = Eigen::Vector2d::Zero();
      for (int k = 0; k < 3; ++k) {
        place += share[k] * base.positions[base.triangles[t][k]];
        uv += share[k] * picture.coordinates.values[picture.coordinates.corners[t][k]].cast<double>();
      }
      result.positions.push_back(place + vector_of(t, share, vector_at(picture, uv)));
      return static_cast<int>(result.positions.size()) - 1;
    };
    for (int i = 0; i < steps; ++i)
      for (int j = 0; i + j < steps; ++j) {
        result.triangles.push_back({point(i, j), point(i + 1, j), point(i, j + 1)});
        if (i + j + 1 < steps) result.triangles.push_back({point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)});
      }
  }
  return result;
}

TEST(RigExport, ACoarseMeshAndItsDisplacementGiveTheSurface) {
  for (const char* name : {"bear", "man", "eight"}) {
    const TestModel standard = load_standard_model(name);
    const SkeletexModel model = regular_grid(device(), encode_model(device(), standard.mesh, standard.skeleton).model);
    const SkeletexModel base = resample_model(device(), model, 64);
    const DisplacementPicture picture = bake_displacement(device(), model, base);
    const TriangleMesh coarse = reconstruct_mesh(device(), base), fine = reconstruct_mesh(device(), model);
    const double bare = symmetric_mean(measure_metro(device(), fine, coarse, {.samples = 100'000}));
    const MetroReport report = measure_metro(device(), fine, displaced(coarse, picture, 8), {.samples = 100'000});
    EXPECT_LT(symmetric_mean(report), 5e-5) << name;
    EXPECT_LT(symmetric_mean(report), 0.25 * bare) << name;
    EXPECT_LT(std::max(report.forward.max, report.backward.max), 3e-3) << name;
    const GltfScene scene = written_and_read(export_rig(device(), base, {.displacement = &picture}));
    EXPECT_EQ(scene.meshes.at(0).primitives.at(0).texture_coordinates.size(),
              scene.meshes.at(0).primitives.at(0).positions.size());
  }
}

TEST(RigExport, TangentsFollowTheTextureCoordinates) {
  const TriangleMesh square{{{0, 0, 0}, {2, 0, 0}, {2, 0, -2}, {0, 0, -2}}, {{0, 1, 2}, {0, 2, 3}}};
  const std::vector<Vec3> up(4, Vec3::UnitY());
  const std::vector<Eigen::Vector2f> straight{{0, 0}, {1, 0}, {1, 1}, {0, 1}}, mirrored{{1, 0}, {0, 0}, {0, 1}, {1, 1}};
  for (const Eigen::Vector4d& tangent : vertex_tangents(square, up, straight))
    EXPECT_LT((tangent - Eigen::Vector4d(1, 0, 0, 1)).norm(), 1e-12);
  for (const Eigen::Vector4d& tangent : vertex_tangents(square, up, mirrored)) {
    EXPECT_LT((tangent - Eigen::Vector4d(-1, 0, 0, -1)).norm(), 1e-12);
    const ShadingFrame frame = tangent_frame(3 * Vec3::UnitY(), tangent);
    EXPECT_LT((frame.bitangent - Vec3(0, 0, -1)).norm(), 1e-12);  // v grows there
  }
}

/// The tangents of a mesh in any pose, and its coarse triangles displaced by a picture in tangent space.
TriangleMesh displaced_in_tangent_space(const TriangleMesh& base, const DisplacementPicture& picture, int steps) {
  MeshAttributes attributes;
  attributes.normals.values = vertex_normals(base);
  attributes.texture_coordinates = picture.coordinates;
  const SplitMesh split = split_vertices(base, attributes);
  const std::vector<Eigen::Vector4d> tangents =
      vertex_tangents(split.mesh, split.attributes.normals.values, split.attributes.texture_coordinates.values);
  return displaced(base, picture, steps, [&](std::size_t t, const Vec3& share, const Vec3& vector) {
    Vec3 normal = Vec3::Zero();
    Eigen::Vector4d tangent = Eigen::Vector4d::Zero();
    for (int k = 0; k < 3; ++k) {
      normal += share[k] * split.attributes.normals.values[split.mesh.triangles[t][k]];
      tangent += share[k] * tangents[split.mesh.triangles[t][k]];
    }
    const ShadingFrame frame = tangent_frame(normal, tangent);
    return Vec3(vector.x() * frame.tangent + vector.y() * frame.normal + vector.z() * frame.bitangent);
  });
}

TEST(RigExport, DisplacementsInTangentSpaceGiveTheSurfaceAndTurnWithIt) {
  for (const char* name : {"bear", "man", "eight"}) {
    const TestModel standard = load_standard_model(name);
    const SkeletexModel model = regular_grid(device(), encode_model(device(), standard.mesh, standard.skeleton).model);
    const SkeletexModel base = resample_model(device(), model, 64);
    const DisplacementPicture picture = bake_displacement(device(), model, base, DisplacementSpace::kTangent);
    const TriangleMesh coarse = reconstruct_mesh(device(), base), fine = reconstruct_mesh(device(), model);
    const double bare = symmetric_mean(measure_metro(device(), fine, coarse, {.samples = 100'000}));
    const TriangleMesh result = displaced_in_tangent_space(coarse, picture, 8);
    const MetroReport report = measure_metro(device(), fine, result, {.samples = 100'000});
    EXPECT_LT(symmetric_mean(report), 5e-5) << name;
    EXPECT_LT(symmetric_mean(report), 0.25 * bare) << name;
    EXPECT_LT(std::max(report.forward.max, report.backward.max), 3e-3) << name;
    TriangleMesh turned = coarse;
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(1.2, Vec3(1, 2, 3).normalized()));
    for (Vec3& p : turned.positions) p = turn * p;
    std::vector<Vec3> expected = result.positions;
    for (Vec3& p : expected) p = turn * p;
    EXPECT_LT(largest_distance(displaced_in_tangent_space(turned, picture, 8).positions, expected),
              1e-5 * model.diagonal)
        << name;
  }
}

TEST(RigExport, NormalsAreThoseOfTheModel) {
  SkeletexModel model = model_of(lone_bone(), 0.15);
  const PreparedModel prepared(model);
  MeshAttributes attributes;
  for (const Vec3& p : reconstruct_mesh(device(), prepared).positions)
    attributes.normals.values.push_back((p + Vec3(0, 0, 0.2)).normalized());
  model.layers = layers_of_vertices(prepared, attributes);
  const std::vector<Vec3> normals = vertex_attributes(model).normals.values;
  const GltfScene scene = written_and_read(export_rig(device(), model));
  EXPECT_LT(largest_distance(scene.meshes.at(0).primitives.at(0).normals, normals), 1e-6);
}

TEST(RigExport, WeightsAreTheFourStrongestAndSumToOne) {
  const SkeletexModel model = model_of(cross(6), 0.3);
  const PreparedModel prepared(model);
  const BindMesh bind = reconstruct_bind_mesh(device(), prepared);
  const Skin skin = make_skin(device(), prepared, bind.inner);
  const VertexInfluences four = strongest_influences(skin);
  std::vector<std::vector<float>> all;
  for (std::size_t bone = 0; bone < model.skeleton.bones.size(); ++bone)
    all.push_back(vertex_weights(skin, static_cast<int>(bone)));
  int cut = 0;
  for (std::size_t v = 0; v < four.bones.size(); ++v) {
    double sum = 0, kept = 0;
    float weakest = 1;
    for (int i = 0; i < 4; ++i) {
      sum += four.weights[v][i];
      if (four.weights[v][i] == 0) continue;
      kept += all[four.bones[v][i]][v];
      weakest = std::min(weakest, all[four.bones[v][i]][v]);
    }
    EXPECT_NEAR(sum, 1, 1e-7);
    for (std::size_t bone = 0; bone < all.size(); ++bone) {
      if (all[bone][v] <= weakest) continue;
      EXPECT_NE(std::find(four.bones[v].begin(), four.bones[v].end(), static_cast<int>(bone)), four.bones[v].end());
    }
    for (int i = 0; i < 4; ++i) {
      if (four.weights[v][i] == 0) continue;
      EXPECT_NEAR(four.weights[v][i], all[four.bones[v][i]][v] / kept, 1e-5);
    }
    cut += kept < 0.9999;
  }
  EXPECT_GT(cut, 0);  // a hub of six bones: else the test says nothing
}

TEST(RigExport, PlacementTurnsTheWholeRig) {
  const SkeletexModel model = model_of(chain(3), 0.2);
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(-std::numbers::pi / 2, Vec3::UnitX()));
  const GltfScene scene = written_and_read(export_rig(device(), model, {.placement = turn, .animations = {}}));
  std::vector<Vec3> expected = reconstruct_mesh(device(), model).positions;
  for (Vec3& p : expected) p = turn * p;
  EXPECT_LT(largest_distance(play(scene, nullptr, 0), expected), 1e-6 * model.diagonal);
}

TEST(MeshFile, StlAndGltfHoldTheMesh) {
  const ScratchFolder folder;
  const TriangleMesh mesh = torus_shape().mesh;
  write_mesh(folder / "torus.stl", mesh);
  const MeshFile stl = read_mesh(folder / "torus.stl");
  EXPECT_EQ(stl.mesh.triangles.size(), mesh.triangles.size());
  EXPECT_TRUE(measure_manifold(stl.mesh).is_closed_manifold());
  EXPECT_NEAR(signed_volume(stl.mesh), signed_volume(mesh), 1e-5 * signed_volume(mesh));
  write_mesh(folder / "torus.glb", mesh);
  const GltfScene scene = read_gltf(folder / "torus.glb");
  EXPECT_EQ(scene.meshes.at(0).primitives.at(0).triangles, mesh.triangles);
  EXPECT_LT(largest_distance(scene.meshes[0].primitives[0].positions, mesh.positions), 1e-6);
}

TEST(MeshFile, GltfHoldsColoursAndThePicture) {
  const SkeletexModel model = coloured(model_of(random_tree(6, 3), 0.15));
  const TriangleMesh mesh = reconstruct_mesh(device(), model);
  MeshAttributes attributes = vertex_attributes(model);
  const ScratchFolder folder;
  write_mesh(folder / "colours.glb", mesh, attributes);
  const MeshFile by_vertex = read_mesh(folder / "colours.glb");
  ASSERT_EQ(by_vertex.attributes.colours.values.size(), attributes.colours.values.size());
  for (std::size_t v = 0; v < mesh.positions.size(); ++v)
    ASSERT_LT((by_vertex.attributes.colours.values[v] - attributes.colours.values[v]).norm(), 1e-6);

  BakedTexture baked = bake_texture(model, model, mesh);
  attributes.colours = {};
  attributes.texture_coordinates = baked.coordinates;
  attributes.materials.emplace_back().image = baked.image;
  write_mesh(folder / "picture.glb", mesh, attributes);
  const MeshFile textured = read_mesh(folder / "picture.glb");
  EXPECT_TRUE(measure_manifold(textured.mesh).is_closed_manifold());
  ASSERT_EQ(textured.attributes.materials.size(), 1u);
  EXPECT_EQ(textured.attributes.materials[0].image.rgba, baked.image.rgba);
  ASSERT_EQ(textured.mesh.triangles.size(), mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (int k = 0; k < 3; ++k) {
      const auto uv_of = [&](const CornerValues<Eigen::Vector2f>& of, const TriangleMesh& in) {
        return of.values[of.of(in, t)[k]];
      };
      ASSERT_LT((uv_of(textured.attributes.texture_coordinates, textured.mesh) - uv_of(baked.coordinates, mesh)).norm(),
                1e-6);
    }
}

TEST(GltfFile, DamagedFilesAreRefusedWithAReason) {
  const ScratchFolder folder;
  const SkeletexModel model = model_of(chain(3), 0.2);
  write_gltf(folder / "rig.glb", export_rig(device(), model));
  std::string bytes;
  {
    std::ifstream in(folder / "rig.glb", std::ios::binary);
    bytes.assign(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
  }
  const auto message_of = [&](std::string changed) {
    std::ofstream(folder / "changed.glb", std::ios::binary) << changed;
    try {
      read_gltf(folder / "changed.glb");
      return std::string();
    } catch (const IoError& error) {
      return std::string(error.what());
    }
  };
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string changed = bytes;
    const std::size_t at = changed.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    EXPECT_EQ(from.size(), to.size());
    if (at != std::string::npos) changed.replace(at, from.size(), to);
    return changed;
  };
  EXPECT_EQ(message_of(bytes), "");
  EXPECT_NE(message_of(bytes.substr(0, bytes.size() / 2)), "");
  EXPECT_NE(message_of("no glTF"), "");
  EXPECT_NE(message_of(with("\"skin\":0", "\"skin\":7")).find("skin"), std::string::npos);
  EXPECT_NE(message_of(with("\"joints\":[2", "\"joints\":[9")).find("there is no node 9"), std::string::npos);
  // Whatever a byte is changed to, there is an answer.
  std::mt19937 random(1);
  for (int i = 0; i < 300; ++i) {
    std::string changed = bytes;
    changed[20 + random() % 3000] = static_cast<char>(random() % 256);
    message_of(changed);
  }
}

}  // namespace
}  // namespace skeletex
