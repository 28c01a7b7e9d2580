// SPDX-License-Identifier: MIT
#include "skeletex/rig/export_rig.h"

#include <cmath>

#include "skeletex/close/carry_over.h"
#include "skeletex/convert/resample/resample.h"
#include "skeletex/io/gltf/write_gltf.h"
#include "skeletex/reconstruct/layers/layer_values.h"
#include "skeletex/reconstruct/pose/linear_skin.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/reconstruct/texture/bake_texture.h"

namespace skeletex {
namespace {

/// Colours as a picture in place of those by vertex. Its texels lie on the surface that is exported, and have the
/// colours that the original has there.
void bake_colours(ClContext& context, const PreparedModel& model, const TriangleMesh& bind,
                  const RigExportOptions& options, MeshAttributes& attributes) {
  SkeletexModel picture = resample_model(context, model, options.texture_size);
  if (options.original && !attributes.colours.empty()) {
    const PreparedModel prepared(picture), original(*options.original);
    const TriangleMesh surface = reconstruct_mesh(context, original);
    MeshAttributes colours;
    colours.colours = vertex_attributes(original).colours;
    picture.layers = layers_of_vertices(
        prepared,
        carry_over(surface, build_triangle_tree(surface), colours, {}, reconstruct_mesh(context, prepared)).attributes);
  }
  BakedTexture baked = bake_texture(picture, model, bind);
  attributes.colours = {};
  attributes.texture_coordinates = std::move(baked.coordinates);
  attributes.materials.emplace_back().image = std::move(baked.image);
}

/// Per position of a primitive whose triangles are those of the mesh, in its order.
std::vector<Eigen::Vector4f> tangents_of(const GltfPrimitive& primitive,
                                         const CornerValues<Eigen::Vector4d>& tangents) {
  std::vector<Eigen::Vector4f> result(primitive.positions.size(), Eigen::Vector4f::UnitX());
  for (std::size_t t = 0; t < primitive.triangles.size(); ++t)
    for (int k = 0; k < 3; ++k)
      result[primitive.triangles[t][k]] = tangents.values[tangents.corners[t][k]].cast<float>();
  return result;
}

GltfPrimitive make_primitive(ClContext& context, const PreparedModel& model, const Rig& rig,
                             const RigExportOptions& options, GltfScene& scene) {
  BindMesh bind = reconstruct_bind_mesh(context, model);
  const VertexInfluences influences = strongest_influences(make_skin(context, model, bind.inner));
  MeshAttributes attributes = vertex_attributes(model);
  if (options.texture_size > 0) bake_colours(context, model, bind.mesh, options, attributes);
  if (options.displacement) attributes.texture_coordinates = options.displacement->coordinates;
  const bool has_tangents = options.displacement && !options.displacement->tangents.empty();
  if (has_tangents) attributes.normals = {};  // those of the tangent frames
  scene.materials.push_back(material_of(attributes, scene.images));
  auto [primitive, sources] = primitive_of(in_user_units(std::move(bind.mesh), model.model.skeleton.frame), attributes);
  if (has_tangents) primitive.tangents = tangents_of(primitive, options.displacement->tangents);
  primitive.influences = 4;
  for (const int v : sources)
    for (int i = 0; i < 4; ++i) {
      const float weight = influences.weights[v][i];
      primitive.joints.push_back(weight > 0 ? rig.joint_of_bone[influences.bones[v][i]] : 0);
      primitive.weights.push_back(weight);
    }
  return primitive;
}

/// Tracks of one joint; what stays as it is in the bind pose has none.
void add_tracks(const JointClip& clip, int joint, int node, const JointTransform& bind, double diagonal,
                std::vector<GltfTrack>& tracks) {
  const auto add = [&](GltfPath path, const auto& value_of, const auto& is_bind) {
    GltfTrack track{node, path, GltfInterpolation::kLinear, clip.times, {}};
    bool is_moving = false;
    for (const std::vector<JointTransform>& transforms : clip.transforms) {
      track.values.push_back(value_of(transforms[joint]));
      is_moving = is_moving || !is_bind(transforms[joint]);
    }
    if (is_moving) tracks.push_back(std::move(track));
  };
  const auto vector = [](const Vec3& v) { return Eigen::Vector4d(v.x(), v.y(), v.z(), 0); };
  add(
      GltfPath::kTranslation, [&](const JointTransform& t) { return vector(t.translation); },
      [&](const JointTransform& t) { return (t.translation - bind.translation).norm() <= 1e-9 * diagonal; });
  add(
      GltfPath::kRotation, [](const JointTransform& t) { return t.rotation.coeffs(); },
      [&](const JointTransform& t) { return std::abs(t.rotation.dot(bind.rotation)) >= 1 - 1e-14; });
  add(
      GltfPath::kScale, [&](const JointTransform& t) { return vector(t.scale); },
      [](const JointTransform& t) { return t.scale == Vec3::Ones(); });
}

/// Animations of the model in the user's units.
std::vector<NamedAnimation> in_user_units(std::span<const NamedAnimation> animations, const UnitFrame& frame) {
  std::vector<NamedAnimation> result(animations.begin(), animations.end());
  for (NamedAnimation& named : result)
    for (PoseFrame& moment : named.animation.frames) {
      for (Vec3& node : moment.pose.nodes) node = frame.to_user(node);
      moment.pose.translation *= frame.scale;
    }
  return result;
}

}  // namespace

GltfScene export_rig(ClContext& context, const PreparedModel& prepared, const RigExportOptions& options) {
  const SkeletexModel& model = prepared.model;
  const UnitFrame& frame = model.skeleton.frame;
  const AnimatedRig animated =
      animate_rig(in_frame(model.skeleton, UnitFrame{}), in_user_units(options.animations, frame));
  const Rig& rig = animated.rig;
  GltfScene scene;
  GltfNode body;
  body.name = options.name;
  body.mesh = body.skin = 0;
  scene.nodes.push_back(body);
  GltfNode armature;
  armature.name = options.name + "_rig";
  armature.rotation = options.placement;
  scene.nodes.push_back(armature);
  constexpr int kArmature = 1, kFirstJoint = 2;
  GltfSkin skin{options.name, {}, {}};
  const std::vector<JointTransform> bind = bind_transforms(rig);
  for (std::size_t j = 0; j < rig.joints.size(); ++j) {
    const RigJoint& joint = rig.joints[j];
    GltfNode node;
    node.name = joint.name;
    node.parent = joint.parent < 0 ? kArmature : kFirstJoint + joint.parent;
    node.translation = bind[j].translation;
    node.rotation = bind[j].rotation;
    scene.nodes.push_back(node);
    skin.joints.push_back(kFirstJoint + static_cast<int>(j));
    skin.inverse_binds.push_back(joint.bind.inverse().matrix());
  }
  scene.skins.push_back(skin);
  scene.meshes.push_back({options.name, {make_primitive(context, prepared, rig, options, scene)}});
  for (const JointClip& clip : animated.clips) {
    GltfAnimation animation{clip.name, {}};
    for (std::size_t j = 0; j < rig.joints.size(); ++j)
      add_tracks(clip, static_cast<int>(j), kFirstJoint + static_cast<int>(j), bind[j], frame.scale * model.diagonal,
                 animation.tracks);
    scene.animations.push_back(std::move(animation));
  }
  return scene;
}

}  // namespace skeletex
