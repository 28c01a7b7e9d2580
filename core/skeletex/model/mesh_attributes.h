// SPDX-License-Identifier: MIT
#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "skeletex/geometry/mesh.h"
#include "skeletex/skeleton/bone_motion.h"

namespace skeletex {

/// Red, green, blue of linear light and opacity, 0 to 1.
using Colour = Eigen::Vector4f;

/// Pictures and files of meshes hold colours in sRGB.
float linear_from_srgb(float value);
float srgb_from_linear(float value);

/// A picture with 8 bits per channel: red, green, blue in sRGB and opacity; rows from the top.
struct ColourImage {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgba;

  bool empty() const { return rgba.empty(); }
};

struct Material {
  std::string name;
  Colour base = Colour::Ones();      ///< multiplies the picture and the vertex colours
  std::filesystem::path image_file;  ///< of a picture that is not read yet
  ColourImage image;
};

/// A number per vertex, under the name that it has in its file.
struct VertexNumbers {
  std::string name;
  std::vector<float> values;
};

struct AttributedMesh;

/// What a mesh has beside its geometry. All of it can be empty.
struct MeshAttributes {
  CornerValues<Vec3> normals;  ///< unit
  CornerValues<Colour> colours;
  /// Of pictures: (0, 0) is the lower left corner, (1, 1) the upper right one; beyond, the picture repeats.
  CornerValues<Eigen::Vector2f> texture_coordinates;
  std::vector<Material> materials;
  std::vector<int> triangle_materials;  ///< per triangle; -1: none
  std::vector<VertexNumbers> numbers;
  /// Of a closed mesh in place of a file's: that of the file, in the user's units. Its colours, normals and weights
  /// come first.
  std::shared_ptr<const AttributedMesh> original;
};

/// A mesh, and what it has beside its geometry.
struct AttributedMesh {
  TriangleMesh mesh;
  MeshAttributes attributes;
  VertexBoneWeights weights = {};  ///< of the joints of a rig, in place of bones; empty: none
};

/// The original of a closed mesh where it has weights; else null.
const AttributedMesh* weighted_original(const MeshAttributes& attributes);
/// Whether there are colours: of vertices, of pictures that are read, or of materials that differ.
bool has_colour(const MeshAttributes& attributes);
/// Follows a mesh whose triangles are turned over: swaps the corners 1 and 2 of each. Normals stay as they are.
/// \param is_turned  per triangle; empty: all are
void turn_over(MeshAttributes& attributes, const std::vector<bool>& is_turned = {});

/// The same surface with a vertex for each set of values, so that normals, colours and texture coordinates are by
/// vertex.
struct SplitMesh {
  TriangleMesh mesh;
  MeshAttributes attributes;
  std::vector<int> sources;  ///< per vertex: the vertex that it stands for
};
SplitMesh split_vertices(const TriangleMesh& mesh, const MeshAttributes& attributes);

}  // namespace skeletex
