// SPDX-License-Identifier: MIT
#pragma once
#include <string>
#include <vector>

namespace skeletex_tinygltf {
class Model;
}

namespace skeletex {

/// The numbers of a glTF file, every index and size checked.
class GltfAccessors {
 public:
  /// \param where  the file, in messages
  /// \param model  must outlive this
  GltfAccessors(const skeletex_tinygltf::Model& model, std::string where) : model_(model), where_(std::move(where)) {}

  /// All values of an accessor behind each other: strided, sparse and normalised ones too.
  /// \param components  per element: 1, 2, 3, 4 or 16; 0: as many as it has
  /// \throw IoError naming the accessor
  std::vector<double> read(int accessor, int components) const;
  int components(int accessor) const;

 private:
  const skeletex_tinygltf::Model& model_;
  std::string where_;
};

}  // namespace skeletex
