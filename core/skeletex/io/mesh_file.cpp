// SPDX-License-Identifier: MIT
#include "skeletex/io/mesh_file.h"

#include <fmt/format.h>

#include <algorithm>

#include "skeletex/io/gltf/gltf_surface.h"
#include "skeletex/io/gltf/read_gltf.h"
#include "skeletex/io/mesh/mesh_builder.h"
#include "skeletex/io/read_file.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

std::string lower_extension(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

}  // namespace

MeshFile read_mesh(const std::filesystem::path& path) {
  if (is_gltf_file(path)) return read_gltf_mesh(path);
  const std::string where = path.string(), extension = lower_extension(path);
  const std::string bytes = read_file(path);
  if (bytes.empty()) throw IoError(where + ": the file is empty");
  if (extension == ".obj") return read_obj(bytes, where);
  if (extension == ".off") return read_off(bytes, where);
  if (extension == ".ply") return read_ply(bytes, where);
  if (extension == ".stl") return read_stl(bytes, where);
  throw IoError(
      fmt::format("{}: meshes are read from .obj, .off, .ply, .stl, .glb, .gltf and .vrm files, not from \"{}\"", where,
                  extension));
}

}  // namespace skeletex
