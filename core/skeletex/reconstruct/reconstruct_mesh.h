// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <functional>
#include <span>
#include <vector>

#include "skeletex/device/context.h"
#include "skeletex/geometry/mesh.h"
#include "skeletex/model/texture.h"
#include "skeletex/reconstruct/displace.h"
#include "skeletex/reconstruct/lattice.h"
#include "skeletex/reconstruct/seam_strip.h"

namespace skeletex {

/// The mesh of a model in its bind pose, at the model's own resolution (paper 3.6). It is closed, oriented, 2-manifold
/// and of the input's genus by construction: inner rows are vertices of their own, seams and corners are polylines that
/// the patches on both sides share, and poles are single vertices. Quads take diagonals by the model's rule. Positions
/// are in the user's units.
/// \throw DeviceError
TriangleMesh reconstruct_mesh(ClContext& context, const PreparedModel& model);

/// That mesh in the model's frame, and its inner vertices as they are on the device, relative to the model's origin.
struct BindMesh {
  TriangleMesh mesh;
  DevicePlanes inner;
};
BindMesh reconstruct_bind_mesh(ClContext& context, const PreparedModel& model);

/// The vertices of that mesh alone, in the order of lattice.h.
/// \throw DeviceError
std::vector<Vec3> lattice_positions(ClContext& context, const PreparedModel& model);
/// Its triangles that touch a pole or a seam: fans and strips.
/// \param positions  of all vertices of the lattice
std::vector<Triangle> end_triangles(const PreparedModel& model, const std::vector<Vec3>& positions);

/// The seam of an end, and its turns as strips take them; empty at a pole.
/// \param positions  at least of seams
struct EndSeam {
  Ring ring;
  std::vector<double> turns;
};
EndSeam end_seam(const SkeletexModel& model, const SeparationPlanes& separation, const Lattice& lattice,
                 std::span<const Vec3> positions, BoneIndex bone, BoneEnd end);
/// Appends the triangles between an end and the inner row next to it: a fan at a pole, else a strip.
void append_end_triangles(const SkeletexModel& model, const Lattice& lattice, std::span<const Vec3> positions,
                          const EndSeam& seam, BoneIndex bone, BoneEnd end, std::vector<Triangle>& triangles);

/// Places seam samples and corners. They are few, and several patches share them, so the host does this in double
/// precision.
void place_seams(const SkeletexModel& model, const SeparationPlanes& separation, const Lattice& lattice,
                 std::span<Vec3> positions);
/// Places all vertices of the lattice that are not inner ones, in the bind pose: poles, seam samples and corners.
void place_shared_vertices(const PreparedModel& model, std::vector<Vec3>& positions);
/// Calls `place` with every pole and the texel that holds it.
void for_each_pole(const SkeletexModel& model, const Lattice& lattice,
                   const std::function<void(VertexIndex vertex, BoneIndex bone, int end, std::size_t texel)>& place);

}  // namespace skeletex
