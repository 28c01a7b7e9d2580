// SPDX-License-Identifier: MIT
#pragma once
#include <filesystem>
#include <string>

#include "skeletex/io/gltf/gltf_scene.h"

namespace skeletex {

/// The triangles of a mesh with its normals, else those of the triangles, its colours, and its texture coordinates;
/// numbers are left out. A vertex with several of them becomes several.
struct SurfacePrimitive {
  GltfPrimitive primitive;
  std::vector<int> sources;  ///< per position: the vertex of the mesh
};
SurfacePrimitive primitive_of(const TriangleMesh& mesh, const MeshAttributes& attributes);
/// The material of such a mesh: with the first picture, white where there are colours, else grey.
/// \param images  of the scene; takes the picture
GltfMaterial material_of(const MeshAttributes& attributes, std::vector<ColourImage>& images);

/// Writes a binary glTF 2.0 file (.glb), positions in single precision. Atomic; the same scene gives the same bytes.
/// Images become PNG.
/// \throw IoError when a number is not finite in single precision, the file would pass 4 GB, or it cannot be written
void write_gltf(const std::filesystem::path& path, const GltfScene& scene);

}  // namespace skeletex
