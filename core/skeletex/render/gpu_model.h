// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/model/texture.h"
#include "skeletex/reconstruct/pose/posed_planes.h"
#include "skeletex/reconstruct/pose/skin.h"
#include "skeletex/reconstruct/prepared_model.h"
#include "skeletex/render/gpu_surface.h"

namespace skeletex {

/// A model on the GL device (paper 3.6): its texture, and the tables that place the texels of every bone.
struct GpuModel {
  GlTexture texels;  ///< along, around, out
  GlBuffer lattice_rows, rows, columns;
  int row_count = 0, widest = 0, column_count = 0;
};
GpuModel upload_model(const PreparedModel& model);

/// Moves a surface's vertices to the model's points in a pose by the paper's rules. A compute shader that reads the
/// texture moves the inner vertices; the host moves seams and poles. Normals follow.
/// \param posed    apply_pose(model.skeleton, ..), or the model's own skeleton for the bind pose
/// \param surface  upload_surface of reconstruct_mesh(.., model), whose numbering it keeps
void displace(GlContext& context, const GpuModel& device, const PreparedModel& model, const Skeleton& posed,
              DistanceRule rule, GpuSurface& surface);

/// A skin on the GL device.
struct GpuSkin {
  GlBuffer blocks, block_bones, weights;
  GlBuffer bind_positions;  ///< three floats per inner vertex, relative to the skin's origin
};
/// \param bind  the model's mesh in its bind pose
GpuSkin upload_skin(const Skin& skin, const TriangleMesh& bind);

/// Moves a surface's vertices as the other pose_skin does: inner vertices in a compute shader, shared ones on the host.
/// Normals follow.
/// \param posed  the skeleton that the motions lead to
void pose_skin(GlContext& context, const GpuSkin& device, const Skin& skin, std::span<const BoneMotion> motions,
               const Skeleton& posed, GpuSurface& surface);

}  // namespace skeletex
