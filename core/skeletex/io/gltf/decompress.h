// SPDX-License-Identifier: MIT
#pragma once
#include <string>

namespace skeletex_tinygltf {
class Model;
}

namespace skeletex {

/// A glTF file, binary or text, as tinygltf reads it: buffers and indices that compressed files leave empty get some
/// that decompress_gltf replaces. Other files come back as they are.
std::string completed_for_tinygltf(std::string file);

/// Replaces what KHR_draco_mesh_compression and EXT_meshopt_compression pack by plain buffers and accessors.
/// \param where  the file, in messages
/// \throw IoError naming the mesh or the buffer view: damaged, or larger than 2 GiB
void decompress_gltf(skeletex_tinygltf::Model& model, const std::string& where);

}  // namespace skeletex
