// SPDX-License-Identifier: MIT
#include "skeletex/io/gltf/write_gltf.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <sstream>

#include "skeletex/io/atomic_file.h"
#include "skeletex/io/gltf/tinygltf.h"
#include "skeletex/io/image_file.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

constexpr std::size_t kMostBytes = 0xf0000000;  // the format counts bytes with 32 bits

/// Collects the binary part: one buffer, a view and an accessor for each array.
class GltfBuffer {
 public:
  GltfBuffer(tinygltf::Model& model, std::string where) : model_(model), where_(std::move(where)) {
    model_.buffers.emplace_back();
  }

  /// \param target  of the view; 0: none
  /// \return the view
  int add_view(std::string_view content, int target = 0) {
    std::vector<unsigned char>& bytes = model_.buffers[0].data;
    bytes.resize((bytes.size() + 3) / 4 * 4);
    tinygltf::BufferView view;
    view.buffer = 0;
    view.byteOffset = bytes.size();
    view.byteLength = content.size();
    view.target = target;
    if (bytes.size() + view.byteLength > kMostBytes)
      throw IoError(fmt::format("{}: a glTF file cannot hold that many vertices; export fewer texels", where_));
    bytes.insert(bytes.end(), content.begin(), content.end());
    model_.bufferViews.push_back(view);
    return static_cast<int>(model_.bufferViews.size()) - 1;
  }

  /// \param values  of one accessor behind each other
  /// \param target  of the view; 0: none
  /// \return the accessor
  template <class T>
  int add(const std::vector<T>& values, int component_type, int type, int target, bool has_bounds = false) {
    tinygltf::Accessor accessor;
    accessor.bufferView = add_view({reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)}, target);
    accessor.componentType = component_type;
    accessor.type = type;
    const int components = tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(type));
    accessor.count = values.size() / components;
    if (has_bounds)
      for (int c = 0; c < components; ++c) {
        const auto [lowest, highest] = bounds(values, c, components);
        accessor.minValues.push_back(static_cast<double>(lowest));
        accessor.maxValues.push_back(static_cast<double>(highest));
      }
    model_.accessors.push_back(accessor);
    return static_cast<int>(model_.accessors.size()) - 1;
  }
  int add_floats(const std::vector<float>& values, int type, int target, bool has_bounds = false) {
    if (!std::all_of(values.begin(), values.end(), [](float x) { return std::isfinite(x); }))
      throw IoError(where_ + ": a number is not finite in single precision; nothing was written");
    return add(values, TINYGLTF_COMPONENT_TYPE_FLOAT, type, target, has_bounds);
  }

 private:
  template <class T>
  static std::pair<T, T> bounds(const std::vector<T>& values, int component, int components) {
    std::pair<T, T> result{values[component], values[component]};
    for (std::size_t i = component; i < values.size(); i += components) {
      result.first = std::min(result.first, values[i]);
      result.second = std::max(result.second, values[i]);
    }
    return result;
  }

  tinygltf::Model& model_;
  std::string where_;
};

/// The components of vectors behind each other.
template <class Vectors>
std::vector<float> flat(const Vectors& vectors) {
  std::vector<float> values;
  values.reserve(vectors.size() * (vectors.empty() ? 0 : vectors.front().size()));
  for (const auto& vector : vectors)
    for (const auto x : vector) values.push_back(static_cast<float>(x));
  return values;
}

void add_skin_attributes(GltfBuffer& buffer, const GltfPrimitive& from, tinygltf::Primitive& to) {
  const std::size_t count = from.positions.size();
  const bool is_small = std::all_of(from.joints.begin(), from.joints.end(), [](int joint) { return joint < 256; });
  for (int set = 0; 4 * set < from.influences; ++set) {
    std::vector<float> weights(4 * count, 0.f);
    std::vector<std::uint16_t> joints(4 * count, 0);
    for (std::size_t v = 0; v < count; ++v)
      for (int i = 0; i < 4 && 4 * set + i < from.influences; ++i) {
        const std::size_t at = v * from.influences + 4 * set + i;
        if (from.weights[at] == 0) continue;
        weights[4 * v + i] = from.weights[at];
        joints[4 * v + i] = static_cast<std::uint16_t>(from.joints[at]);
      }
    to.attributes[fmt::format("JOINTS_{}", set)] =
        is_small ? buffer.add(std::vector<std::uint8_t>(joints.begin(), joints.end()),
                              TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE, TINYGLTF_TYPE_VEC4, TINYGLTF_TARGET_ARRAY_BUFFER)
                 : buffer.add(joints, TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT, TINYGLTF_TYPE_VEC4,
                              TINYGLTF_TARGET_ARRAY_BUFFER);
    to.attributes[fmt::format("WEIGHTS_{}", set)] =
        buffer.add_floats(weights, TINYGLTF_TYPE_VEC4, TINYGLTF_TARGET_ARRAY_BUFFER);
  }
}

tinygltf::Primitive make_primitive(GltfBuffer& buffer, const GltfPrimitive& from) {
  tinygltf::Primitive to;
  to.mode = TINYGLTF_MODE_TRIANGLES;
  to.material = from.material;
  constexpr int kVertices = TINYGLTF_TARGET_ARRAY_BUFFER;
  to.attributes["POSITION"] = buffer.add_floats(flat(from.positions), TINYGLTF_TYPE_VEC3, kVertices, true);
  if (!from.normals.empty())
    to.attributes["NORMAL"] = buffer.add_floats(flat(from.normals), TINYGLTF_TYPE_VEC3, kVertices);
  if (!from.tangents.empty())
    to.attributes["TANGENT"] = buffer.add_floats(flat(from.tangents), TINYGLTF_TYPE_VEC4, kVertices);
  if (!from.texture_coordinates.empty())
    to.attributes["TEXCOORD_0"] = buffer.add_floats(flat(from.texture_coordinates), TINYGLTF_TYPE_VEC2, kVertices);
  if (!from.colours.empty())
    to.attributes["COLOR_0"] = buffer.add_floats(flat(from.colours), TINYGLTF_TYPE_VEC4, kVertices);
  add_skin_attributes(buffer, from, to);
  std::vector<std::uint32_t> indices;
  indices.reserve(3 * from.triangles.size());
  for (const Triangle& t : from.triangles) indices.insert(indices.end(), t.begin(), t.end());
  to.indices = buffer.add(indices, TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT, TINYGLTF_TYPE_SCALAR,
                          TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER);
  return to;
}

tinygltf::Node make_node(const GltfNode& from) {
  tinygltf::Node to;
  to.name = from.name;
  to.mesh = from.mesh;
  to.skin = from.skin;
  if (from.matrix) {
    to.matrix.assign(from.matrix->data(), from.matrix->data() + 16);
    return to;
  }
  const Eigen::Quaterniond& q = from.rotation;
  if (from.translation != Vec3::Zero()) to.translation.assign(from.translation.begin(), from.translation.end());
  if (q.vec() != Vec3::Zero()) to.rotation = {q.x(), q.y(), q.z(), q.w()};
  if (from.scale != Vec3::Ones()) to.scale.assign(from.scale.begin(), from.scale.end());
  return to;
}

void add_nodes(const GltfScene& scene, tinygltf::Model& model) {
  tinygltf::Scene top;
  for (const GltfNode& node : scene.nodes) model.nodes.push_back(make_node(node));
  for (int i = 0; i < static_cast<int>(scene.nodes.size()); ++i) {
    const int parent = scene.nodes[i].parent;
    (parent < 0 ? top.nodes : model.nodes[parent].children).push_back(i);
  }
  model.scenes.push_back(top);
  model.defaultScene = 0;
}

void add_skins(const GltfScene& scene, GltfBuffer& buffer, tinygltf::Model& model) {
  for (const GltfSkin& from : scene.skins) {
    tinygltf::Skin skin;
    skin.name = from.name;
    skin.joints = from.joints;
    std::vector<float> matrices;
    for (const Eigen::Matrix4d& matrix : from.inverse_binds) {
      const Eigen::Matrix4f rounded = matrix.cast<float>();
      matrices.insert(matrices.end(), rounded.data(), rounded.data() + 16);
    }
    if (!matrices.empty()) skin.inverseBindMatrices = buffer.add_floats(matrices, TINYGLTF_TYPE_MAT4, 0);
    model.skins.push_back(skin);
  }
}

tinygltf::AnimationSampler make_sampler(const GltfTrack& track, GltfBuffer& buffer) {
  constexpr std::array kWords{"LINEAR", "STEP", "CUBICSPLINE"};
  std::vector<float> values;
  for (const Eigen::Vector4d& value : track.values)
    for (int i = 0; i < (track.path == GltfPath::kRotation ? 4 : 3); ++i)
      values.push_back(static_cast<float>(value[i]));
  tinygltf::AnimationSampler sampler;
  sampler.interpolation = kWords[static_cast<int>(track.interpolation)];
  sampler.input =
      buffer.add_floats(std::vector<float>(track.times.begin(), track.times.end()), TINYGLTF_TYPE_SCALAR, 0, true);
  sampler.output =
      buffer.add_floats(values, track.path == GltfPath::kRotation ? TINYGLTF_TYPE_VEC4 : TINYGLTF_TYPE_VEC3, 0);
  return sampler;
}

void add_animations(const GltfScene& scene, GltfBuffer& buffer, tinygltf::Model& model) {
  constexpr std::array kWords{"translation", "rotation", "scale"};
  for (const GltfAnimation& from : scene.animations) {
    if (from.tracks.empty()) continue;  // the format has none without channels
    tinygltf::Animation animation;
    animation.name = from.name;
    for (const GltfTrack& track : from.tracks) {
      tinygltf::AnimationChannel channel;
      channel.sampler = static_cast<int>(animation.samplers.size());
      channel.target_node = track.node;
      channel.target_path = kWords[static_cast<int>(track.path)];
      animation.samplers.push_back(make_sampler(track, buffer));
      animation.channels.push_back(channel);
    }
    model.animations.push_back(animation);
  }
}

void add_images(const GltfScene& scene, GltfBuffer& buffer, tinygltf::Model& model, const std::string& where) {
  for (const ColourImage& from : scene.images) {
    tinygltf::Image image;
    image.mimeType = "image/png";
    image.bufferView = buffer.add_view(encode_png(from, where));
    model.images.push_back(image);
  }
}

void add_materials(const GltfScene& scene, tinygltf::Model& model) {
  for (const GltfMaterial& from : scene.materials) {
    tinygltf::Material material;
    material.name = from.name;
    material.pbrMetallicRoughness.metallicFactor = 0;
    material.pbrMetallicRoughness.roughnessFactor = 0.8;
    material.pbrMetallicRoughness.baseColorFactor.assign(from.base_colour.begin(), from.base_colour.end());
    if (from.image >= 0) {
      tinygltf::Texture texture;
      texture.source = from.image;
      material.pbrMetallicRoughness.baseColorTexture.index = static_cast<int>(model.textures.size());
      model.textures.push_back(texture);
    }
    model.materials.push_back(material);
  }
}

}  // namespace

SurfacePrimitive primitive_of(const TriangleMesh& mesh, const MeshAttributes& attributes) {
  const std::vector<Vec3> smooth = attributes.normals.empty() ? vertex_normals(mesh) : std::vector<Vec3>();
  MeshAttributes given{attributes.normals, attributes.colours, attributes.texture_coordinates, {}, {}, {}, {}};
  if (!smooth.empty()) given.normals.values = smooth;
  SplitMesh split = split_vertices(mesh, given);
  SurfacePrimitive result;
  result.primitive.positions = std::move(split.mesh.positions);
  result.primitive.triangles = std::move(split.mesh.triangles);
  result.primitive.normals = std::move(split.attributes.normals.values);
  result.primitive.colours = std::move(split.attributes.colours.values);
  for (Colour& colour : result.primitive.colours)
    colour = colour.cwiseMax(0).cwiseMin(1);  // resampled ones may round to just above 1
  for (const Eigen::Vector2f& uv : split.attributes.texture_coordinates.values)
    result.primitive.texture_coordinates.emplace_back(uv.x(), 1 - uv.y());
  result.primitive.material = 0;
  result.sources = std::move(split.sources);
  return result;
}

GltfMaterial material_of(const MeshAttributes& attributes, std::vector<ColourImage>& images) {
  GltfMaterial material{"surface", Eigen::Vector4f::Ones(), -1};
  if (!attributes.materials.empty() && !attributes.materials[0].image.empty()) {
    material.image = static_cast<int>(images.size());
    images.push_back(attributes.materials[0].image);
  } else if (attributes.colours.empty()) {
    material.base_colour = Eigen::Vector4f(0.8f, 0.8f, 0.8f, 1);
  }
  return material;
}

void write_gltf(const std::filesystem::path& path, const GltfScene& scene) {
  tinygltf::Model model;
  model.asset.version = "2.0";
  model.asset.generator = "Skeletex";
  GltfBuffer buffer(model, path.string());
  for (const GltfMesh& from : scene.meshes) {
    tinygltf::Mesh mesh;
    mesh.name = from.name;
    for (const GltfPrimitive& primitive : from.primitives) mesh.primitives.push_back(make_primitive(buffer, primitive));
    model.meshes.push_back(mesh);
  }
  add_skins(scene, buffer, model);
  add_animations(scene, buffer, model);
  add_images(scene, buffer, model, path.string());
  add_materials(scene, model);
  add_nodes(scene, model);
  std::ostringstream bytes;
  tinygltf::TinyGLTF writer;
  if (!writer.WriteGltfSceneToStream(&model, bytes, false, true))
    throw IoError(fmt::format("{}: the glTF library could not write the scene", path.string()));
  write_atomically(path, [&](const std::filesystem::path& temporary) {
    OutputFile file(temporary, path);
    file.write(bytes.view());
    file.close();
  });
}

}  // namespace skeletex
