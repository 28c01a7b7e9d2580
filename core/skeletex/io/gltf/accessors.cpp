// SPDX-License-Identifier: MIT
#include "skeletex/io/gltf/accessors.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <limits>

#include "skeletex/io/gltf/tinygltf.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

constexpr std::size_t kMostElements = 200'000'000;

template <class T>
double number_at(const unsigned char* bytes, bool is_normalised) {
  T value;
  std::memcpy(&value, bytes, sizeof value);
  if (!is_normalised || std::numeric_limits<T>::is_iec559) return static_cast<double>(value);
  return std::max(static_cast<double>(value) / static_cast<double>(std::numeric_limits<T>::max()), -1.0);
}

double number_at(const unsigned char* bytes, int type, bool is_normalised) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE: return number_at<std::int8_t>(bytes, is_normalised);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE: return number_at<std::uint8_t>(bytes, is_normalised);
    case TINYGLTF_COMPONENT_TYPE_SHORT: return number_at<std::int16_t>(bytes, is_normalised);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT: return number_at<std::uint16_t>(bytes, is_normalised);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT: return number_at<std::uint32_t>(bytes, is_normalised);
    case TINYGLTF_COMPONENT_TYPE_FLOAT: return number_at<float>(bytes, false);
    default: return 0;
  }
}

/// Some bytes of a buffer, with the distance of their elements.
struct Block {
  const unsigned char* bytes = nullptr;
  std::size_t stride = 0;
};

/// \return what is wrong instead, in words
std::string find_block(const tinygltf::Model& model, int view_index, std::size_t offset, std::size_t count,
                       std::size_t element, bool may_be_strided, Block& block) {
  if (view_index < 0 || view_index >= static_cast<int>(model.bufferViews.size())) return "there is no such buffer view";
  const tinygltf::BufferView& view = model.bufferViews[view_index];
  if (view.buffer < 0 || view.buffer >= static_cast<int>(model.buffers.size())) return "there is no such buffer";
  const std::vector<unsigned char>& data = model.buffers[view.buffer].data;
  if (view.byteOffset > data.size() || view.byteLength > data.size() - view.byteOffset)
    return "its buffer view passes the end of the buffer";
  block.stride = may_be_strided && view.byteStride > 0 ? view.byteStride : element;
  if (offset > view.byteLength || (count > 0 && (view.byteLength - offset < element ||
                                                 (count - 1) > (view.byteLength - offset - element) / block.stride)))
    return "it passes the end of its buffer view";
  block.bytes = data.data() + view.byteOffset + offset;
  return {};
}

/// Where the numbers of an accessor go.
struct Elements {
  std::vector<double> values;
  int components = 1, type = 0;
  bool is_normalized = false;

  void read(const unsigned char* bytes, std::size_t to) {
    const int size = tinygltf::GetComponentSizeInBytes(static_cast<std::uint32_t>(type));
    for (int c = 0; c < components; ++c) values[to * components + c] = number_at(bytes + c * size, type, is_normalized);
  }
};

/// Replaces the elements that the accessor's sparse part names.
/// \return what is wrong instead, in words
std::string read_sparse(const tinygltf::Model& model, const tinygltf::Accessor& accessor, std::size_t element,
                        Elements& elements) {
  const auto& sparse = accessor.sparse;
  const int index_size = tinygltf::GetComponentSizeInBytes(static_cast<std::uint32_t>(sparse.indices.componentType));
  if (sparse.count < 0 || index_size <= 0 || index_size > 4 || sparse.indices.byteOffset < 0 ||
      sparse.values.byteOffset < 0)
    return "its sparse part is damaged";
  Block indices, replaced;
  for (const std::string& wrong :
       {find_block(model, sparse.indices.bufferView, sparse.indices.byteOffset, sparse.count, index_size, false,
                   indices),
        find_block(model, sparse.values.bufferView, sparse.values.byteOffset, sparse.count, element, false, replaced)})
    if (!wrong.empty()) return "sparse: " + wrong;
  for (int i = 0; i < sparse.count; ++i) {
    const double to = number_at(indices.bytes + i * indices.stride, sparse.indices.componentType, false);
    if (!(to >= 0 && to < static_cast<double>(accessor.count))) return "a sparse index is out of range";
    elements.read(replaced.bytes + i * replaced.stride, static_cast<std::size_t>(to));
  }
  return {};
}

}  // namespace

std::vector<double> GltfAccessors::read(int index, int wanted) const {
  const auto fail = [&](const std::string& what) {
    throw IoError(fmt::format("{}: accessor {}: {}", where_, index, what));
  };
  if (index < 0 || index >= static_cast<int>(model_.accessors.size())) fail("there is none of that number");
  const tinygltf::Accessor& accessor = model_.accessors[index];
  const int type = accessor.componentType;
  const int size = tinygltf::GetComponentSizeInBytes(static_cast<std::uint32_t>(type));
  const int own = tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(accessor.type));
  if (size <= 0 || size > 4 || type == TINYGLTF_COMPONENT_TYPE_INT || own <= 0) fail("unknown type");
  if (wanted > 0 && own != wanted) fail(fmt::format("{} numbers per element are expected, not {}", wanted, own));
  if (accessor.count > kMostElements) fail("too large");
  const std::size_t element = static_cast<std::size_t>(size) * own;
  Elements elements{std::vector<double>(accessor.count * own, 0.0), own, type, accessor.normalized};
  std::string wrong;
  if (accessor.bufferView >= 0) {
    Block block;
    wrong = find_block(model_, accessor.bufferView, accessor.byteOffset, accessor.count, element, true, block);
    for (std::size_t i = 0; i < accessor.count && wrong.empty(); ++i) elements.read(block.bytes + i * block.stride, i);
  }
  if (wrong.empty() && accessor.sparse.isSparse) wrong = read_sparse(model_, accessor, element, elements);
  if (!wrong.empty()) fail(wrong);
  return std::move(elements.values);
}

int GltfAccessors::components(int index) const {
  if (index < 0 || index >= static_cast<int>(model_.accessors.size()))
    throw IoError(fmt::format("{}: there is no accessor {}", where_, index));
  return tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(model_.accessors[index].type));
}

}  // namespace skeletex
