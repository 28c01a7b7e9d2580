// SPDX-License-Identifier: MIT
#include "inputs.h"

#include <fmt/format.h>

#include "skeletex/convert/encode_model.h"
#include "skeletex/io/mesh_file.h"
#include "skeletex/io/model_config.h"
#include "skeletex/io/skeleton_file.h"
#include "skeletex/model/error.h"
#include "subdivide.h"

namespace skeletex {
namespace {

namespace fs = std::filesystem;

}  // namespace

MeshInputPointer read_mesh_input(const fs::path& config_path) {
  const ModelConfig config = read_model_config(config_path);
  for (const fs::path& path : {config.mesh, config.skeleton})
    if (!fs::exists(path))
      throw IoError(
          fmt::format("{}, which {} names, is missing; scripts/install-dependencies.sh unpacks the standard meshes "
                      "into build/meshes",
                      path.lexically_normal().string(), config_path.lexically_normal().string()));
  return std::make_shared<MeshInput>(MeshInput{config.name, config.mesh, config.skeleton, read_mesh(config.mesh).mesh,
                                               read_skeleton(config.skeleton)});
}

MeshInputPointer find_mesh_input(const std::string& name, int subdivisions) {
  std::error_code ignored;
  for (fs::path start : {fs::current_path(), fs::read_symlink("/proc/self/exe", ignored).parent_path()})
    for (;; start = start.parent_path()) {
      const fs::path config = start / "configs/models" / (name + ".json");
      if (fs::exists(config)) {
        auto input = std::make_shared<MeshInput>(*read_mesh_input(config));
        for (int i = 0; i < subdivisions; ++i) input->mesh = subdivided(input->mesh);
        if (subdivisions > 0) input->name = fmt::format("{}_{}k", name, input->mesh.triangles.size() / 1000);
        return input;
      }
      if (!start.has_relative_path()) break;
    }
  throw IoError(
      fmt::format("there is no configs/models/{}.json here, nor above this folder or the program; run this in the "
                  "project's folder, or name a model",
                  name));
}

TextureInputPointer encode_input(ClContext& context, const MeshInput& input, int size) {
  EncodeOptions options;
  options.width = options.height = size;
  return std::make_shared<TextureInput>(
      TextureInput{input.name, encode_model(context, input.mesh, input.skeleton, options).model});
}

}  // namespace skeletex
