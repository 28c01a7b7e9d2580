// SPDX-License-Identifier: MIT
#pragma once
#include <string>

#include "command.h"
#include "skeletex/io/model_file.h"

namespace skeletex::cli {

/// The -o option of commands whose result is a model (.skx.exr) or the mesh that it reconstructs to (.ply, .obj, .stl,
/// .glb): its ending decides.
void add_result_option(CLI::App& command, std::string& path);
/// Writes the model, or reconstructs it in its bind pose and writes the mesh.
/// \throw IoError, DeviceError
/// \param options  of a model's file
/// \return for the JSON: path, kind ("model" or "mesh"), size, and of a mesh vertices and triangles
Json write_result(ClContext& context, const SkeletexModel& model, const std::string& path,
                  const ModelFileOptions& options = {});

}  // namespace skeletex::cli
