// SPDX-License-Identifier: MIT
#include "rig_file.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

namespace skeletex::cli {
namespace {

/// The weights of joints travel with the mesh.
void close_surface(RigFile& file, const CloseOptions& close) {
  MeshParts parts{std::move(file.surface.mesh), std::move(file.surface.attributes), {}};
  for (const std::vector<JointWeight>& weights : file.surface.weights) {
    parts.weights.emplace_back();
    for (const auto& [node, weight] : weights) parts.weights.back().push_back({node, weight});
  }
  file.closing = close_mesh(parts, close);
  file.surface.mesh = std::move(parts.mesh);
  file.surface.attributes = std::move(parts.attributes);
  file.surface.weights.clear();
  for (const std::vector<BoneWeight>& weights : parts.weights) {
    file.surface.weights.emplace_back();
    for (const auto& [node, weight] : weights)
      file.surface.weights.back().push_back({node, static_cast<float>(weight)});
  }
}

}  // namespace

RigFile load_rig(const std::filesystem::path& path, const CloseOptions& close) {
  RigFile file;
  file.path = path.string();
  file.scene = read_gltf(path);
  file.surface = gltf_surface(file.scene, file.path);
  const int merged = file.surface.vertices_in_file - static_cast<int>(file.surface.mesh.positions.size());
  if (merged > 0)
    spdlog::info("{}: {} of {} vertices lay on others and were welded{}", file.path, merged,
                 file.surface.vertices_in_file,
                 file.surface.degenerate_triangles > 0
                     ? fmt::format("; {} triangles without area are left out", file.surface.degenerate_triangles)
                     : "");
  if (close.is_on) close_surface(file, close);
  return file;
}

ImportedRig import_rig(const RigFile& file) {
  ImportedRig rig = skeletex::import_rig(file.scene, file.surface);
  for (const std::string& note : rig.notes) spdlog::info("{}: {}", file.path, note);
  return rig;
}

}  // namespace skeletex::cli
