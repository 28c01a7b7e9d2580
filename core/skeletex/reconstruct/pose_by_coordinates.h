// SPDX-License-Identifier: MIT
#pragma once
#include <vector>

#include "skeletex/device/context.h"
#include "skeletex/reconstruct/displace.h"
#include "skeletex/reconstruct/lattice.h"
#include "skeletex/skeleton/posed_frame.h"
#include "skeletex_structs.h"

namespace skeletex {

// Posing by the paper's rules (3.4, 3.6.1) at each point's own coordinates: the (u, v) at which SPD would have put it
// (paper 3.2.1), where its texel is (0, 0, distance from the bone). So the result depends on the point alone, not on
// the map that placed its texel. The bind pose and rigid motions are exact, and on a separation plane both bones agree
// with the posed seam.

/// A point's place about a bone, as SPD maps it.
struct BoneCoordinates {
  double u = 0;     ///< map coordinate along the bone, caps included: see station_of
  double turn = 0;  ///< angle about the bone, turns in [0,1)
};
/// SPD's map in closed form. With x along the bone from the head and r the distance from its axis, the point lies,
/// along the bone, a = x - r k_H from the head's separation plane and b = L + r k_T - x from the tail's: its axial
/// parameter is a / (a + b). A point beyond one plane takes that end's axial parameter; where the planes have crossed
/// and it is beyond both, the axial parameter is b / (a + b), which grows with x as well. \param separation planes,
/// bone, point  of the bind pose; world
BoneCoordinates bone_coordinates(const Skeleton& skeleton, const SeparationPlanes& separation, int bone,
                                 const Vec3& point);

/// A bind point of a bone in a pose, world: posed_point of its SPD texel.
Vec3 posed_by_coordinates(const SkeletexModel& model, const SeparationPlanes& bind, const PosedPlanes& posed, int bone,
                          const Vec3& point, DistanceRule rule);

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
DeviceCoordinates make_coordinates(ClContext& context, const SkeletexModel& model, const DevicePlanes& points);

/// Queues the points of the inner vertices in a pose (one launch), relative to `origin`.
void pose_by_coordinates(ClContext& context, const SkeletexModel& model, const DeviceCoordinates& coordinates,
                         const PosedPlanes& posed, DistanceRule rule, const Vec3& origin, DevicePlanes& points);

/// The other vertices on the host in double: poles by their own coordinates, seam samples and corners as the paper's
/// rule has them. \param positions  by lattice vertex, world; inner vertices are left as they are
void place_shared_by_coordinates(const SkeletexModel& model, const PosedPlanes& posed, const Lattice& lattice,
                                 DistanceRule rule, std::vector<Vec3>& positions);

}  // namespace skeletex
