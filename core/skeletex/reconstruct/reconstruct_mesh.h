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

/// A mesh from a model, in its bind pose, at the model's own resolution (paper 3.6). Closed, oriented, 2-manifold and
/// of the input's genus by construction: inner rows are vertices of their own, seams and corners are shared polylines
/// that both sides fill up to, poles are single vertices. Quads take diagonals by the model's rule.
/// \throw DeviceError
TriangleMesh reconstruct_mesh(ClContext& context, const SkeletexModel& model);

/// The vertices of that mesh alone, in the order of lattice.h. \throw DeviceError
std::vector<Vec3> lattice_positions(ClContext& context, const SkeletexModel& model);
/// Its triangles that touch a pole or a seam: fans and strips. \param positions  of all vertices of the lattice
std::vector<Triangle> end_triangles(const SkeletexModel& model, const Lattice& lattice,
                                    const std::vector<Vec3>& positions);

/// The seam of an end, and its turns as strips take them; empty at a pole. \param positions  at least of seams
struct EndSeam {
  Ring ring;
  std::vector<double> turns;
};
EndSeam end_seam(const SkeletexModel& model, const SeparationPlanes& separation, const Lattice& lattice,
                 std::span<const Vec3> positions, int bone, BoneEnd end);
/// The triangles of one end, appended.
void append_end_triangles(const SkeletexModel& model, const Lattice& lattice, std::span<const Vec3> positions,
                          const EndSeam& seam, int bone, BoneEnd end, std::vector<Triangle>& triangles);
/// Seam samples and corners: few, and shared by several patches, so they are made on the host in double.
void place_seams(const SkeletexModel& model, const SeparationPlanes& separation, const Lattice& lattice,
                 std::span<Vec3> positions);
/// All vertices of the lattice that are not inner ones, in the bind pose: poles, seam samples and corners.
void place_shared_vertices(const SkeletexModel& model, const SeparationPlanes& separation, const Lattice& lattice,
                           std::vector<Vec3>& positions);
/// The inner vertices in the bind pose, relative to the model's origin.
DevicePlanes displace_inner(ClContext& context, const SkeletexModel& model, const SeparationPlanes& separation,
                            const Lattice& lattice);
/// Every pole, and the texel that holds it.
void for_each_pole(const SkeletexModel& model, const Lattice& lattice,
                   const std::function<void(int vertex, int bone, int end, std::size_t texel)>& place);

/// The quads between inner rows on the device: their rows, and the patches.
struct DeviceQuads {
  ClBuffer<LatticeRow> rows;  ///< those that quads begin at
  ClBuffer<PatchRecord> patches;
};
DeviceQuads upload_quads(ClContext& context, const SkeletexModel& model, const SeparationPlanes& separation);
/// Queues their triangles (one launch), behind which there is room for those at the ends.
ClBuffer<Triangle> triangulate(ClContext& context, DiagonalRule rule, const DeviceQuads& quads, const Lattice& lattice,
                               const DevicePlanes& inner);

/// The same model with rectangles scaled to another texture size (longer side `size`, at least 4 x 4 each): texels are
/// resampled as bind-pose positions, averaged where the lattice gets coarser, seams are kept and resampled.
/// \throw InputError when the size is too small for the number of bones
SkeletexModel resample_model(ClContext& context, const SkeletexModel& model, int size);

}  // namespace skeletex
