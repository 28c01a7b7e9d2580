// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <vector>

#include "skeletex/reconstruct/prepared_model.h"
#include "skeletex/reconstruct/texture/corner_coordinates.h"
#include "skeletex/render/draw.h"

namespace skeletex {

/// (u, v) of the corners of each triangle, three pairs each, in cells of a checker that is about as long as wide on
/// every bone: `cells` around, and along by length over girth. v does not jump inside a triangle.
/// \param mesh  the model's mesh in its bind pose
std::vector<std::array<float, 2>> checker_coordinates(const PreparedModel& model, const TriangleMesh& mesh, int cells);

/// A skeleton as a closed mesh to look at: a ball per node, a spindle per bone that is thicker at the head.
/// \param radius  of the balls, world units
TriangleMesh skeleton_mesh(const Skeleton& skeleton, double radius);
/// The bone of each of its triangles, -1 for balls.
std::vector<int> skeleton_mesh_bones(const Skeleton& skeleton);
/// Lays the skeleton over a picture of its surface, as if seen through it.
/// \param diagonal  of the surface
/// \param options   of the picture
/// \throw DeviceError
void draw_skeleton(GlContext& gl, const Skeleton& skeleton, double diagonal, const Camera& camera,
                   const DrawOptions& options, Image& image);

}  // namespace skeletex
