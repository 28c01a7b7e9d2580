// SPDX-License-Identifier: MIT
#define TINYGLTF_IMPLEMENTATION
#include "skeletex/io/gltf/tinygltf.h"
