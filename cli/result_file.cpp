// SPDX-License-Identifier: MIT
#include "result_file.h"

#include <fmt/format.h>

#include "files.h"
#include "skeletex/io/mesh_file.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/layers/layer_values.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex::cli {
namespace {

bool is_model(const std::string& path) { return has_ending(path, ".exr"); }

}  // namespace

void add_result_option(CLI::App& command, std::string& path) {
  declare_output(command, command.add_option("-o,--output", path, "model (.skx.exr) or mesh (.ply, .obj, .stl, .glb)"),
                 {".exr", ".ply", ".obj", ".stl", ".glb"})
      ->required()
      ->type_name("FILE");
}

Json write_result(ClContext& context, const SkeletexModel& model, const std::string& path,
                  const ModelFileOptions& options) {
  Json json{{"path", path},
            {"kind", is_model(path) ? "model" : "mesh"},
            {"size", {model.texture.width, model.texture.height}}};
  if (is_model(path)) {
    write_model(path, model, options);
  } else {
    const TriangleMesh mesh = reconstruct_mesh(context, model);
    write_mesh(path, mesh, vertex_attributes(model));
    json["vertices"] = mesh.positions.size();
    json["triangles"] = mesh.triangles.size();
  }
  return json;
}

}  // namespace skeletex::cli
