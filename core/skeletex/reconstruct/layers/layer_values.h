// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/model/mesh_attributes.h"
#include "skeletex/reconstruct/prepared_model.h"

namespace skeletex {

/// Where a vertex of the lattice has its values from: between two texels of a row.
struct VertexTexels {
  int first = 0, second = 0;  ///< texels of the texture
  float share = 0;            ///< of the second
};
/// Of all vertices, in the order of lattice.h. Inner ones and poles have texels of their own. Samples and corners of
/// seams read the end row of the patch that has the most columns there.
std::vector<VertexTexels> texels_of_vertices(const PreparedModel& model);

/// \return nothing where the model has no layer of that name
const Layer* find_layer(const SkeletexModel& model, const std::string& name);
inline constexpr const char* kNormalLayer = "normal";
inline constexpr const char* kColourLayer = "colour";

/// A plane's values at the vertices.
std::vector<float> values_at(std::span<const VertexTexels> vertices, std::span<const float> plane);
/// The directions of a layer of normals, per texel, in world axes of the bind pose; between rectangles zero.
std::vector<Eigen::Vector3f> texel_normals(const PreparedModel& model, const Layer& layer);
/// The same at the vertices, unit.
std::vector<Vec3> normals_at(std::span<const VertexTexels> vertices, std::span<const Eigen::Vector3f> normals);
/// A layer of normals from directions per texel, in world axes of the bind pose.
Layer normal_layer(const PreparedModel& model, std::span<const Eigen::Vector3f> normals);

/// What a mesh of the model's vertices has: its normals, colours and numbers.
MeshAttributes vertex_attributes(const PreparedModel& model);
/// Layers from values per texel, which are numbered as those of the texture.
std::vector<Layer> layers_of_texels(const PreparedModel& model, const MeshAttributes& texels);
/// Layers from values per vertex: the inverse of vertex_attributes. Rows 0 and height-1 follow the seams and poles.
std::vector<Layer> layers_of_vertices(const PreparedModel& model, const MeshAttributes& vertices);

/// Turns the normals of a model whose vertices have moved, see turn_normals. The others stay bit by bit.
/// \param mesh  of the model before
/// \param positions  of its vertices afterwards
/// \param result  of the same layout; its layer of normals, where it has one, is set
void turn_normal_layer(const PreparedModel& model, const TriangleMesh& mesh, std::span<const Vec3> positions,
                       SkeletexModel& result);

}  // namespace skeletex
