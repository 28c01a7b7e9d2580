// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <numbers>
#include <span>
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

/// Whether there will be a layer.
bool has_layers(const MeshAttributes& attributes, const LayerOptions& options);

/// The attributes of a mesh at points of it, numbered as the points: unit normals, colours and numbers.
/// \param mesh  closed, outward
/// \param attributes  its pictures are read, see read_materials
MeshAttributes attributes_at(const TriangleMesh& mesh, const MeshAttributes& attributes,
                             std::span<const SurfacePoint> points, const LayerOptions& options = {});

struct ReadLayers {
  std::vector<Layer> layers;
  std::vector<std::string> notes;  ///< sentences on what was left out
};
/// Reads normals, colours and numbers of a mesh at the surface point of every texel.
/// \param mesh  closed, outward
/// \param attributes  of the mesh; its pictures are read, see read_materials. Those of the original come first
/// \throw DeviceError
ReadLayers read_layers(ClContext& context, const PreparedModel& model, const TriangleMesh& mesh,
                       const TriangleTree& tree, const MeshAttributes& attributes, const LayerOptions& options = {});

/// The layers of a model at the texels of another one whose surface is nearly the same.
std::vector<Layer> read_layers_of(ClContext& context, const PreparedModel& from, const PreparedModel& to);

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
