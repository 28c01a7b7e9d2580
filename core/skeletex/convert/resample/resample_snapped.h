// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/convert/parameterize/chart.h"
#include "skeletex/device/context.h"
#include "skeletex/reconstruct/prepared_model.h"

namespace skeletex {

// Other sizes of a model whose texels sit on the vertices and edges of its mesh. Its triangles are the surface, and
// stay it: a smooth surface through the texels, as of a regular grid, would round its edges.

/// Whether a layout has at least as many rows and columns as the model in every patch.
bool is_finer(const SkeletexModel& model, const std::vector<Patch>& patches);

/// Rows of a finer patch: each of the old rows is one of them, the others lie evenly between, but none between a seam
/// and the row next to it, where triangles follow no columns. Per new row the old one that it reads, with fractions.
std::vector<double> rows_of_finer(const PreparedModel& model, BoneIndex bone, int height);
/// The same of columns; they lie evenly between the old ones, of which the old one numbered `old_width` is column 0
/// again.
std::vector<double> columns_of_finer(int old_width, int width);

/// Sets the texels of a finer layout: each old texel is one of the new ones, the others lie on the triangles between.
/// \param result  with its patches and seams; its row_u are set too
void refine_texels(ClContext& context, const PreparedModel& model, SkeletexModel& result);

/// The points of a seam's arc, in the model's frame: its samples, and the corners of an open one at its ends.
std::vector<Vec3> arc_points(const SkeletexModel& model, const SeparationPlanes& separation, const SeamArc& arc);
/// The arc with each of its edges divided.
SeamArc divide_arc(const SkeletexModel& model, const SeparationPlanes& separation, const SeamArc& arc, int parts);

/// Sets the texels of a layout that is no refinement: the mesh of the model is snapped and fitted anew.
/// \param mesh    of the model, see reconstruct_bind_mesh
/// \param charts  its map: charts_of_mesh, or these with moved places
/// \param result  with its patches and seams; its sampling and rule of diagonals are set too
void snap_again(ClContext& context, const PreparedModel& model, const TriangleMesh& mesh, std::span<const Chart> charts,
                SkeletexModel& result);

/// The patches of a model's mesh as mapped charts: texels at their places.
/// \param mesh  see reconstruct_mesh
std::vector<Chart> charts_of_mesh(const PreparedModel& model, const TriangleMesh& mesh);

}  // namespace skeletex
