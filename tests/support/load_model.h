// SPDX-License-Identifier: MIT
#pragma once
#include <string>

#include "skeletex/io/mesh_file.h"
#include "skeletex/io/model_config.h"
#include "skeletex/io/skeleton_file.h"

namespace skeletex {

struct TestModel {
  std::string name;
  TriangleMesh mesh;
  Skeleton skeleton;
};

/// One of the real models: configs/models/<name>.json. The meshes are unpacked by scripts/install-dependencies.sh.
inline TestModel load_standard_model(const std::string& name) {
  const ModelConfig config = read_model_config(std::string(SKELETEX_SOURCE_DIR "/configs/models/") + name + ".json");
  return {config.name, read_mesh(config.mesh).mesh, read_skeleton(config.skeleton)};
}

}  // namespace skeletex
