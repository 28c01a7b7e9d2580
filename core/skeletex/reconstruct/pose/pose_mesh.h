// SPDX-License-Identifier: MIT
#pragma once
#include <span>

#include "skeletex/reconstruct/displace.h"
#include "skeletex/reconstruct/lattice.h"
#include "skeletex/reconstruct/pose/posed_frame.h"

namespace skeletex {

/// How a pose moves the surface.
enum class Deformation {
  kSmooth,       ///< bind points by blended dual quaternions, with weights of all bones near by (skin.h)
  kCoordinates,  ///< each bind point by the paper's rules at its own coordinates along and about its bone
  kPaper,        ///< texels by the paper's rules at their own (u, v) (paper 3.4, 3.6.1)
  kLinear,       ///< bind points by linear blend skinning with four weights, as exported rigs move (linear_skin.h)
};
const char* to_string(Deformation deformation);

struct PoseRule {
  Deformation deformation = Deformation::kSmooth;
  DistanceRule distance = DistanceRule::kFromBone;  ///< of kPaper and kCoordinates
};

/// The model's mesh in a pose. Vertices and triangles are numbered as in reconstruct_mesh(context, model): all poses of
/// a model share their triangles, and every pose is as closed as the bind pose. Positions are in the user's units.
/// \param posed  apply_pose(model.skeleton, ...)
TriangleMesh reconstruct_mesh(ClContext& context, const PreparedModel& model, const Skeleton& posed,
                              const PoseRule& rule = {});

/// Places poles, seam samples and corners of a pose by the paper's rules. They are few, and several patches share them,
/// so the host does this in double precision.
/// \param positions  by lattice vertex, world; inner vertices are left as
/// they are
void place_shared_vertices(const PreparedModel& model, const PosedPlanes& posed, DistanceRule rule,
                           std::vector<Vec3>& positions);

/// A plane of constant texels (0, 0, offset) in bone tangent space (paper, Figure 7): per chosen bone all rows and
/// columns of its patch as a mesh that is closed around the bone and open at its ends, in the user's units.
/// \param bones   empty: all
/// \param offset  in the model's frame, > 0
TriangleMesh constant_offset_mesh(ClContext& context, const PreparedModel& model, const Skeleton& posed,
                                  std::span<const int> bones, double offset,
                                  DistanceRule rule = DistanceRule::kFromBone);

/// A pose on the device.
struct DevicePose {
  ClBuffer<PatchRecord> patches;
  ClBuffer<PosedRowRecord> rows;
  ClBuffer<float> columns;          ///< four planes: roll_head, roll_tail, slope_head, slope_tail
  ClBuffer<LatticeRow> plain_rows;  ///< whose capsule is the bone's own
  ClBuffer<LatticeRow> other_rows;  ///< the rest
  bool is_distance_kept = true;
  Vec3 origin;  ///< world position that the points are relative to
};
DevicePose upload_pose(ClContext& context, const PreparedModel& model, const PosedPlanes& posed, RowChoice choice,
                       DistanceRule rule);

/// Queues the posed points of all rows (two launches at most), relative to the pose's origin.
/// \pre lattice was uploaded from the model with the same choice of rows
void displace_posed(ClContext& context, const DeviceLattice& lattice, const DevicePose& pose, DevicePlanes& points);

}  // namespace skeletex
