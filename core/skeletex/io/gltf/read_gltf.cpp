// SPDX-License-Identifier: MIT
#include "skeletex/io/gltf/read_gltf.h"

#include <fmt/format.h>
#include <webp/decode.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <stdexcept>

#include "skeletex/io/gltf/accessors.h"
#include "skeletex/io/gltf/decompress.h"
#include "skeletex/io/gltf/tinygltf.h"
#include "skeletex/io/read_file.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

/// Extensions that a file may need: they are read, or change nothing that is; pictures in other formats are left out.
constexpr std::array kKnownExtensions{"KHR_mesh_quantization",
                                      "KHR_draco_mesh_compression",
                                      "EXT_meshopt_compression",
                                      "KHR_texture_transform",
                                      "KHR_texture_basisu",
                                      "EXT_texture_webp",
                                      "KHR_lights_punctual",
                                      "VRM",
                                      "VRMC_vrm",
                                      "VRMC_materials_mtoon",
                                      "VRMC_springBone",
                                      "VRMC_node_constraint"};

bool load_webp(tinygltf::Image& image, const unsigned char* bytes, std::size_t size) {
  std::uint8_t* rgba = WebPDecodeRGBA(bytes, size, &image.width, &image.height);
  if (rgba == nullptr) return false;
  image.component = 4;
  image.bits = 8;
  image.pixel_type = TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE;
  image.image.assign(rgba, rgba + std::size_t{4} * image.width * image.height);
  WebPFree(rgba);
  return true;
}

/// A picture that cannot be decoded is no reason to refuse the rest.
bool load_image(tinygltf::Image* image, const int index, std::string* /*error*/, std::string* warning, int width,
                int height, const unsigned char* bytes, int size, void* /*data*/) {
  std::string ignored;
  if (load_webp(*image, bytes, static_cast<std::size_t>(size))) return true;
  if (tinygltf::LoadImageData(image, index, &ignored, warning, width, height, bytes, size, nullptr)) return true;
  image->image.clear();
  return true;
}

tinygltf::Model load(const std::filesystem::path& path) {
  const std::string where = path.string();
  std::string bytes = completed_for_tinygltf(read_file(path, 0xffffffffU));
  tinygltf::TinyGLTF loader;
  loader.SetImageLoader(load_image, nullptr);
  tinygltf::Model model;
  std::string error, warning;
  const auto size = static_cast<unsigned int>(bytes.size());
  bytes.append(8, '\0');  // tinygltf 2.7 forgets the header of the second chunk when it checks where that ends
  const std::string folder = path.has_parent_path() ? path.parent_path().string() : ".";
  bool is_read = false;
  try {
    is_read = bytes.starts_with("glTF")
                  ? loader.LoadBinaryFromMemory(&model, &error, &warning,
                                                reinterpret_cast<const unsigned char*>(bytes.data()), size, folder)
                  : loader.LoadASCIIFromString(&model, &error, &warning, bytes.data(), size, folder);
  } catch (const std::exception& thrown) {
    error = thrown.what();
  }
  if (!is_read) {
    constexpr std::size_t kVersion = 4;  // its place in a binary file
    if (bytes.starts_with("glTF") && bytes.size() > kVersion && bytes[kVersion] == 1)
      throw IoError(fmt::format("{}: glTF version 1; 2.0 is read", where));
    std::replace(error.begin(), error.end(), '\n', ' ');
    throw IoError(fmt::format("{}: not a glTF 2.0 file, or a damaged one: {}", where, error));
  }
  if (!model.asset.version.starts_with("2"))
    throw IoError(fmt::format("{}: glTF version \"{}\"; 2.0 is read", where, model.asset.version));
  for (const std::string& extension : model.extensionsRequired)
    if (!extension.starts_with("KHR_materials_") &&
        std::find(kKnownExtensions.begin(), kKnownExtensions.end(), extension) == kKnownExtensions.end())
      throw IoError(
          fmt::format("{}: the file needs the extension {}, which is not read; save it without", where, extension));
  decompress_gltf(model, where);
  return model;
}

/// Which texture coordinates a picture takes, and what becomes of them before.
struct TextureTransform {
  int set = 0;
  Eigen::Affine2d map = Eigen::Affine2d::Identity();
};

/// KHR_texture_transform: scaled, turned, moved. The sign of the turn is that of its example and of the viewers; the
/// matrix in its text has the other one.
TextureTransform texture_transform(const tinygltf::TextureInfo& texture) {
  TextureTransform result{.set = texture.texCoord};
  const auto found = texture.extensions.find("KHR_texture_transform");
  if (found == texture.extensions.end() || !found->second.IsObject()) return result;
  const tinygltf::Value& extension = found->second;
  const auto number = [](const tinygltf::Value& value, double otherwise) {
    return value.IsNumber() ? value.GetNumberAsDouble() : otherwise;
  };
  const auto pair = [&](const char* key, double otherwise) {
    const bool is_there = extension.Has(key) && extension.Get(key).IsArray() && extension.Get(key).ArrayLen() == 2;
    return is_there ? Eigen::Vector2d(number(extension.Get(key).Get(0), otherwise),
                                      number(extension.Get(key).Get(1), otherwise))
                    : Eigen::Vector2d::Constant(otherwise);
  };
  const double turn = extension.Has("rotation") ? number(extension.Get("rotation"), 0) : 0;
  result.map =
      Eigen::Translation2d(pair("offset", 0)) * Eigen::Rotation2Dd(-turn) * Eigen::AlignedScaling2d(pair("scale", 1));
  if (extension.Has("texCoord") && extension.Get("texCoord").IsInt()) result.set = extension.Get("texCoord").Get<int>();
  return result;
}

/// The picture of a texture, in the format of an extension where it has one.
int picture_of(const tinygltf::Texture& texture) {
  const auto webp = texture.extensions.find("EXT_texture_webp");
  if (webp == texture.extensions.end() || !webp->second.Has("source") || !webp->second.Get("source").IsInt())
    return texture.source;
  return webp->second.Get("source").Get<int>();
}

/// An animation makes no sense; the rest of the file may.
struct AnimationError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

class GltfReader {
 public:
  GltfReader(const tinygltf::Model& model, std::string where)
      : model_(model), where_(where), accessors_(model, std::move(where)) {}

  GltfScene read() {
    for (const tinygltf::Node& node : model_.nodes) scene_.nodes.push_back(read_node(node));
    link_nodes();
    for (std::size_t i = 0; i < model_.meshes.size(); ++i) scene_.meshes.push_back(read_mesh(static_cast<int>(i)));
    for (const tinygltf::Skin& skin : model_.skins) scene_.skins.push_back(read_skin(skin));
    for (const tinygltf::Animation& animation : model_.animations) try {
        scene_.animations.push_back(read_animation(animation));
      } catch (const AnimationError& error) {
        note(fmt::format("animation \"{}\" is left out: {}", animation.name, error.what()));
      }
    read_materials();
    for (const auto& [note, count] : notes_)
      scene_.notes.push_back(count > 1 ? fmt::format("{} ({} times)", note, count) : note);
    return std::move(scene_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const { throw IoError(where_ + ": " + what); }
  void note(const std::string& text) { ++notes_[text]; }
  void check_index(int index, std::size_t size, const std::string& what) const {
    if (index < -1 || index >= static_cast<int>(size)) fail(fmt::format("{}: there is no number {}", what, index));
  }
  std::vector<Vec3> vectors(int accessor) const {
    const std::vector<double> values = accessors_.read(accessor, 3);
    std::vector<Vec3> result(values.size() / 3);
    for (std::size_t i = 0; i < result.size(); ++i)
      result[i] = Vec3(values[3 * i], values[3 * i + 1], values[3 * i + 2]);
    return result;
  }

  GltfNode read_node(const tinygltf::Node& from) {
    GltfNode node;
    node.name = from.name;
    node.mesh = from.mesh;
    node.skin = from.skin;
    check_index(from.mesh, model_.meshes.size(), "mesh of node \"" + from.name + '"');
    check_index(from.skin, model_.skins.size(), "skin of node \"" + from.name + '"');
    if (from.matrix.size() == 16) node.matrix = Eigen::Matrix4d(from.matrix.data());
    if (from.translation.size() == 3) node.translation = Vec3(from.translation.data());
    if (from.scale.size() == 3) node.scale = Vec3(from.scale.data());
    if (from.rotation.size() == 4) {
      node.rotation = Eigen::Quaterniond(from.rotation.data());
      if (!(node.rotation.norm() > 0)) fail("the rotation of node \"" + from.name + "\" is zero");
      node.rotation.normalize();
    }
    const bool is_finite =
        node.matrix ? node.matrix->allFinite()
                    : node.translation.allFinite() && node.scale.allFinite() && node.rotation.coeffs().allFinite();
    if (!is_finite) fail("the transform of node \"" + from.name + "\" is not finite");
    return node;
  }

  void link_nodes() {
    const int count = static_cast<int>(scene_.nodes.size());
    for (int i = 0; i < count; ++i)
      for (const int child : model_.nodes[i].children) {
        if (child < 0 || child >= count) fail(fmt::format("node {} has a child {} that is not there", i, child));
        if (scene_.nodes[child].parent >= 0) fail(fmt::format("node {} has two parents", child));
        scene_.nodes[child].parent = i;
      }
    for (int i = 0; i < count; ++i) {
      int steps = 0;
      for (int above = i; above >= 0; above = scene_.nodes[above].parent)
        if (++steps > count) fail(fmt::format("node {} is its own ancestor", i));
    }
    // What is in no scene, or in another one, is not shown.
    if (model_.scenes.empty()) return;
    std::set<int> top;
    const int shown = model_.defaultScene >= 0 ? model_.defaultScene : 0;
    check_index(shown, model_.scenes.size(), "scene");
    top.insert(model_.scenes[shown].nodes.begin(), model_.scenes[shown].nodes.end());
    for (int i = 0; i < count; ++i) {
      bool is_shown = false;
      for (int above = i; above >= 0 && !is_shown; above = scene_.nodes[above].parent) is_shown = top.count(above) > 0;
      if (!is_shown) scene_.nodes[i].mesh = -1;
    }
  }

  GltfMesh read_mesh(int index) {
    const tinygltf::Mesh& from = model_.meshes[index];
    std::vector<double> weights = from.weights;
    for (const tinygltf::Node& node : model_.nodes)
      if (node.mesh == index && !node.weights.empty()) {
        weights = node.weights;
        break;
      }
    GltfMesh mesh{from.name, {}};
    for (const tinygltf::Primitive& primitive : from.primitives) {
      if (primitive.mode >= 0 && primitive.mode < TINYGLTF_MODE_TRIANGLES) {
        note("points and lines of mesh \"" + from.name + "\" are left out");
        continue;
      }
      if (primitive.attributes.count("POSITION") == 0) continue;  // allowed, and nothing to see
      mesh.primitives.push_back(read_primitive(primitive, weights, from.name));
    }
    return mesh;
  }

  GltfPrimitive read_primitive(const tinygltf::Primitive& from, const std::vector<double>& morph,
                               const std::string& mesh) {
    GltfPrimitive to;
    to.positions = vectors(from.attributes.at("POSITION"));
    const std::size_t count = to.positions.size();
    const auto check_count = [&](std::size_t other, const std::string& what) {
      if (other != count) fail(fmt::format("mesh \"{}\": {} positions, but {} values of {}", mesh, count, other, what));
    };
    if (const auto found = from.attributes.find("NORMAL"); found != from.attributes.end()) {
      to.normals = vectors(found->second);
      check_count(to.normals.size(), "NORMAL");
    }
    apply_targets(from, morph, mesh, to);
    for (const Vec3& p : to.positions)
      if (!p.allFinite()) fail("mesh \"" + mesh + "\": a position is not finite");
    read_texture_coordinates(from, to);
    check_count(to.texture_coordinates.empty() ? count : to.texture_coordinates.size(), "TEXCOORD");
    if (const auto found = from.attributes.find("COLOR_0"); found != from.attributes.end()) {
      const int components = accessors_.components(found->second);
      const std::vector<double> values = accessors_.read(found->second, 0);
      if (components != 3 && components != 4) fail("mesh \"" + mesh + "\": COLOR_0 has neither 3 nor 4 numbers");
      check_count(values.size() / components, "COLOR_0");
      to.colours.assign(count, Eigen::Vector4f::Ones());
      for (std::size_t i = 0; i < values.size(); ++i)
        to.colours[i / components][static_cast<int>(i % components)] = static_cast<float>(values[i]);
    }
    read_influences(from, to, mesh);
    read_triangles(from, to, mesh);
    to.material = from.material;
    check_index(from.material, model_.materials.size(), "material of mesh \"" + mesh + '"');
    return to;
  }

  /// Moves positions and normals by morph targets.
  /// \param morph  weights of the targets
  void apply_targets(const tinygltf::Primitive& from, const std::vector<double>& morph, const std::string& mesh,
                     GltfPrimitive& to) {
    const auto add = [&](int accessor, double weight, std::vector<Vec3>& values) {
      const std::vector<Vec3> changes = vectors(accessor);
      if (changes.size() != values.size())
        fail(fmt::format("mesh \"{}\": {} positions, but {} values of a morph target", mesh, values.size(),
                         changes.size()));
      for (std::size_t v = 0; v < values.size(); ++v) values[v] += weight * changes[v];
    };
    for (std::size_t t = 0; t < from.targets.size() && t < morph.size(); ++t) {
      const auto moves = from.targets[t].find("POSITION"), turns = from.targets[t].find("NORMAL");
      if (morph[t] == 0 || moves == from.targets[t].end()) continue;
      add(moves->second, morph[t], to.positions);
      if (turns == from.targets[t].end())
        to.normals.clear();  // those of the file are not those of this shape
      else if (!to.normals.empty())
        add(turns->second, morph[t], to.normals);
    }
  }

  void read_texture_coordinates(const tinygltf::Primitive& from, GltfPrimitive& to) {
    TextureTransform transform;
    if (from.material >= 0 && from.material < static_cast<int>(model_.materials.size()))
      transform = texture_transform(model_.materials[from.material].pbrMetallicRoughness.baseColorTexture);
    const auto found = from.attributes.find(fmt::format("TEXCOORD_{}", transform.set));
    if (found == from.attributes.end()) return;
    const std::size_t components = accessors_.components(found->second);  // two, or three as assimp writes them
    if (components < 2) fail("texture coordinates have one number per vertex; two are needed");
    const std::vector<double> values = accessors_.read(found->second, 0);
    for (std::size_t i = 0; i + 1 < values.size(); i += components)
      to.texture_coordinates.push_back((transform.map * Eigen::Vector2d(values[i], values[i + 1])).cast<float>());
  }

  void read_influences(const tinygltf::Primitive& from, GltfPrimitive& to, const std::string& mesh) {
    const std::size_t count = to.positions.size();
    std::vector<std::vector<double>> joints, weights;
    for (int set = 0;; ++set) {
      const auto joint = from.attributes.find(fmt::format("JOINTS_{}", set)),
                 weight = from.attributes.find(fmt::format("WEIGHTS_{}", set));
      if (joint == from.attributes.end() || weight == from.attributes.end()) break;
      joints.push_back(accessors_.read(joint->second, 4));
      weights.push_back(accessors_.read(weight->second, 4));
      if (joints.back().size() != 4 * count || weights.back().size() != 4 * count)
        fail("mesh \"" + mesh + "\": joints or weights do not match the positions");
    }
    to.influences = 4 * static_cast<int>(joints.size());
    for (std::size_t v = 0; v < count; ++v)
      for (std::size_t set = 0; set < joints.size(); ++set)
        for (int i = 0; i < 4; ++i) {
          const double weight = weights[set][4 * v + i];
          if (!std::isfinite(weight)) fail("mesh \"" + mesh + "\": a weight is not finite");
          const double joint = joints[set][4 * v + i];
          if (!(joint >= 0 && joint <= 65535)) fail(fmt::format("mesh \"{}\": there is no joint {}", mesh, joint));
          to.joints.push_back(static_cast<int>(joint));
          to.weights.push_back(static_cast<float>(std::max(weight, 0.0)));
        }
  }

  void read_triangles(const tinygltf::Primitive& from, GltfPrimitive& to, const std::string& mesh) {
    const std::size_t count = to.positions.size();
    std::vector<int> indices;
    if (from.indices >= 0) {
      for (const double index : accessors_.read(from.indices, 1)) {
        if (!(index >= 0 && index < static_cast<double>(count)))
          fail(fmt::format("mesh \"{}\": index {} but {} positions", mesh, index, count));
        indices.push_back(static_cast<int>(index));
      }
    } else {
      for (std::size_t i = 0; i < count; ++i) indices.push_back(static_cast<int>(i));
    }
    if (from.mode == TINYGLTF_MODE_TRIANGLE_STRIP || from.mode == TINYGLTF_MODE_TRIANGLE_FAN) {
      for (std::size_t i = 0; i + 2 < indices.size(); ++i) {
        if (from.mode == TINYGLTF_MODE_TRIANGLE_FAN)
          to.triangles.push_back({indices[0], indices[i + 1], indices[i + 2]});
        else
          to.triangles.push_back({indices[i + i % 2], indices[i + 1 - i % 2], indices[i + 2]});
      }
      return;
    }
    for (std::size_t i = 0; i + 2 < indices.size(); i += 3)
      to.triangles.push_back({indices[i], indices[i + 1], indices[i + 2]});
  }

  GltfSkin read_skin(const tinygltf::Skin& from) const {
    GltfSkin skin{from.name, from.joints, {}};
    for (const int joint : skin.joints)
      if (joint < 0 || joint >= static_cast<int>(model_.nodes.size()))
        fail(fmt::format("skin \"{}\": there is no node {}", from.name, joint));
    if (from.inverseBindMatrices < 0) return skin;
    const std::vector<double> values = accessors_.read(from.inverseBindMatrices, 16);
    if (values.size() < 16 * skin.joints.size())
      fail(fmt::format("skin \"{}\": fewer inverse bind matrices than joints", from.name));
    for (std::size_t i = 0; i < skin.joints.size(); ++i) {
      skin.inverse_binds.emplace_back(Eigen::Matrix4d(values.data() + 16 * i));
      const Eigen::Matrix4d& matrix = skin.inverse_binds.back();
      if (!matrix.allFinite() || !(std::abs(matrix.topLeftCorner<3, 3>().determinant()) > 0))
        fail(fmt::format("skin \"{}\": the inverse bind matrix of joint {} cannot be inverted", from.name, i));
    }
    return skin;
  }

  GltfAnimation read_animation(const tinygltf::Animation& from) {
    GltfAnimation animation{from.name, {}};
    for (const tinygltf::AnimationChannel& channel : from.channels) {
      if (channel.target_node < 0) continue;
      check_index(channel.target_node, model_.nodes.size(), "target of animation \"" + from.name + '"');
      if (channel.target_path == "weights") {
        note("animated morph targets of \"" + from.name + "\" are left out");
        continue;
      }
      if (channel.target_path != "translation" && channel.target_path != "rotation" && channel.target_path != "scale")
        continue;
      if (channel.sampler < 0 || channel.sampler >= static_cast<int>(from.samplers.size()))
        fail("animation \"" + from.name + "\": a channel without sampler");
      animation.tracks.push_back(read_track(channel, from.samplers[channel.sampler]));
    }
    return animation;
  }

  GltfTrack read_track(const tinygltf::AnimationChannel& channel, const tinygltf::AnimationSampler& sampler) const {
    GltfTrack track;
    track.node = channel.target_node;
    track.path = channel.target_path == "rotation"      ? GltfPath::kRotation
                 : channel.target_path == "translation" ? GltfPath::kTranslation
                                                        : GltfPath::kScale;
    track.interpolation = sampler.interpolation == "STEP"          ? GltfInterpolation::kStep
                          : sampler.interpolation == "CUBICSPLINE" ? GltfInterpolation::kCubic
                                                                   : GltfInterpolation::kLinear;
    track.times = accessors_.read(sampler.input, 1);
    const int components = track.path == GltfPath::kRotation ? 4 : 3;
    const std::vector<double> values = accessors_.read(sampler.output, components);
    for (std::size_t i = 0; i + components <= values.size(); i += components) {
      track.values.emplace_back(Eigen::Vector4d::Zero());
      std::copy_n(values.begin() + static_cast<std::ptrdiff_t>(i), components, track.values.back().begin());
    }
    const std::size_t per_time = track.interpolation == GltfInterpolation::kCubic ? 3 : 1;
    if (track.times.empty() || track.values.size() != per_time * track.times.size())
      throw AnimationError(fmt::format("{} times, but {} values", track.times.size(), track.values.size()));
    for (std::size_t i = 0; i < track.times.size(); ++i)
      if (!std::isfinite(track.times[i]) || (i > 0 && !(track.times[i] >= track.times[i - 1])))
        throw AnimationError("its times do not grow");
    for (const Eigen::Vector4d& value : track.values)
      if (!value.allFinite()) throw AnimationError("a value is not finite");
    return track;
  }

  ColourImage read_image(const tinygltf::Image& from) {
    ColourImage image{from.width, from.height, {}};
    const bool is_usable = from.width > 0 && from.height > 0 && from.component == 4 &&
                           (from.bits == 8 || from.bits == 16) &&
                           from.image.size() == static_cast<std::size_t>(from.width) * from.height * from.bits / 2;
    if (!is_usable) {
      const std::string& name = from.uri.empty() ? from.name : from.uri;
      note(fmt::format("{} cannot be read, so its colours are left out",
                       name.empty() ? "a picture" : "picture \"" + name + '"'));
      return {};
    }
    if (from.bits == 8) image.rgba = from.image;
    if (from.bits == 16)
      for (std::size_t i = 1; i < from.image.size(); i += 2) image.rgba.push_back(from.image[i]);
    return image;
  }

  void read_materials() {
    for (const tinygltf::Image& from : model_.images) scene_.images.push_back(read_image(from));
    for (const tinygltf::Material& from : model_.materials) {
      GltfMaterial material{from.name, Eigen::Vector4f::Ones(), -1};
      const std::vector<double>& factor = from.pbrMetallicRoughness.baseColorFactor;
      for (std::size_t i = 0; i < 4 && i < factor.size(); ++i)
        material.base_colour[static_cast<int>(i)] = static_cast<float>(factor[i]);
      const int texture = from.pbrMetallicRoughness.baseColorTexture.index;
      check_index(texture, model_.textures.size(), "texture of material \"" + from.name + '"');
      if (texture >= 0) material.image = picture_of(model_.textures[texture]);
      check_index(material.image, model_.images.size(), "picture of material \"" + from.name + '"');
      if (material.image >= 0 && scene_.images[material.image].rgba.empty()) material.image = -1;
      scene_.materials.push_back(material);
    }
  }

  const tinygltf::Model& model_;
  std::string where_;
  GltfAccessors accessors_;
  GltfScene scene_;
  std::map<std::string, int> notes_;
};

}  // namespace

bool is_gltf_file(const std::filesystem::path& path) {
  std::string ending = path.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return ending == ".glb" || ending == ".gltf" || ending == ".vrm";
}

GltfScene read_gltf(const std::filesystem::path& path) {
  const tinygltf::Model model = load(path);
  return GltfReader(model, path.string()).read();
}

}  // namespace skeletex
