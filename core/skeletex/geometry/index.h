// SPDX-License-Identifier: MIT
#pragma once
#include <type_traits>

namespace skeletex {

/// The place of one thing in a list of its kind; -1 is none. It is made from an int and reads as one, but an index of
/// one kind is never taken for one of another.
template <class Kind>
class Index {
 public:
  constexpr Index() = default;
  constexpr Index(int value) : value_(value) {}  // lists and buffers hold ints
  template <class Other>
  Index(Index<Other>) = delete;

  constexpr operator int() const { return value_; }
  constexpr Index& operator++() {
    ++value_;
    return *this;
  }
  template <class Json>
  friend void to_json(Json& json, Index index) {  // for nlohmann::json, whose braces else make it a string's length
    json = index.value_;
  }

 private:
  int value_ = -1;
};

template <class Kind, class Other>
requires(!std::is_same_v<Kind, Other>) bool operator==(Index<Kind>, Index<Other>) = delete;

using VertexIndex = Index<struct VertexKind>;
using TriangleIndex = Index<struct TriangleKind>;
using NodeIndex = Index<struct NodeKind>;
using BoneIndex = Index<struct BoneKind>;
using PatchIndex = BoneIndex;                ///< a bone's patch has the bone's number
using ArcIndex = Index<struct ArcKind>;      ///< of a segmentation, or of a model's seams
using TexelIndex = Index<struct TexelKind>;  ///< row by row in the texture

}  // namespace skeletex
