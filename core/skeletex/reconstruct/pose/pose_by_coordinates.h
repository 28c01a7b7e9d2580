// SPDX-License-Identifier: MIT
#pragma once
#include <vector>

#include "skeletex/device/context.h"
#include "skeletex/reconstruct/displace.h"
#include "skeletex/reconstruct/lattice.h"
#include "skeletex/reconstruct/pose/posed_frame.h"
#include "skeletex_structs.h"

namespace skeletex {

// Posing by the paper's rules (3.4, 3.6.1) at each point's own coordinates. These are the (u, v) at which SPD would
// have placed the point (paper 3.2.1); there its texel is (0, 0, distance from the bone). So the result depends on the
// point alone, not on the map that placed its texel. The bind pose and rigid motions are exact, and on a separation
// plane both bones agree with the posed seam.

/// A point's place about a bone, as SPD maps it.
struct BoneCoordinates {
  double u = 0;     ///< map coordinate along the bone, caps included: see axial_of
  double turn = 0;  ///< angle about the bone, turns in [0,1)
};
/// SPD's map in closed form. Let x be the point's place along the bone from the head, and r its distance from the axis.
/// Measured along the bone, the head's separation plane is a = x - r k_H away, and the tail's b = L + r k_T - x. The
/// axial parameter is a / (a + b). A point beyond one plane takes that end's axial parameter. Where the planes have
/// crossed, a point may be beyond both; its axial parameter is b / (a + b), which grows with x as well.
/// \param skeleton, separation, point  of the bind pose; world
BoneCoordinates bone_coordinates(const Skeleton& skeleton, const SeparationPlanes& separation, BoneIndex bone,
                                 const Vec3& point);

/// A bind point of a bone in a pose, world: posed_point of its SPD texel.
Vec3 posed_by_coordinates(const PreparedModel& model, const PosedPlanes& posed, BoneIndex bone, const Vec3& point,
                          DistanceRule rule);

/// The coordinates of a model's inner vertices (lattice.h) on the device, made once. Any pose of them is one pass.
struct DeviceCoordinates {
  ClBuffer<SkinBlock> blocks;
  ClBuffer<PatchRecord> patches;  ///< of the bind pose
  /// Five planes: angle, distance and height about the vertex's bone, and the slopes of the bind pose's separation
  /// planes at the head and tail at that angle (kernels/coordinates.cl).
  ClBuffer<float> values;
};
/// \param points  of the inner vertices in the bind pose, relative to the model's origin
/// \throw DeviceError
DeviceCoordinates make_coordinates(ClContext& context, const PreparedModel& model, const DevicePlanes& points);

/// Queues the points of the inner vertices in a pose (one launch), relative to `origin`.
void pose_by_coordinates(ClContext& context, const SkeletexModel& model, const DeviceCoordinates& coordinates,
                         const PosedPlanes& posed, DistanceRule rule, const Vec3& origin, DevicePlanes& points);

/// Places the other vertices, on the host in double precision: poles by their own coordinates, seam samples and corners
/// by the paper's rule.
/// \param positions  by lattice vertex, world; inner vertices are left as they are
void place_shared_by_coordinates(const PreparedModel& model, const PosedPlanes& posed, DistanceRule rule,
                                 std::vector<Vec3>& positions);

}  // namespace skeletex
