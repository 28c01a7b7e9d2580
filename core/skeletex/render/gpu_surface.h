// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/geometry/mesh.h"
#include "skeletex/render/gl_context.h"
#include "skeletex/render/gl_objects.h"

namespace skeletex {

/// A triangle mesh on the GL device. Positions are floats relative to `origin`.
struct GpuSurface {
  int vertex_count = 0, triangle_count = 0;
  Vec3 origin = Vec3::Zero();         ///< world
  GlBuffer positions, normals;        ///< three floats per vertex
  GlBuffer indices;                   ///< three ints per triangle
  GlBuffer incident_begin, incident;  ///< the triangles at each vertex
};

/// Positions relative to the bounding box's centre, normals made.
GpuSurface upload_surface(GlContext& context, const TriangleMesh& mesh);
/// Normals from the positions as they are now.
void update_normals(GlContext& context, GpuSurface& surface);
/// Normals of its own, unit, per vertex.
void write_normals(GpuSurface& surface, std::span<const Vec3> normals);
/// World positions, as the device has them.
std::vector<Vec3> download_positions(const GpuSurface& surface);

}  // namespace skeletex
