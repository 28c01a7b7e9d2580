// SPDX-License-Identifier: MIT
#pragma once
// tinygltf under a name of its own: Debian's Draco exports another copy of it, which would take its place.
#define tinygltf skeletex_tinygltf  // NOLINT
#include <tiny_gltf.h>
