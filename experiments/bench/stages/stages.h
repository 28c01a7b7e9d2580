// SPDX-License-Identifier: MIT
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "inputs.h"
#include "skeletex/reconstruct/pose/pose_mesh.h"
#include "skeletex/skeleton/pose.h"
#include "stage.h"

/// The pipeline's stages, each beside what a user would take instead, or beside what no program can undercut.
namespace skeletex {

/// Their names, in the order of a report.
inline const std::vector<std::string> kStageNames{"reconstruct", "pose",  "morph",   "transfer", "filter", "vsm",
                                                  "spd_rays",    "metro", "segment", "encode",   "snap"};

// On textures; against a device copy of as many bytes. Frames end with all vertices of the lattice on the device.

/// The bind pose's vertices.
Stage reconstruct_stage(ClContext& context, TextureInputPointer input);
/// Those of a pose; what is made once per pose is included, what is made once per model is not.
/// \param pose  default: the skeleton bent by 40 degrees over its longest axis
/// \param deformation  kSmooth or kPaper, else InputError
Stage pose_stage(ClContext& context, TextureInputPointer input, const std::optional<Pose>& pose = {},
                 Deformation deformation = Deformation::kSmooth);
/// A live morph: another weight every time, texels blended, and the vertices of the model in between.
Stage morph_stage(ClContext& context, TextureInputPointer first, TextureInputPointer second);
/// The largest bone with a free end is taken from the source.
Stage transfer_stage(ClContext& context, TextureInputPointer source, TextureInputPointer target);
/// Smoothing at the default scale; the copy is made once per step of the solver.
Stage filter_stage(ClContext& context, TextureInputPointer input);

// On meshes; against other libraries.

/// Charts to maps by the default recipe; against Eigen's SimplicialLDLT on systems of the same pattern and number, one
/// pattern analysis per chart.
/// \param threads  of the reference: 1, or 0 for all processors
Stage vsm_stage(ClContext& context, MeshInputPointer input, int threads = 0);
/// The rays of all texels; against Embree's packets of eight coherent rays on all processors, with its trees.
Stage spd_rays_stage(ClContext& context, MeshInputPointer input, int size);
/// Closest points of 16 points per triangle, in the order of a Hilbert curve; against Embree's point queries on all
/// processors.
/// \param noise_rel_diag  how far the points lie from the surface
Stage metro_stage(ClContext& context, MeshInputPointer input, double noise_rel_diag = 1e-3);
/// Half edges and cuts; against OpenMesh taking in the same faces.
Stage segment_stage(ClContext& context, MeshInputPointer input);
/// The command `skeletex encode`, process and files included; against OpenMesh reading the mesh file and OpenEXR
/// writing as many texels.
/// \param program  skeletex
/// \param device  selector for it
Stage encode_stage(MeshInputPointer input, int size, const std::string& program, const std::string& device = "");
/// What snapping and fit, as they are by default, add to that command's encoding; against its whole parameterization.
/// Parameters as above.
Stage snap_stage(MeshInputPointer input, int size, const std::string& program, const std::string& device = "");

}  // namespace skeletex
