// SPDX-License-Identifier: MIT
// Files packed by KHR_draco_mesh_compression and EXT_meshopt_compression hold the same scene as the plain ones.
#include <draco/compression/expert_encode.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <meshoptimizer.h>
#include <webp/encode.h>

#include <cstring>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <random>

#include "skeletex/io/gltf/read_gltf.h"
#include "skeletex/io/gltf/write_gltf.h"
#include "skeletex/io/read_file.h"
#include "skeletex/model/error.h"
#include "support/scratch.h"

namespace skeletex {
namespace {

using Json = nlohmann::json;

/// A binary file in its two chunks.
struct Parts {
  Json scene;
  std::string bytes;
};

Parts read_parts(const std::filesystem::path& path) {
  const std::string file = read_file(path);
  std::uint32_t text = 0, bytes = 0;
  std::memcpy(&text, file.data() + 12, 4);
  std::memcpy(&bytes, file.data() + 20 + text, 4);
  return {Json::parse(file.substr(20, text)), file.substr(28 + text, bytes)};
}

void write_parts(const std::filesystem::path& path, const Parts& parts) {
  std::string text = parts.scene.dump(), bytes = parts.bytes;
  text.resize((text.size() + 3) / 4 * 4, ' ');
  bytes.resize((bytes.size() + 3) / 4 * 4, '\0');
  std::ofstream file(path, std::ios::binary);
  const auto number = [&](std::size_t value) {
    const auto written = static_cast<std::uint32_t>(value);
    file.write(reinterpret_cast<const char*>(&written), 4);
  };
  file << "glTF";
  number(2), number(28 + text.size() + bytes.size());
  number(text.size());
  file << "JSON" << text;
  number(bytes.size());
  file.write("BIN\0", 4);
  file << bytes;
}

/// A skinned sheet of uneven heights with a picture.
GltfScene sheet() {
  constexpr int kSide = 20;
  GltfPrimitive primitive;
  std::mt19937 random(1);
  std::uniform_real_distribution<float> unit(0, 1);
  for (int y = 0; y < kSide; ++y)
    for (int x = 0; x < kSide; ++x) {
      primitive.positions.push_back(Vec3(x, y, unit(random)));
      primitive.normals.push_back(
          Eigen::Vector3f(unit(random), unit(random), 1 + unit(random)).normalized().cast<double>());
      primitive.texture_coordinates.emplace_back(unit(random), unit(random));
      const float weight = unit(random);
      primitive.joints.insert(primitive.joints.end(), {0, 1, 0, 0});
      primitive.weights.insert(primitive.weights.end(), {weight, 1 - weight, 0, 0});
    }
  for (int y = 0; y + 1 < kSide; ++y)
    for (int x = 0; x + 1 < kSide; ++x) {
      const int v = y * kSide + x;
      primitive.triangles.push_back({v, v + 1, v + kSide});
      primitive.triangles.push_back({v + 1, v + kSide + 1, v + kSide});
    }
  primitive.influences = 4;
  primitive.material = 0;
  GltfScene scene;
  scene.nodes.resize(3);
  scene.nodes[0].mesh = scene.nodes[0].skin = 0;
  scene.nodes[2].parent = 1;
  scene.nodes[2].translation = Vec3(0, 3, 0);
  scene.skins.push_back({"skin", {1, 2}, {Eigen::Matrix4d::Identity(), Eigen::Matrix4d::Identity()}});
  scene.meshes.push_back({"sheet", {primitive}});
  scene.materials.push_back({"picture", Eigen::Vector4f::Ones(), 0});
  scene.images.push_back({2, 2, std::vector<std::uint8_t>(16, 200)});
  return scene;
}

std::size_t element_size(const Json& accessor) {
  static const std::map<std::string, std::size_t> components{
      {"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}, {"MAT4", 16}};
  static const std::map<int, std::size_t> sizes{{5121, 1}, {5123, 2}, {5125, 4}, {5126, 4}};
  return components.at(accessor["type"]) * sizes.at(accessor["componentType"]);
}

/// Packs the data of every accessor; their plain bytes are gone.
Parts packed_by_meshopt(const Parts& plain) {
  Parts packed{plain.scene, {}};
  for (std::size_t i = 0; i < packed.scene["bufferViews"].size(); ++i) {
    Json& view = packed.scene["bufferViews"][i];
    const std::string data = plain.bytes.substr(view.value("byteOffset", 0), view["byteLength"]);
    const std::size_t begin = (packed.bytes.size() + 3) / 4 * 4;
    packed.bytes.resize(begin);
    std::vector<unsigned char> bytes(data.size() + 4096);
    Json extension{{"buffer", 0}, {"byteOffset", begin}};
    for (const Json& accessor : plain.scene["accessors"]) {
      if (accessor.value("bufferView", -1) != static_cast<int>(i)) continue;
      const std::size_t count = accessor["count"], size = element_size(accessor);
      if (accessor["type"] == "SCALAR" && size == 4) {
        std::vector<unsigned int> indices(count);
        std::memcpy(indices.data(), data.data(), 4 * count);
        bytes.resize(meshopt_encodeIndexSequenceBound(count, 1000) + 16);
        bytes.resize(meshopt_encodeIndexSequence(bytes.data(), bytes.size(), indices.data(), count));
        extension["mode"] = "INDICES";
      } else {
        bytes.resize(meshopt_encodeVertexBufferBound(count, size));
        bytes.resize(meshopt_encodeVertexBuffer(bytes.data(), bytes.size(), data.data(), count, size));
        extension["mode"] = "ATTRIBUTES";
      }
      extension["count"] = count;
      extension["byteStride"] = size;
    }
    if (!extension.contains("mode")) {  // a picture
      packed.bytes += data;
      view["byteOffset"] = begin;
      continue;
    }
    packed.bytes.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    extension["byteLength"] = bytes.size();
    view["buffer"] = 1;
    view["extensions"]["EXT_meshopt_compression"] = extension;
  }
  packed.scene["buffers"] = {
      {{"byteLength", packed.bytes.size()}},
      {{"byteLength", plain.bytes.size()}, {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}}};
  packed.scene["extensionsRequired"] = {"EXT_meshopt_compression"};
  return packed;
}

/// Packs the first primitive without quantization, in its own order.
Parts packed_by_draco(const Parts& plain) {
  Parts packed = plain;
  Json& primitive = packed.scene["meshes"][0]["primitives"][0];
  const auto bytes_of = [&](int accessor) {
    const Json& view = plain.scene["bufferViews"][plain.scene["accessors"][accessor]["bufferView"].get<int>()];
    return plain.bytes.data() + view.value("byteOffset", 0);
  };
  const std::size_t count = plain.scene["accessors"][primitive["attributes"]["POSITION"].get<int>()]["count"];
  draco::Mesh mesh;
  mesh.set_num_points(static_cast<std::uint32_t>(count));
  Json ids;
  for (const auto& [name, index] : primitive["attributes"].items()) {
    Json& accessor = packed.scene["accessors"][index.get<int>()];
    const std::size_t size = element_size(accessor);
    draco::GeometryAttribute attribute;
    attribute.Init(name == "POSITION" ? draco::GeometryAttribute::POSITION : draco::GeometryAttribute::GENERIC, nullptr,
                   static_cast<std::int8_t>(std::string(accessor["type"]).back() - '0'),
                   accessor["componentType"] == 5126   ? draco::DT_FLOAT32
                   : accessor["componentType"] == 5123 ? draco::DT_UINT16
                                                       : draco::DT_UINT8,
                   false, static_cast<std::int64_t>(size), 0);
    const int id = mesh.AddAttribute(attribute, true, static_cast<std::uint32_t>(count));
    for (std::size_t i = 0; i < count; ++i)
      mesh.attribute(id)->SetAttributeValue(draco::AttributeValueIndex(static_cast<std::uint32_t>(i)),
                                            bytes_of(index) + i * size);
    ids[name] = mesh.attribute(id)->unique_id();
    accessor.erase("bufferView");
  }
  Json& indices = packed.scene["accessors"][primitive["indices"].get<int>()];
  const char* numbers = bytes_of(primitive["indices"]);
  const bool is_short = indices["componentType"] == 5123;
  for (std::size_t i = 0; i < indices["count"].get<std::size_t>(); i += 3) {
    draco::Mesh::Face face;
    for (int corner = 0; corner < 3; ++corner) {
      std::uint32_t point = 0;
      std::memcpy(&point, numbers + (i + corner) * (is_short ? 2 : 4), is_short ? 2 : 4);
      face[corner] = draco::PointIndex(point);
    }
    mesh.AddFace(face);
  }
  indices.erase("bufferView");
  draco::ExpertEncoder encoder(mesh);
  encoder.SetEncodingMethod(draco::MESH_SEQUENTIAL_ENCODING);
  draco::EncoderBuffer buffer;
  EXPECT_TRUE(encoder.EncodeToBuffer(&buffer).ok());
  const std::size_t begin = (packed.bytes.size() + 3) / 4 * 4;
  packed.bytes.resize(begin);
  packed.bytes.append(buffer.data(), buffer.size());
  packed.scene["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", begin}, {"byteLength", buffer.size()}});
  primitive["extensions"]["KHR_draco_mesh_compression"] = {{"bufferView", packed.scene["bufferViews"].size() - 1},
                                                           {"attributes", ids}};
  packed.scene["buffers"][0]["byteLength"] = packed.bytes.size();
  packed.scene["extensionsRequired"] = {"KHR_draco_mesh_compression"};
  return packed;
}

void expect_same(const GltfScene& one, const GltfScene& other) {
  const GltfPrimitive &a = one.meshes.at(0).primitives.at(0), &b = other.meshes.at(0).primitives.at(0);
  EXPECT_EQ(a.positions, b.positions);
  EXPECT_EQ(a.normals, b.normals);
  EXPECT_EQ(a.texture_coordinates, b.texture_coordinates);
  EXPECT_EQ(a.joints, b.joints);
  EXPECT_EQ(a.weights, b.weights);
  EXPECT_EQ(a.triangles, b.triangles);
  EXPECT_EQ(one.skins.at(0).inverse_binds, other.skins.at(0).inverse_binds);
  EXPECT_EQ(one.images.at(0).rgba, other.images.at(0).rgba);
}

class CompressedGltf : public testing::TestWithParam<std::function<Parts(const Parts&)>> {
 protected:
  CompressedGltf() { write_gltf(folder_ / "plain.glb", sheet()); }
  ScratchFolder folder_;
};

TEST_P(CompressedGltf, HoldsTheSameScene) {
  write_parts(folder_ / "packed.glb", GetParam()(read_parts(folder_ / "plain.glb")));
  expect_same(read_gltf(folder_ / "packed.glb"), read_gltf(folder_ / "plain.glb"));
}

TEST_P(CompressedGltf, DamagedBytesAreRefusedOrRead) {
  const Parts packed = GetParam()(read_parts(folder_ / "plain.glb"));
  std::mt19937 random(1);
  for (int i = 0; i < 200; ++i) {
    Parts damaged = packed;
    // What is packed is the end of the bytes, or all of them.
    const std::size_t begin = packed.scene["bufferViews"].back().value("byteOffset", std::size_t{0});
    for (int k = 0; k < 3; ++k) {
      const std::size_t at = begin + random() % (damaged.bytes.size() - begin);
      damaged.bytes[at] = static_cast<char>(random());
    }
    write_parts(folder_ / "damaged.glb", damaged);
    try {
      read_gltf(folder_ / "damaged.glb");
    } catch (const IoError& error) {
      EXPECT_NE(std::string(error.what()).find("damaged.glb"), std::string::npos);
    }
  }
}

TEST_P(CompressedGltf, SizesThatCannotBeAreRefusedBeforeMemoryIsTaken) {
  Parts packed = GetParam()(read_parts(folder_ / "plain.glb"));
  for (Json& view : packed.scene["bufferViews"]) {
    if (view.contains("extensions"))
      view["extensions"]["EXT_meshopt_compression"]["count"] = 100'000'000;
    else
      view["byteLength"] = 2'000'000'000;
  }
  write_parts(folder_ / "large.glb", packed);
  EXPECT_THROW(read_gltf(folder_ / "large.glb"), IoError);
}

INSTANTIATE_TEST_SUITE_P(Packers, CompressedGltf, testing::Values(packed_by_draco, packed_by_meshopt),
                         [](const auto& packer) { return packer.index == 0 ? "Draco" : "Meshopt"; });

TEST(Gltf, JointsAndIndicesAreNeitherNegativeNorHuge) {
  const ScratchFolder folder;
  write_gltf(folder / "plain.glb", sheet());
  const Parts plain = read_parts(folder / "plain.glb");
  for (const char* name : {"JOINTS_0", "indices"})
    for (const float wrong : {-5.F, 1e10F}) {
      SCOPED_TRACE(fmt::format("{} {}", name, wrong));
      Parts parts = plain;
      Json& primitive = parts.scene["meshes"][0]["primitives"][0];
      const bool is_joint = primitive["attributes"].contains(name);
      Json& accessor =
          parts.scene["accessors"][(is_joint ? primitive["attributes"][name] : primitive[name]).get<int>()];
      accessor["componentType"] = 5126;  // as no valid file has them
      const std::vector<float> values(accessor["count"].get<std::size_t>() * (is_joint ? 4 : 1), wrong);
      Json& view = parts.scene["bufferViews"][accessor["bufferView"].get<int>()];
      view["byteOffset"] = parts.bytes.size();
      view["byteLength"] = 4 * values.size();
      parts.bytes.append(reinterpret_cast<const char*>(values.data()), 4 * values.size());
      parts.scene["buffers"][0]["byteLength"] = parts.bytes.size();
      write_parts(folder / "wrong.glb", parts);
      EXPECT_THROW(read_gltf(folder / "wrong.glb"), IoError);
    }
}

TEST(Gltf, PicturesAreReadAsWebP) {
  const ScratchFolder folder;
  GltfScene scene = sheet();
  std::mt19937 random(1);
  for (std::size_t i = 0; i < scene.images[0].rgba.size(); ++i)
    scene.images[0].rgba[i] = i % 4 == 3 ? 255 : static_cast<std::uint8_t>(random());
  write_gltf(folder / "plain.glb", scene);
  Parts parts = read_parts(folder / "plain.glb");
  std::uint8_t* bytes = nullptr;
  const ColourImage& picture = scene.images[0];
  const std::size_t size =
      WebPEncodeLosslessRGBA(picture.rgba.data(), picture.width, picture.height, 4 * picture.width, &bytes);
  Json& view = parts.scene["bufferViews"][parts.scene["images"][0]["bufferView"].get<int>()];
  view["byteOffset"] = parts.bytes.size();
  view["byteLength"] = size;
  parts.bytes.append(reinterpret_cast<const char*>(bytes), size);
  WebPFree(bytes);
  parts.scene["buffers"][0]["byteLength"] = parts.bytes.size();
  parts.scene["images"][0]["mimeType"] = "image/webp";
  parts.scene["textures"][0].erase("source");
  parts.scene["textures"][0]["extensions"]["EXT_texture_webp"]["source"] = 0;
  parts.scene["extensionsRequired"] = {"EXT_texture_webp"};
  write_parts(folder / "webp.glb", parts);
  const GltfScene read = read_gltf(folder / "webp.glb");
  EXPECT_EQ(read.images.at(0).rgba, picture.rgba);
  EXPECT_EQ(read.materials.at(0).image, 0);
}

TEST(Gltf, TextureCoordinatesMayHaveThreeNumbers) {  // as those that assimp writes have
  const ScratchFolder folder;
  write_gltf(folder / "plain.glb", sheet());
  Parts parts = read_parts(folder / "plain.glb");
  Json& primitive = parts.scene["meshes"][0]["primitives"][0];
  primitive["attributes"]["TEXCOORD_0"] = primitive["attributes"]["NORMAL"];
  write_parts(folder / "three.glb", parts);
  const GltfPrimitive read = read_gltf(folder / "three.glb").meshes[0].primitives[0];
  ASSERT_EQ(read.texture_coordinates.size(), read.normals.size());
  for (std::size_t i = 0; i < read.normals.size(); ++i)
    EXPECT_EQ(read.texture_coordinates[i], read.normals[i].head<2>().cast<float>()) << i;
}

TEST(Gltf, APictureThatIsMissingIsNamedAndTheRestRead) {
  const ScratchFolder folder;
  write_gltf(folder / "plain.glb", sheet());
  Parts parts = read_parts(folder / "plain.glb");
  parts.scene["images"][0] = {{"uri", "skin.png"}};
  write_parts(folder / "bare.glb", parts);
  const GltfScene read = read_gltf(folder / "bare.glb");
  EXPECT_EQ(read.meshes.size(), 1u);
  EXPECT_EQ(read.notes, std::vector<std::string>{"picture \"skin.png\" cannot be read, so its colours are left out"});
}

TEST(Gltf, ATextureTransformMovesTheCoordinates) {
  const ScratchFolder folder;
  write_gltf(folder / "plain.glb", sheet());
  Parts parts = read_parts(folder / "plain.glb");
  // The example of the extension's text: the lower left quarter of the picture, turned by 90 degrees.
  parts.scene["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"]["KHR_texture_transform"] = {
      {"offset", {0, 1}}, {"rotation", 1.57079632679}, {"scale", {0.5, 0.5}}};
  parts.scene["extensionsRequired"] = {"KHR_texture_transform"};
  write_parts(folder / "moved.glb", parts);
  const auto coordinates = [&](const char* name) {
    return read_gltf(folder / name).meshes[0].primitives[0].texture_coordinates;
  };
  const std::vector<Eigen::Vector2f> plain = coordinates("plain.glb"), moved = coordinates("moved.glb");
  ASSERT_EQ(plain.size(), moved.size());
  for (std::size_t i = 0; i < plain.size(); ++i)
    EXPECT_LT((moved[i] - Eigen::Vector2f(0.5F * plain[i].y(), 1 - 0.5F * plain[i].x())).norm(), 1e-6F);
}

}  // namespace
}  // namespace skeletex
