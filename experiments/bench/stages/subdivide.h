// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// Every triangle becomes four; the surface stays.
TriangleMesh subdivided(const TriangleMesh& mesh);

}  // namespace skeletex
