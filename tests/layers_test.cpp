// SPDX-License-Identifier: MIT
// What a surface has beside its shape: from the mesh into the model, through edits, and back.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <numbers>
#include <random>

#include "skeletex/close/carry_over.h"
#include "skeletex/convert/encode_model.h"
#include "skeletex/convert/guess_stance.h"
#include "skeletex/convert/resample/resample.h"
#include "skeletex/edit/filter/filter.h"
#include "skeletex/edit/morph/morph.h"
#include "skeletex/edit/transfer/mirror.h"
#include "skeletex/edit/transfer/transfer.h"
#include "skeletex/model/error.h"
#include "skeletex/model/octahedral.h"
#include "skeletex/reconstruct/layers/layer_values.h"
#include "skeletex/reconstruct/layers/turn_normals.h"
#include "skeletex/reconstruct/pose/pose_mesh.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/reconstruct/texture/bake_texture.h"
#include "skeletex/skeletonize/names.h"
#include "support/picture_at.h"
#include "support/shapes.h"

namespace skeletex {
namespace {

ClContext& device() {
  static ClContext context;
  return context;
}

double degrees_between(const Vec3& a, const Vec3& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180 / std::numbers::pi;
}
double mean_degrees(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += degrees_between(a[i], b[i]);
  return sum / static_cast<double>(a.size());
}

/// Values that are linear in space, which triangles hold exactly.
Colour colour_at(const Vec3& p) {
  const Eigen::Vector3f q = p.cast<float>() * 0.1f;
  return {0.5f + q.x(), 0.5f + q.y(), 0.5f + q.z(), 1};
}
MeshAttributes linear_attributes(const TriangleMesh& mesh) {
  MeshAttributes attributes;
  attributes.numbers.push_back({"height", {}});
  for (const Vec3& p : mesh.positions) {
    attributes.colours.values.push_back(colour_at(p));
    attributes.numbers[0].values.push_back(static_cast<float>(p.z()));
  }
  return attributes;
}

SkeletexModel encode(const Shape& shape, int size = 96, std::optional<Method> method = Method::kVsm) {
  const MeshAttributes attributes = linear_attributes(shape.mesh);
  EncodeOptions options;
  options.width = options.height = size;
  options.method = method;
  options.attributes = &attributes;
  return encode_model(device(), shape.mesh, shape.skeleton, options).model;
}

/// The largest difference between a model's colours and numbers and those that its vertices' places have.
double linear_error(const SkeletexModel& model) {
  const TriangleMesh mesh = reconstruct_mesh(device(), model);
  const MeshAttributes attributes = vertex_attributes(model);
  double largest = 0;
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const auto colour_error = (attributes.colours.values[i] - colour_at(mesh.positions[i])).cwiseAbs().maxCoeff();
    largest = std::max({largest, static_cast<double>(colour_error),
                        0.1 * std::abs(static_cast<double>(attributes.numbers[0].values[i]) - mesh.positions[i].z())});
  }
  return largest;
}

TEST(Octahedral, DirectionsComeBack) {
  std::mt19937 random(7);
  std::normal_distribution<float> normal;
  for (int i = 0; i < 10000; ++i) {
    const Eigen::Vector3f direction = Eigen::Vector3f(normal(random), normal(random), normal(random)).normalized();
    const Eigen::Vector2f p = octahedral_of(direction);
    EXPECT_LE(p.cwiseAbs().maxCoeff(), 1);
    EXPECT_LT((direction_of(p) - direction).norm(), 1e-6);
  }
  for (int axis = 0; axis < 3; ++axis)
    for (const float sign : {-1.f, 1.f}) {
      const Eigen::Vector3f direction = sign * Eigen::Vector3f::Unit(axis);
      EXPECT_LT((direction_of(octahedral_of(direction)) - direction).norm(), 1e-6);
    }
}

TEST(Layers, ColoursAndNumbersAreThoseOfTheTexelsPlaces) {
  for (const auto& [name, genus, shape] : all_shapes())
    for (const std::optional<Method>& method : {std::optional(Method::kVsm), std::optional(Method::kSpd)}) {
      const SkeletexModel model = encode(shape, 96, method);
      const double diagonal = model.diagonal;
      // Texels lie off the mesh by no more than the prefilter or a missed ray moves them; samples of seams lie between
      // columns.
      EXPECT_LT(linear_error(model), 0.1 * 0.02 * diagonal) << name;
    }
}

TEST(Layers, NormalsOfAModelAreThoseOfTheMesh) {
  const Shape shape = torus_shape();
  const SkeletexModel model = encode(shape, 128);
  const TriangleMesh mesh = reconstruct_mesh(device(), model);
  const MeshAttributes attributes = vertex_attributes(model);
  std::vector<Vec3> exact;
  for (const Vec3& p : mesh.positions) {
    const Vec3 core = 2 * Vec3(p.x(), p.y(), 0).normalized();
    exact.push_back((p - core).normalized());
  }
  EXPECT_LT(mean_degrees(attributes.normals.values, exact), 0.5);
}

TEST(Layers, CreasesSeparateNormalsOnBothSides) {
  TriangleMesh cube;
  for (int i = 0; i < 8; ++i) cube.positions.emplace_back(i & 1, (i >> 1) & 1, (i >> 2) & 1);
  cube.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  ASSERT_NEAR(signed_volume(cube), 1, 1e-12);
  const CornerValues<Vec3> sharp = creased_normals(cube, 0.5);
  for (std::size_t t = 0; t < cube.triangles.size(); ++t)
    for (const int corner : sharp.of(cube, t))
      EXPECT_LT((sharp.values[corner] - area_vector(cube, cube.triangles[t]).normalized()).norm(), 1e-12);
  EXPECT_EQ(sharp.values.size(), 24u);
  const CornerValues<Vec3> smooth = creased_normals(cube, std::numbers::pi);
  const std::vector<Vec3> means = vertex_normals(cube);
  for (std::size_t t = 0; t < cube.triangles.size(); ++t)
    for (int k = 0; k < 3; ++k)
      EXPECT_LT((smooth.values[smooth.corners[t][k]] - means[cube.triangles[t][k]]).norm(), 1e-12);
}

TEST(Layers, DoNotChangeTexels) {
  const Shape shape = y_shape();
  EncodeOptions options;
  options.width = options.height = 96;
  const SkeletexModel with = encode_model(device(), shape.mesh, shape.skeleton, options).model;
  options.layers.has_normals = false;
  const SkeletexModel without = encode_model(device(), shape.mesh, shape.skeleton, options).model;
  EXPECT_EQ(with.layers.size(), 1u);
  EXPECT_TRUE(without.layers.empty());
  EXPECT_EQ(with.texture.along, without.texture.along);
  EXPECT_EQ(with.texture.around, without.texture.around);
  EXPECT_EQ(with.texture.out, without.texture.out);
}

TEST(Layers, NormalsTurnWithASurfaceThatTurns) {
  const SkeletexModel model = encode(creature_shape());
  const TriangleMesh bind = reconstruct_mesh(device(), model);
  const std::vector<Vec3> normals = vertex_attributes(model).normals.values;
  const Eigen::Matrix3d rotation = Eigen::AngleAxisd(1.2, Vec3(1, 2, 3).normalized()).toRotationMatrix();
  std::vector<Vec3> turned, expected;
  for (std::size_t i = 0; i < bind.positions.size(); ++i) {
    turned.push_back(rotation * bind.positions[i] + Vec3(4, 5, 6));
    expected.push_back(rotation * normals[i]);
  }
  EXPECT_LT(mean_degrees(turn_normals(bind, normals, turned), expected), 1e-4);
  EXPECT_EQ(turn_normals(bind, normals, bind.positions), normals);
  // A stretch turns normals the other way than edges: they stay perpendicular to the surface.
  std::vector<Vec3> stretched;
  for (const Vec3& p : bind.positions) stretched.push_back(p.cwiseProduct(Vec3(1, 1, 3)));
  const TriangleMesh mesh{stretched, bind.triangles};
  EXPECT_LT(mean_degrees(turn_normals(bind, vertex_normals(bind), stretched), vertex_normals(mesh)), 2);
}

TEST(Layers, OtherSizesHaveTheSameValues) {
  const SkeletexModel model = encode(creature_shape(), 128);
  for (const int size : {64, 128, 200}) {
    const SkeletexModel other = resample_model(device(), model, size);
    ASSERT_EQ(other.layers.size(), 3u);
    EXPECT_LT(linear_error(other), 0.1 * 0.03 * model.diagonal) << size;
    const TriangleMesh mesh = reconstruct_mesh(device(), other);
    EXPECT_LT(mean_degrees(vertex_attributes(other).normals.values, vertex_normals(mesh)), 8) << size;
  }
}

TEST(Layers, StepsStayBetweenTheirValuesAtOtherSizes) {
  const Shape shape = creature_shape();
  const MeshAttributes attributes = linear_attributes(shape.mesh);
  EncodeOptions options;
  options.width = options.height = 64;
  options.has_snap = options.has_fit = false;
  options.attributes = &attributes;
  SkeletexModel model = encode_model(device(), shape.mesh, shape.skeleton, options).model;
  std::vector<float> steps(64 * 64);
  for (std::size_t i = 0; i < steps.size(); ++i) steps[i] = i / 4 % 2 == 0 ? 1.f : 0.f;
  const auto layer = std::find_if(model.layers.begin(), model.layers.end(),
                                  [](const Layer& l) { return l.kind == LayerKind::kNumber; });
  ASSERT_NE(layer, model.layers.end());
  layer->planes = {steps};
  model.bone_weights.assign(model.skeleton.bones.size(), steps);
  for (const int size : {40, 150}) {
    const SkeletexModel other = resample_model(device(), model, size);
    for (const std::vector<float>& plane : {find_layer(other, layer->name)->planes[0], other.bone_weights[0]}) {
      const auto [least, most] = std::minmax_element(plane.begin(), plane.end());
      EXPECT_GE(*least, -1e-6f) << size;
      EXPECT_LE(*most, 1 + 1e-6f) << size;
      EXPECT_GT(*most, 0.9f) << size;
    }
  }
}

TEST(Layers, AMeshInPlaceOfAnotherOneHasThePictureAndTheNormalsOfThatOne) {
  const Shape shape = creature_shape();
  MeshAttributes attributes;  // normals that lean, and a picture of stripes that are narrower than triangles
  Material material;
  material.image = {32, 1, {}};
  for (int i = 0; i < 32; ++i)
    for (int channel = 0; channel < 4; ++channel)
      material.image.rgba.push_back(static_cast<std::uint8_t>(channel == 3 || i / 4 % 2 == 0 ? 255 : 0));
  attributes.materials = {material};
  attributes.triangle_materials.assign(shape.mesh.triangles.size(), 0);
  for (const Vec3& p : shape.mesh.positions)
    attributes.texture_coordinates.values.emplace_back(static_cast<float>(p.x() + 0.3 * p.z()), 0.5f);
  for (const Vec3& normal : vertex_normals(shape.mesh))
    attributes.normals.values.push_back((normal + Vec3(0.2, 0.1, 0)).normalized());
  // Moved and scaled, as the frame in which models are encoded is not the user's.
  TriangleMesh user = shape.mesh;
  const UnitFrame frame{Vec3(5, 6, 7), 3};
  for (Vec3& p : user.positions) p = frame.to_user(p);
  const CarriedOver carried = carry_over(user, build_triangle_tree(user), attributes, {}, user);
  std::array<SkeletexModel, 2> models;
  for (int i = 0; i < 2; ++i) {
    EncodeOptions options;
    options.width = options.height = 96;
    options.attributes = i == 0 ? &attributes : &carried.attributes;
    Skeleton skeleton = shape.skeleton;
    skeleton.frame = frame;
    models[i] = encode_model(device(), shape.mesh, skeleton, options).model;
  }
  const std::vector<float>&red = find_layer(models[0], kColourLayer)->planes[0],
        &carried_red = find_layer(models[1], kColourLayer)->planes[0];
  EXPECT_GT(*std::max_element(red.begin(), red.end()), 0.9f);
  double difference = 0;
  for (std::size_t i = 0; i < red.size(); ++i) difference += std::abs(red[i] - carried_red[i]);
  EXPECT_LT(difference / static_cast<double>(red.size()), 1e-3);
  // But for texels on edges and where normals lean too far from their triangles.
  EXPECT_LT(mean_degrees(vertex_attributes(models[0]).normals.values, vertex_attributes(models[1]).normals.values), 2);
}

TEST(Layers, AMorphHasItsModelsValuesAtItsEnds) {
  const Shape shape = creature_shape();
  const SkeletexModel a = encode(shape, 96);
  Shape wide = shape;
  for (Vec3& p : wide.mesh.positions) p.y() *= 1.3;
  for (Node& node : wide.skeleton.nodes) node.position.y() *= 1.3;
  const SkeletexModel b = encode(wide, 96);
  const Correspondence same = identity_correspondence(a.skeleton);
  const Morph morph(device(), {a, b}, std::span(&same, 1));
  for (const double t : {0.0, 1.0}) {
    const SkeletexModel end = morph.at(std::vector{1 - t, t});
    EXPECT_LT(linear_error(end), 0.1 * 0.02 * a.diagonal) << t;
  }
  const SkeletexModel middle = morph.at(std::vector{0.5, 0.5});
  ASSERT_EQ(middle.layers.size(), 3u);
  const TriangleMesh mesh = reconstruct_mesh(device(), middle);
  EXPECT_LT(mean_degrees(vertex_attributes(middle).normals.values, vertex_normals(mesh)), 8);
  EXPECT_LT(linear_error(middle), 0.1 * 0.06 * a.diagonal);
}

TEST(Layers, ATransferTakesTheSourcesValuesAndLeavesTheRest) {
  const SkeletexModel target = encode(creature_shape(), 96);
  SkeletexModel source = target;
  for (Layer& layer : source.layers)
    if (layer.kind == LayerKind::kColour)
      for (std::vector<float>& plane : layer.planes) std::fill(plane.begin(), plane.end(), 0.25f);
  int bone = -1;
  for (std::size_t i = 0; i < target.skeleton.bones.size(); ++i)
    if (target.ends[i][0].arcs.empty() != target.ends[i][1].arcs.empty()) bone = static_cast<int>(i);
  ASSERT_GE(bone, 0);
  const std::string name = target.skeleton.bones[bone].name;
  const SkeletexModel result = transfer(device(), source, target, {{name, name}});
  ASSERT_EQ(result.layers.size(), 3u);
  const auto colour = [](const SkeletexModel& model, std::size_t texel) {
    return find_layer(model, kColourLayer)->planes[0][texel];
  };
  const Rectangle& own = target.patches[bone].rectangle;
  const BoneEnd free = target.ends[bone][0].arcs.empty() ? BoneEnd::kHead : BoneEnd::kTail;
  const std::size_t tip =
      static_cast<std::size_t>(own.y + (free == BoneEnd::kHead ? 1 : own.height - 2)) * target.texture.width + own.x;
  EXPECT_NEAR(colour(result, tip), 0.25, 1e-3);
  for (std::size_t i = 0; i < target.patches.size(); ++i) {
    if (static_cast<int>(i) == bone) continue;
    const Rectangle& r = target.patches[i].rectangle;
    for (int row = 0; row < r.height; ++row)
      for (int j = 0; j < r.width; ++j) {
        const std::size_t texel = static_cast<std::size_t>(r.y + row) * target.texture.width + r.x + j;
        for (std::size_t l = 0; l < result.layers.size(); ++l)
          for (std::size_t k = 0; k < result.layers[l].planes.size(); ++k)
            ASSERT_EQ(result.layers[l].planes[k][texel], target.layers[l].planes[k][texel]);
      }
  }
  const TriangleMesh mesh = reconstruct_mesh(device(), result);
  EXPECT_LT(mean_degrees(vertex_attributes(result).normals.values, vertex_normals(mesh)), 8);
}

TEST(Layers, AMirroredModelHasMirroredNormals) {
  const SkeletexModel model = encode(creature_shape(), 96);
  const SkeletexModel image = mirrored(model);
  const TriangleMesh mesh = reconstruct_mesh(device(), image);
  EXPECT_LT(mean_degrees(vertex_attributes(image).normals.values, vertex_normals(mesh)), 8);
}

TEST(Layers, NormalsOfAFilteredModelFollowItsSurface) {
  const SkeletexModel model = encode(creature_shape(), 96);
  NoiseOptions noise;
  noise.amplitude = 0.01;
  const SkeletexModel rough = add_noise(device(), model, noise).model;
  const TriangleMesh mesh = reconstruct_mesh(device(), rough);
  const MeshAttributes attributes = vertex_attributes(rough);
  EXPECT_LT(mean_degrees(attributes.normals.values, vertex_normals(mesh)), 8);
  EXPECT_GT(mean_degrees(attributes.normals.values, vertex_attributes(model).normals.values), 8);
  noise.amplitude = 0;
  const SkeletexModel same = add_noise(device(), model, noise).model;
  EXPECT_LT(linear_error(same), 0.1 * 0.02 * model.diagonal);
}

TEST(Layers, AFilteredLayerIsSmootherAndTheSurfaceStays) {
  SkeletexModel model = encode(creature_shape(), 96);
  Layer& numbers = model.layers.back();
  ASSERT_EQ(numbers.kind, LayerKind::kNumber);
  std::mt19937 random(3);
  std::uniform_real_distribution<float> noise(-1, 1);
  for (float& x : numbers.planes[0]) x = 5 + noise(random);
  const SkeletexModel smooth = filter_layer(device(), model, {.layer = numbers.name, .scale = 0.03});
  EXPECT_EQ(smooth.texture.out, model.texture.out);
  EXPECT_EQ(smooth.layers[0].planes, model.layers[0].planes);
  const auto spread = [](const SkeletexModel& of) {
    const std::vector<float> values = vertex_attributes(of).numbers[0].values;
    double sum = 0, squares = 0;
    for (const float x : values) sum += x, squares += static_cast<double>(x) * x;
    const auto n = static_cast<double>(values.size());
    return std::array{sum / n, std::sqrt(squares / n - sum * sum / n / n)};
  };
  EXPECT_NEAR(spread(smooth)[0], spread(model)[0], 0.05);
  EXPECT_LT(spread(smooth)[1], 0.3 * spread(model)[1]);
  EXPECT_EQ(filter_layer(device(), model, {.layer = kColourLayer, .gain = 0}).layers[1].planes, model.layers[1].planes);
  EXPECT_THROW(filter_layer(device(), model, {.layer = "none"}), InputError);
}

TEST(Layers, ABakedPictureHasTheColoursOfTheSurfaceAlsoAcrossSeams) {
  const SkeletexModel model = encode(creature_shape(), 128);
  const TriangleMesh mesh = reconstruct_mesh(device(), model);
  const BakedTexture baked = bake_texture(model, model, mesh);
  double largest = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    Eigen::Vector2f uv = Eigen::Vector2f::Zero();
    Vec3 middle = Vec3::Zero();
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector2f& corner = baked.coordinates.values[baked.coordinates.corners[t][k]];
      EXPECT_TRUE(corner.minCoeff() > 0 && corner.maxCoeff() < 1);
      uv += corner / 3;
      middle += mesh.positions[mesh.triangles[t][k]] / 3;
    }
    const Vec3 expected = colour_at(middle).head<3>().cast<double>().cwiseMax(0).cwiseMin(1);
    largest = std::max(largest, (picture_at(baked.image, uv) - expected).cwiseAbs().maxCoeff());
  }
  EXPECT_LT(largest, 0.1 * 0.03 * model.diagonal + 0.01);  // 8 bits
  SkeletexModel bare = model;
  bare.layers.clear();
  EXPECT_THROW(bake_texture(bare, model, mesh), InputError);
}

TEST(Stance, FollowsTheSidesThatBonesAreNamedAfter) {
  Skeleton body;
  for (const Vec3& p : {Vec3(0, 1, 0), Vec3(-0.3, 0, 0), Vec3(0.3, 0.1, 0), Vec3(0, 0, 1)})
    body.nodes.push_back({"", p});
  TriangleMesh box;
  box.positions = {Vec3(-0.5, -0.1, -0.2), Vec3(0.5, 1.1, 0.2)};
  const auto front = [&](const std::string& first, const std::string& second, int second_tail = 2) {
    body.bones = {{first, 0, 1, {}}, {second, 0, second_tail, {}}};
    return guess_stance(box, body).front;
  };
  const Vec3 z = Vec3::UnitZ();
  EXPECT_EQ(front("right_leg", "left_leg"), z);
  EXPECT_EQ(front("left_leg", "right_leg"), -z);
  EXPECT_EQ(front("Leg.L", "Leg.R"), -z);
  EXPECT_EQ(front("LeftLeg", "RightLeg"), -z);
  EXPECT_EQ(front("hip_L_knee_L", "hip_R_knee_R"), -z);
  EXPECT_EQ(front("left_leg", "right_arm"), z) << "no pair";
  EXPECT_EQ(front("cleft_leg", "bright_leg"), z) << "no sides";
  EXPECT_EQ(front("left_leg", "right_leg", 3), z) << "the sides lie too far along the line of sight";
}

/// A flat patch of surface of area 1e-4.
void add_patch(TriangleMesh& mesh, const Vec3& at) {
  const int first = static_cast<int>(mesh.positions.size());
  for (const Vec3& corner : {Vec3(0, 0, 0), Vec3(0.02, 0, 0), Vec3(0, 0, 0.01)}) mesh.positions.push_back(at + corner);
  mesh.triangles.push_back({first, first + 1, first + 2});
}

/// A person, as far as a guess goes: a body 2 high, ankles, and soles that are off them.
TriangleMesh standing(double soles) {
  TriangleMesh mesh;
  mesh.positions = {Vec3(-0.5, 0, -0.3), Vec3(0.5, 2, 0.3)};
  for (const double x : {-0.2, 0.2}) {
    add_patch(mesh, {x, 0.2, 0});
    add_patch(mesh, {x, 0.02, soles});
  }
  return mesh;
}

TEST(Stance, FollowsTheFeetOfAnUprightBodyAndTheHeadOfALongOne) {
  const auto front = [](const TriangleMesh& mesh) { return guess_stance(mesh, {}).front; };
  const Vec3 z = Vec3::UnitZ();
  EXPECT_EQ(front(standing(0.12)), z);
  EXPECT_EQ(front(standing(-0.12)), -z);
  EXPECT_EQ(front(standing(-0.04)), z) << "too little to tell";
  const auto walking = [](double head) {
    TriangleMesh mesh;
    mesh.positions = {Vec3(-0.3, 0, -1), Vec3(0.3, 1, 1)};
    for (const double at : {-0.8, -0.4, 0.0, 0.4, 0.8}) add_patch(mesh, {0, 0.5, at});
    add_patch(mesh, {0, 0.95, head});
    return mesh;
  };
  EXPECT_EQ(front(walking(0.9)), z);
  EXPECT_EQ(front(walking(-0.9)), -z);
  EXPECT_EQ(front(walking(-0.3)), z) << "too little to tell";
  EXPECT_EQ(front(TriangleMesh{{Vec3(0, 0, 0), Vec3(1, 2, 1)}, {}}), z) << "nothing to tell by";
}

TEST(Stance, SaysWhichLimbsOfAMadeSkeletonAreLeft) {
  Skeleton body;
  for (const Vec3& p : {Vec3(0, 1.4, 0), Vec3(0, 1.9, 0), Vec3(-0.4, 1, 0), Vec3(0.4, 1, 0)})
    body.nodes.push_back({"", p});
  body.bones = {{"", 0, 1, {}}, {"", 0, 2, {}}, {"", 0, 3, {}}};
  for (const double soles : {0.12, -0.12}) {
    const TriangleMesh mesh = standing(soles);
    const TriangleTree tree = build_triangle_tree(mesh);
    Skeleton named = body;
    name_by_place(Surface(mesh, tree), MirrorPlane{Vec3(0, 1, 0), Vec3::UnitX()}, named);
    EXPECT_TRUE(named.bones[2].name.starts_with(soles > 0 ? "left_" : "right_")) << named.bones[2].name;
    EXPECT_TRUE(named.bones[1].name.starts_with(soles > 0 ? "right_" : "left_")) << named.bones[1].name;
    EXPECT_EQ(guess_stance(mesh, named).front, guess_stance(mesh, body).front) << "names and shape agree";
  }
}

TEST(Stance, IsGuessedFromTheWayABodyStands) {
  const Shape shape = creature_shape();
  EXPECT_EQ(guess_stance(shape.mesh, shape.skeleton).up, Vec3(Vec3::UnitY()));
  // A walker: long along z, with two feet at the lower end.
  Skeleton walker;
  for (const Vec3& p : {Vec3(0, 0, 1), Vec3(0, 0, 2), Vec3(-0.3, 0, 0), Vec3(0.3, 0, 0)})
    walker.nodes.push_back({"", p});
  walker.bones = {{"spine", 0, 1, {}}, {"leg_1", 0, 2, {}}, {"leg_2", 0, 3, {}}};
  TriangleMesh box;
  box.positions = {Vec3(-0.5, -0.2, -0.1), Vec3(0.5, 0.2, 2.2)};
  EXPECT_EQ(guess_stance(box, walker).up, Vec3(Vec3::UnitZ()));
  EXPECT_EQ(guess_stance(box, walker).front, Vec3(-Vec3::UnitY()));
  EXPECT_EQ(make_stance({0, 0, 2}, std::nullopt).front, Vec3(-Vec3::UnitY()));
  EXPECT_LT((make_stance({0, 1, 0}, Vec3(1, 1, 0)).front - Vec3::UnitX()).norm(), 1e-12);
  EXPECT_THROW(make_stance({0, 1, 0}, Vec3(0, 2, 0)), InputError);
}

}  // namespace
}  // namespace skeletex
