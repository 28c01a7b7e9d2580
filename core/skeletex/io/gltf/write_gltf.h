// SPDX-License-Identifier: MIT
#pragma once
#include <filesystem>
#include <string>

#include "skeletex/io/gltf/gltf_scene.h"

namespace skeletex {

/// Writes a binary glTF 2.0 file (.glb), positions in single precision. Atomic; the same scene gives the same bytes.
/// Images become PNG.
/// \throw IoError when a number is not finite in single precision, the file would pass 4 GB, or it cannot be written
void write_gltf(const std::filesystem::path& path, const GltfScene& scene);

}  // namespace skeletex
