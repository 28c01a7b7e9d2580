// SPDX-License-Identifier: MIT
#include "skeletex/io/gltf/decompress.h"

#include <draco/compression/decode.h>
#include <fmt/format.h>
#include <meshoptimizer.h>

#include <cmath>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "skeletex/io/gltf/tinygltf.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

constexpr char kMeshopt[] = "EXT_meshopt_compression", kDraco[] = "KHR_draco_mesh_compression";
constexpr std::size_t kMostBytes = std::size_t{1} << 31;
/// No vertex codec of meshopt packs tighter: two bits for each byte of 16 elements.
constexpr std::size_t kMostBytesPerByte = 64;

struct DamagedData {
  std::string what;
};

/// A whole number of an extension's object.
std::size_t whole_number(const tinygltf::Value& object, const std::string& key, std::size_t otherwise = kMostBytes) {
  if (!object.IsObject() || !object.Has(key)) {
    if (otherwise == kMostBytes) throw DamagedData{"\"" + key + "\" is missing"};
    return otherwise;
  }
  const tinygltf::Value& value = object.Get(key);
  const double number = value.IsNumber() ? value.GetNumberAsDouble() : -1;
  if (!(number >= 0 && number < static_cast<double>(kMostBytes)) || number != std::floor(number))
    throw DamagedData{"\"" + key + "\" is not a whole number below 2^31"};
  return static_cast<std::size_t>(number);
}

std::string text(const tinygltf::Value& object, const std::string& key) {
  return object.IsObject() && object.Has(key) && object.Get(key).IsString() ? object.Get(key).Get<std::string>()
                                                                            : std::string();
}

struct Bytes {
  const unsigned char* data;
  std::size_t size;
};

Bytes bytes_of(const tinygltf::Model& model, std::size_t buffer, std::size_t offset, std::size_t size) {
  if (buffer >= model.buffers.size()) throw DamagedData{"there is no such buffer"};
  const std::vector<unsigned char>& data = model.buffers[buffer].data;
  if (offset > data.size() || size > data.size() - offset) throw DamagedData{"it passes the end of its buffer"};
  return {data.data() + offset, size};
}

int add_buffer(tinygltf::Model& model, std::vector<unsigned char> data) {
  model.buffers.emplace_back();
  model.buffers.back().data = std::move(data);
  return static_cast<int>(model.buffers.size()) - 1;
}

void undo_filter(const std::string& filter, std::vector<unsigned char>& data, std::size_t count, std::size_t stride) {
  if (filter.empty() || filter == "NONE") return;
  if (filter == "OCTAHEDRAL" && (stride == 4 || stride == 8))
    meshopt_decodeFilterOct(data.data(), count, stride);
  else if (filter == "QUATERNION" && stride == 8)
    meshopt_decodeFilterQuat(data.data(), count, stride);
  else if (filter == "EXPONENTIAL" && stride % 4 == 0)
    meshopt_decodeFilterExp(data.data(), count, stride);
  else
    throw DamagedData{fmt::format("no filter \"{}\" with elements of {} bytes", filter, stride)};
}

/// The data of a buffer view that meshopt has packed.
std::vector<unsigned char> unpacked_view(const tinygltf::Model& model, const tinygltf::Value& packed) {
  const Bytes from = bytes_of(model, whole_number(packed, "buffer"), whole_number(packed, "byteOffset", 0),
                              whole_number(packed, "byteLength"));
  const std::size_t count = whole_number(packed, "count"), stride = whole_number(packed, "byteStride");
  const std::string mode = text(packed, "mode");
  const bool is_attribute = mode == "ATTRIBUTES", is_index = mode == "TRIANGLES" || mode == "INDICES";
  if (!is_attribute && !is_index) throw DamagedData{"unknown mode \"" + mode + '"'};
  if (is_attribute ? stride == 0 || stride > 256 || stride % 4 != 0 : stride != 2 && stride != 4)
    throw DamagedData{fmt::format("elements of {} bytes", stride)};
  if (mode == "TRIANGLES" && count % 3 != 0) throw DamagedData{"its indices are not those of triangles"};
  if (count * stride > kMostBytes || count * stride > kMostBytesPerByte * (from.size + stride))
    throw DamagedData{"it has more elements than its bytes can hold"};
  std::vector<unsigned char> data(count * stride);
  const int error = is_attribute ? meshopt_decodeVertexBuffer(data.data(), count, stride, from.data, from.size)
                    : mode == "TRIANGLES"
                        ? meshopt_decodeIndexBuffer(data.data(), count, stride, from.data, from.size)
                        : meshopt_decodeIndexSequence(data.data(), count, stride, from.data, from.size);
  if (error != 0) throw DamagedData{fmt::format("meshopt reports the error {}", error)};
  if (is_attribute) undo_filter(text(packed, "filter"), data, count, stride);
  return data;
}

void unpack_views(tinygltf::Model& model, const std::string& where) {
  for (std::size_t i = 0; i < model.bufferViews.size(); ++i) {
    tinygltf::BufferView& view = model.bufferViews[i];
    const auto packed = view.extensions.find(kMeshopt);
    if (packed == view.extensions.end()) continue;
    try {
      std::vector<unsigned char> data = unpacked_view(model, packed->second);
      view.byteOffset = 0;
      view.byteLength = data.size();
      view.buffer = add_buffer(model, std::move(data));
    } catch (const DamagedData& damaged) {
      throw IoError(fmt::format("{}: buffer view {}, compressed by {}: {}", where, i, kMeshopt, damaged.what));
    }
  }
}

int component_type(draco::DataType type) {
  switch (type) {
    case draco::DT_INT8: return TINYGLTF_COMPONENT_TYPE_BYTE;
    case draco::DT_UINT8: return TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE;
    case draco::DT_INT16: return TINYGLTF_COMPONENT_TYPE_SHORT;
    case draco::DT_UINT16: return TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT;
    case draco::DT_UINT32: return TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
    case draco::DT_FLOAT32: return TINYGLTF_COMPONENT_TYPE_FLOAT;
    default: throw DamagedData{"an attribute has numbers that glTF does not know"};
  }
}

/// Adds an accessor to a buffer of its own.
int add_accessor(tinygltf::Model& model, std::vector<unsigned char> data, tinygltf::Accessor accessor) {
  tinygltf::BufferView view;
  view.byteLength = data.size();
  view.buffer = add_buffer(model, std::move(data));
  model.bufferViews.push_back(view);
  accessor.bufferView = static_cast<int>(model.bufferViews.size()) - 1;
  accessor.byteOffset = 0;
  accessor.sparse.isSparse = false;
  model.accessors.push_back(std::move(accessor));
  return static_cast<int>(model.accessors.size()) - 1;
}

std::unique_ptr<draco::Mesh> draco_mesh(const tinygltf::Model& model, const tinygltf::Value& packed) {
  const std::size_t view_index = whole_number(packed, "bufferView");
  if (view_index >= model.bufferViews.size()) throw DamagedData{"there is no such buffer view"};
  const tinygltf::BufferView& view = model.bufferViews[view_index];
  const Bytes bytes = bytes_of(model, static_cast<std::size_t>(view.buffer), view.byteOffset, view.byteLength);
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(bytes.data), bytes.size);
  draco::Decoder decoder;
  auto decoded = decoder.DecodeMeshFromBuffer(&buffer);
  if (!decoded.ok()) throw DamagedData{decoded.status().error_msg_string()};
  return std::move(decoded).value();
}

/// The type of an accessor's numbers, and their number, are those that Draco has.
int unpack_attribute(tinygltf::Model& model, const draco::PointAttribute& attribute, std::size_t points,
                     int accessor_index) {
  if (accessor_index < 0 || accessor_index >= static_cast<int>(model.accessors.size()))
    throw DamagedData{"there is no such accessor"};
  tinygltf::Accessor accessor = model.accessors[accessor_index];
  if (attribute.num_components() != tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(accessor.type)))
    throw DamagedData{"an attribute has another number of components than its accessor"};
  accessor.componentType = component_type(attribute.data_type());
  accessor.count = points;
  const auto size = static_cast<std::size_t>(attribute.byte_stride());
  std::vector<unsigned char> data(points * size);
  for (std::size_t i = 0; i < points; ++i)
    attribute.GetMappedValue(draco::PointIndex(static_cast<std::uint32_t>(i)), data.data() + i * size);
  return add_accessor(model, std::move(data), std::move(accessor));
}

void unpack_primitive(tinygltf::Model& model, tinygltf::Primitive& primitive, const tinygltf::Value& packed) {
  const std::unique_ptr<draco::Mesh> mesh = draco_mesh(model, packed);
  if (!packed.Has("attributes") || !packed.Get("attributes").IsObject()) throw DamagedData{"it names no attributes"};
  for (const std::string& name : packed.Get("attributes").Keys()) {
    const auto found = primitive.attributes.find(name);
    if (found == primitive.attributes.end()) continue;
    const draco::PointAttribute* attribute =
        mesh->GetAttributeByUniqueId(static_cast<std::uint32_t>(whole_number(packed.Get("attributes"), name)));
    if (attribute == nullptr) throw DamagedData{"it has no attribute " + name};
    found->second = unpack_attribute(model, *attribute, mesh->num_points(), found->second);
  }
  std::vector<unsigned char> indices(std::size_t{12} * mesh->num_faces());
  for (std::uint32_t f = 0; f < mesh->num_faces(); ++f)
    for (int corner = 0; corner < 3; ++corner) {
      const std::uint32_t point = mesh->face(draco::FaceIndex(f))[corner].value();
      std::memcpy(indices.data() + std::size_t{12} * f + 4 * corner, &point, sizeof point);
    }
  tinygltf::Accessor accessor;
  accessor.type = TINYGLTF_TYPE_SCALAR;
  accessor.componentType = TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
  accessor.count = std::size_t{3} * mesh->num_faces();
  primitive.indices = add_accessor(model, std::move(indices), std::move(accessor));
  primitive.mode = TINYGLTF_MODE_TRIANGLES;
}

void unpack_meshes(tinygltf::Model& model, const std::string& where) {
  for (tinygltf::Mesh& mesh : model.meshes)
    for (tinygltf::Primitive& primitive : mesh.primitives) {
      const auto packed = primitive.extensions.find(kDraco);
      if (packed == primitive.extensions.end()) continue;
      try {
        unpack_primitive(model, primitive, packed->second);
      } catch (const DamagedData& damaged) {
        throw IoError(fmt::format("{}: mesh \"{}\", compressed by {}: {}", where, mesh.name, kDraco, damaged.what));
      }
    }
}

bool has_extension(const nlohmann::json& object, const char* name) {
  return object.is_object() && object.contains("extensions") && object["extensions"].is_object() &&
         object["extensions"].contains(name);
}

/// The elements of an array of that name, or nothing.
nlohmann::json::array_t elements(const nlohmann::json& object, const char* name) {
  return object.is_object() && object.contains(name) && object[name].is_array()
             ? object[name].get<nlohmann::json::array_t>()
             : nlohmann::json::array_t();
}

/// Buffers that only hold place for packed ones get three bytes of their own.
void fill_buffers(nlohmann::json& scene) {
  for (std::size_t i = 0; i < elements(scene, "buffers").size(); ++i) {
    nlohmann::json& buffer = scene["buffers"][i];
    if (!has_extension(buffer, kMeshopt) || buffer.contains("uri")) continue;
    buffer["uri"] = "data:application/octet-stream;base64,AAAA";
    buffer["byteLength"] = 3;
  }
}

/// Indices that Draco packs get any buffer view.
void fill_indices(nlohmann::json& scene) {
  const std::size_t accessors = elements(scene, "accessors").size();
  for (const nlohmann::json& mesh : elements(scene, "meshes"))
    for (const nlohmann::json& primitive : elements(mesh, "primitives")) {
      if (!has_extension(primitive, kDraco) || !primitive.contains("indices") ||
          !primitive["indices"].is_number_unsigned())
        continue;
      const auto index = primitive["indices"].get<std::size_t>();
      if (index >= accessors) continue;
      nlohmann::json& accessor = scene["accessors"][index];
      if (accessor.is_object() && !accessor.contains("bufferView")) accessor["bufferView"] = 0;
    }
}

}  // namespace

std::string completed_for_tinygltf(std::string file) {
  if (file.find(kMeshopt) == std::string::npos && file.find(kDraco) == std::string::npos) return file;
  // A binary file: magic, version, length, and chunks of a length, a type and bytes; the first one is the text.
  constexpr std::size_t kHeader = 12, kChunkHeader = 8;
  const bool is_binary = file.starts_with("glTF") && file.size() > kHeader + kChunkHeader;
  std::uint32_t length = 0;
  if (is_binary) std::memcpy(&length, file.data() + kHeader, sizeof length);
  const std::size_t begin = is_binary ? kHeader + kChunkHeader : 0;
  if (length > file.size() - begin) return file;
  const std::size_t end = is_binary ? begin + length : file.size();
  nlohmann::json scene = nlohmann::json::parse(file.begin() + static_cast<std::ptrdiff_t>(begin),
                                               file.begin() + static_cast<std::ptrdiff_t>(end), nullptr, false);
  if (scene.is_discarded()) return file;
  fill_buffers(scene);
  fill_indices(scene);
  std::string changed = scene.dump();
  if (!is_binary) return changed;
  changed.resize((changed.size() + 3) / 4 * 4, ' ');
  file.replace(begin, length, changed);
  const auto whole = static_cast<std::uint32_t>(file.size()), part = static_cast<std::uint32_t>(changed.size());
  std::memcpy(file.data() + 8, &whole, sizeof whole);
  std::memcpy(file.data() + kHeader, &part, sizeof part);
  return file;
}

void decompress_gltf(tinygltf::Model& model, const std::string& where) {
  unpack_views(model, where);
  unpack_meshes(model, where);
}

}  // namespace skeletex
