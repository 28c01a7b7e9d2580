// SPDX-License-Identifier: MIT
#pragma once
#include <filesystem>
#include <memory>
#include <string>

#include "skeletex/device/context.h"
#include "skeletex/model/texture.h"
#include "skeletex/skeleton/skeleton.h"

namespace skeletex {

/// A mesh and its skeleton, as a file in configs/models names them.
struct MeshInput {
  std::string name;
  std::filesystem::path mesh_path, skeleton_path;
  TriangleMesh mesh;
  Skeleton skeleton;
};
using MeshInputPointer = std::shared_ptr<const MeshInput>;

/// \param config  .json as in configs/models
/// \throw IoError naming the file that is missing and how to get the standard meshes
MeshInputPointer read_mesh_input(const std::filesystem::path& config);
/// The same for one of the project's models by its name: configs/models/NAME.json, looked for in the current folder and
/// those above it, then in those above the program.
/// \param subdivisions  every triangle becomes four, so many times
/// over; the surface stays. mesh_path is then the unchanged mesh's
/// \throw IoError saying where it looked, and what to
/// do
MeshInputPointer find_mesh_input(const std::string& name, int subdivisions = 0);

/// A texture model with a name for reports.
struct TextureInput {
  std::string name;
  SkeletexModel model;
};
using TextureInputPointer = std::shared_ptr<const TextureInput>;
/// What `skeletex encode` makes of the input by default.
TextureInputPointer encode_input(ClContext& context, const MeshInput& input, int size);

}  // namespace skeletex
