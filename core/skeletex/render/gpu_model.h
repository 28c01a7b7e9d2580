// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/model/posed_walls.h"
#include "skeletex/model/texture.h"
#include "skeletex/reconstruct/lattice.h"
#include "skeletex/render/gpu_surface.h"

namespace skeletex {

/// A model on the GL device (paper 3.6): its texture, and the tables that place every texel of a lattice per bone.
struct GpuModel {
  Lattice lattice;
  GlTexture texels;  ///< along, around, out
  GlBuffer lattice_rows, patches, rows, columns;
  int row_count = 0, widest = 0, column_count = 0;
};
GpuModel upload_model(const SkeletexModel& model);

/// Moves a surface's vertices to the model's points in a pose, in a compute shader that reads the texture; seams and poles,
/// few and shared, are made on the host. Normals follow.
/// \param surface  upload_surface of reconstruct_mesh(.., model), whose numbering it keeps
/// \param posed    apply_pose(model.skeleton, ..), or the model's own skeleton for the bind pose
void displace(GlContext& context, const GpuModel& device, const SkeletexModel& model, const Skeleton& posed, DistanceRule rule, GpuSurface& surface);

}  // namespace skeletex
