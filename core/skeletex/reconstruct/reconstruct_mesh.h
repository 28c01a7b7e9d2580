// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <vector>

#include "skeletex/cl/context.h"
#include "skeletex/model/mesh.h"
#include "skeletex/model/texture.h"
#include "skeletex/reconstruct/lattice.h"

namespace skeletex {

/// A mesh from a model, in its bind pose, at the model's own resolution (paper 3.6). Closed, oriented, 2-manifold and
/// of the input's genus by construction: inner rows are vertices of their own, seams and corners are shared polylines
/// that both sides fill up to, poles are single vertices. Quads take diagonals by the model's rule.
/// \throw DeviceError
TriangleMesh reconstruct_mesh(ClContext& context, const SkeletexModel& model);

/// The mesh that a model would reconstruct to whose texels decode to given points; its own texture is not looked at.
/// \param rule    of its diagonals, in place of the model's
/// \param planes  x, y, z per texel of the texture, relative to the model's origin; of rows 0 and height-1 only poles count
TriangleMesh mesh_of_points(ClContext& context, const SkeletexModel& model, DiagonalRule rule, const std::array<std::vector<float>, 3>& planes);

/// The vertices of that mesh alone, in the order of lattice.h. \throw DeviceError
std::vector<Vec3> lattice_positions(ClContext& context, const SkeletexModel& model);
/// Its triangles that touch a pole or a seam: fans and strips. \param positions  of all vertices of the lattice
std::vector<Triangle> end_triangles(const SkeletexModel& model, const Lattice& lattice, const std::vector<Vec3>& positions);

/// The same model with rectangles scaled to another texture size (longer side `size`, at least 4 x 4 each): texels are
/// resampled as bind-pose positions, averaged where the lattice gets coarser, seams are kept and resampled.
/// \throw InputError when the size is too small for the number of bones
SkeletexModel resample_model(ClContext& context, const SkeletexModel& model, int size);

}  // namespace skeletex
