// SPDX-License-Identifier: MIT
#pragma once
#include <filesystem>

#include "close_mesh.h"
#include "command.h"
#include "skeletex/io/gltf/read_gltf.h"
#include "skeletex/rig/import_rig.h"

namespace skeletex::cli {

/// A rigged character of another program.
struct RigFile {
  std::string path;
  GltfScene scene;
  GltfSurface surface;
  Json closing;  ///< what --close did; null: nothing
};
/// Reads a glTF file, closes its surface where that is asked for, and says on standard error what was done to it.
RigFile load_rig(const std::filesystem::path& path, const CloseOptions& close);
/// Skeleton, weights and animations; says on standard error what became of the joints.
ImportedRig import_rig(const RigFile& file);

}  // namespace skeletex::cli
