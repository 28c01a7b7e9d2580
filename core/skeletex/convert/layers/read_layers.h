// SPDX-License-Identifier: MIT
#pragma once
#include <numbers>
#include <string>
#include <vector>

#include "skeletex/convert/layers/surface_points.h"
#include "skeletex/model/mesh_attributes.h"

namespace skeletex {

/// Which quantities of a mesh become layers of its model.
struct LayerOptions {
  bool has_normals = true, has_colours = true, has_numbers = true;
  /// Of meshes without normals of their own: edges that turn more (radians) separate, so that both sides look flat
  /// there.
  double crease_angle = std::numbers::pi;
};

struct ReadLayers {
  std::vector<Layer> layers;
  std::vector<std::string> notes;  ///< sentences on what was left out
};
/// Reads normals, colours and numbers of a mesh at the surface point of every texel.
/// \param mesh        closed, outward
/// \param attributes  of the mesh; its pictures are read, see read_materials
/// \throw DeviceError
ReadLayers read_layers(ClContext& context, const PreparedModel& model, const TriangleMesh& mesh,
                       const TriangleTree& tree, const MeshAttributes& attributes, const LayerOptions& options = {});

/// Colours of points of a mesh: vertex colour times the material's colour times its picture, which is linear between
/// pixels.
class SurfaceColours {
 public:
  /// \param mesh, attributes  must outlive this
  SurfaceColours(const TriangleMesh& mesh, const MeshAttributes& attributes);
  Colour at(const SurfacePoint& point) const;

 private:
  const TriangleMesh& mesh_;
  const MeshAttributes& attributes_;
  std::array<float, 256> linear_{};  ///< of sRGB bytes
};

}  // namespace skeletex
