// SPDX-License-Identifier: MIT
#pragma once
#include <filesystem>

#include "skeletex/io/gltf/gltf_scene.h"

namespace skeletex {

/// Whether a path ends as glTF files do: .glb, .gltf or .vrm.
bool is_gltf_file(const std::filesystem::path& path);

/// Reads a glTF 2.0 file, binary or text, by its content: nodes, triangles, skins, animations, base colours and
/// pictures. What Draco and meshopt compress is unpacked, primitives are triangle lists afterwards, and morph targets
/// are applied with their default weights. The notes say what is left out: lines, pictures that cannot be read,
/// animated morph targets.
///
/// \throw IoError naming what is wrong: damaged, an index out of range, nodes in a circle, a number that is not finite,
/// or an extension that is needed and not known
GltfScene read_gltf(const std::filesystem::path& path);

}  // namespace skeletex
