// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/device/context.h"
#include "skeletex/model/texture.h"
#include "skeletex/reconstruct/displace.h"
#include "skeletex/reconstruct/lattice.h"
#include "skeletex/skeleton/bone_motion.h"
#include "skeletex_structs.h"

namespace skeletex {

/// What smooth posing needs of a model: its points in the bind pose and their weights. Made once; every pose is then
/// one launch.
struct Skin {
  std::vector<SkinBlock> blocks;  ///< all inner vertices of the lattice (lattice.h), in order
  std::vector<int> block_bones;   ///< block by block
  std::vector<float> weights;     ///< SKIN_BLOCK per entry of block_bones
  int inner_count = 0;
  Vec3 origin = Vec3::Zero();                           ///< world position that the device's points are relative to
  std::vector<Vec3> shared_points;                      ///< poles, seam samples and corners in the bind pose, world
  std::vector<std::vector<BoneWeight>> shared_weights;  ///< of each of them
};

/// A skin on the device.
struct DeviceSkin {
  ClBuffer<SkinBlock> blocks;
  ClBuffer<int> block_bones;
  ClBuffer<float> weights;
  DevicePlanes points;  ///< inner vertices in the bind pose, relative to the skin's origin
};

/// The blocks of a model's inner vertices, whose bones and weights are not filled in.
std::vector<SkinBlock> skin_blocks(const std::vector<Patch>& patches);
/// One work-group per block: see kernels/skin.cl.
ClRange block_range(const ClContext& context, std::size_t blocks);

/// A bone that each pole, seam sample and corner belongs to, in the order of their vertices.
std::vector<int> bones_of_shared_vertices(const PreparedModel& model);

/// Weights of the model's own (SkeletexModel::bone_weights) where it has them, else in closed form (weight_walk.h).
/// \param points  of the inner vertices in the bind pose, relative to the model's origin
/// \throw DeviceError
Skin make_skin(ClContext& context, const PreparedModel& model, const DevicePlanes& points);
DeviceSkin upload_skin(ClContext& context, const Skin& skin, DevicePlanes points);

/// How much a bone moves each vertex of the model's mesh, 0 to 1.
std::vector<float> vertex_weights(const Skin& skin, BoneIndex bone);

/// Weights in closed form of all texels, per bone a plane of the texture's size, as SkeletexModel::bone_weights has
/// them; 0 outside patches.
std::vector<std::vector<float>> weight_planes(ClContext& context, const PreparedModel& model);

/// The motions as the kernels read them: from the bind origin to the posed one.
std::vector<BoneMotionRecord> motion_records(std::span<const BoneMotion> motions, const Vec3& bind_origin,
                                             const Vec3& posed_origin);
/// Whether a bone changes its length.
bool is_stretched(std::span<const BoneMotion> motions);

/// Queues the points of the inner vertices in a pose (one launch), relative to `posed_origin`.
void pose_skin(ClContext& context, const Skin& skin, const DeviceSkin& device, std::span<const BoneMotion> motions,
               const Vec3& posed_origin, DevicePlanes& points);

/// Moves the other vertices. They are few, and several patches share them, so the host does this in double precision.
/// \param positions  by lattice vertex, world; inner vertices are left as they are
void pose_shared_vertices(const Skin& skin, std::span<const BoneMotion> motions, std::vector<Vec3>& positions);

}  // namespace skeletex
