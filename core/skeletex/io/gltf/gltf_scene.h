// SPDX-License-Identifier: MIT
#pragma once
#include <Eigen/Geometry>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "skeletex/geometry/mesh.h"
#include "skeletex/model/mesh_attributes.h"

/// What this project takes from a glTF 2.0 file and puts into one, as plain structs. Indices are checked by the reader.
namespace skeletex {

struct GltfNode {
  std::string name;
  int parent = -1, mesh = -1, skin = -1;
  Vec3 translation = Vec3::Zero();
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Vec3 scale = Vec3::Ones();
  std::optional<Eigen::Matrix4d> matrix;  ///< instead of the three
};

/// Triangles of one material.
struct GltfPrimitive {
  std::vector<Vec3> positions, normals;              ///< normals: none, or one per position; so are the others below
  std::vector<Eigen::Vector2f> texture_coordinates;  ///< (0, 0) is the upper left corner of the picture
  std::vector<Eigen::Vector4f> tangents;  ///< unit, and the sign of the bitangent; the reader leaves them out
  std::vector<Eigen::Vector4f> colours;   ///< linear
  int influences = 0;                     ///< joints per position
  std::vector<int> joints;                ///< of the node's skin
  std::vector<float> weights;
  std::vector<Triangle> triangles;
  int material = -1;
};

struct GltfMesh {
  std::string name;
  std::vector<GltfPrimitive> primitives;
};

struct GltfSkin {
  std::string name;
  std::vector<int> joints;                     ///< nodes
  std::vector<Eigen::Matrix4d> inverse_binds;  ///< one per joint, or none
};

enum class GltfPath { kTranslation, kRotation, kScale };
enum class GltfInterpolation { kLinear, kStep, kCubic };

/// One channel of an animation.
struct GltfTrack {
  int node = -1;
  GltfPath path = GltfPath::kTranslation;
  GltfInterpolation interpolation = GltfInterpolation::kLinear;
  std::vector<double> times;            ///< seconds, growing
  std::vector<Eigen::Vector4d> values;  ///< x, y, z, w; cubic: in-tangent, value, out-tangent per time
};

struct GltfAnimation {
  std::string name;
  std::vector<GltfTrack> tracks;
};

struct GltfMaterial {
  std::string name;
  Eigen::Vector4f base_colour = Eigen::Vector4f::Ones();  ///< linear
  int image = -1;
};

struct GltfScene {
  std::vector<GltfNode> nodes;
  std::vector<GltfMesh> meshes;
  std::vector<GltfSkin> skins;
  std::vector<GltfAnimation> animations;
  std::vector<GltfMaterial> materials;
  std::vector<ColourImage> images;  ///< empty: one that cannot be read
  std::vector<std::string> notes;   ///< of the reader: what it left out
};

}  // namespace skeletex
