// SPDX-License-Identifier: MIT
#include "rig_file.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "skeletex/analysis/validate_input.h"
#include "skeletex/model/error.h"
#include "skeletex/skeletonize/repair_skeleton.h"

namespace skeletex::cli {
namespace {

/// The weights of joints travel with the mesh.
void close_surface(RigFile& file, CloseOptions close) {
  close.has_rig = !file.scene.skins.empty();
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

/// A face alone can have fifty bones: the first changes stand for all.
void say_changes(const std::string& path, const Skeleton& before, const RepairResult& repaired) {
  constexpr std::size_t kShown = 3;
  const std::vector<std::string>& changes = repaired.changes;
  if (changes.empty()) return;
  spdlog::info("{}: its skeleton is repaired: {} bone{}, {} before", path, repaired.skeleton.bones.size(),
               repaired.skeleton.bones.size() == 1 ? "" : "s", before.bones.size());
  for (std::size_t i = 0; i < std::min(kShown, changes.size()); ++i) spdlog::info("{}: {}", path, changes[i]);
  if (changes.size() > kShown)
    spdlog::info("{}: further changes: {} (skeletex import --json lists them)", path, changes.size() - kShown);
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

ImportedRig import_rig(ClContext& context, const RigFile& file) {
  std::vector<std::string> changes;
  const auto repair = [&](const Skeleton& skeleton) {
    TriangleMesh mesh = file.surface.mesh;
    std::optional<TriangleTree> tree;
    if (has_errors(validate_mesh(mesh, &tree))) return skeleton;
    try {
      RepairResult repaired = repair_skeleton(context, mesh, *tree, skeleton);
      say_changes(file.path, skeleton, repaired);
      changes = std::move(repaired.changes);
      return std::move(repaired.skeleton);
    } catch (const DeviceError&) {
      throw;
    } catch (const Error& error) {  // Whoever validates this skeleton says what is wrong with it.
      spdlog::info("{}: its skeleton cannot be repaired: {}", file.path, error.what());
      return skeleton;
    }
  };
  ImportedRig rig = skeletex::import_rig(file.scene, file.surface, repair);
  for (const std::string& note : rig.notes) spdlog::info("{}: {}", file.path, note);
  rig.notes.insert(rig.notes.end(), changes.begin(), changes.end());
  return rig;
}

}  // namespace skeletex::cli
