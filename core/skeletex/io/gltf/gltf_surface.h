// SPDX-License-Identifier: MIT
#pragma once
#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "skeletex/io/gltf/gltf_scene.h"
#include "skeletex/io/mesh_file.h"
#include "skeletex/model/mesh_attributes.h"

namespace skeletex {

/// How much a joint moves a vertex.
struct JointWeight {
  int node = -1;
  float weight = 0;
};

/// All triangles of a scene as one mesh in the bind pose of its skins, in the scene's coordinates. Vertices that are
/// nearer to each other than 1e-5 of the diagonal are one: files repeat those at the borders of materials, of texture
/// coordinates and at creases.
struct GltfSurface {
  TriangleMesh mesh;
  std::vector<std::vector<JointWeight>> weights;  ///< per vertex; their sum is 1; empty where no joint moves it
  MeshAttributes attributes;
  std::vector<Eigen::Affine3d> rest;  ///< per node: to the scene in the bind pose; of joints alone
  std::vector<bool> is_joint;         ///< per node: of a skin that a mesh has
  int vertices_in_file = 0;
  int degenerate_triangles = 0;  ///< that welding left with two corners or fewer; they are left out
  std::vector<std::string> notes;
};

/// Where nodes are in the scene as the file has it, without animation.
std::vector<Eigen::Affine3d> node_transforms(const std::vector<GltfNode>& nodes);

/// The bind pose follows from the inverse bind matrices. It stands where the file shows it; where the file shows
/// another pose, it stands upright on the root's place. A skin without those matrices is bound as the file shows it.
/// Meshes that hang on a joint without a skin move with it; in a file with skins, meshes that hang on none are left
/// out.
/// \throw InputError when there are no triangles, or a joint is not there
GltfSurface gltf_surface(const GltfScene& scene, const std::string& where);
/// The mesh of a glTF file, with its attributes.
/// \throw IoError, InputError
MeshFile read_gltf_mesh(const std::filesystem::path& path);

}  // namespace skeletex
