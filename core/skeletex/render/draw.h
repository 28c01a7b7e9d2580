// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <optional>
#include <span>
#include <vector>

#include "skeletex/io/mesh_file.h"
#include "skeletex/render/camera.h"
#include "skeletex/render/gpu_surface.h"
#include "skeletex/render/image.h"

namespace skeletex {

/// What colours a surface.
enum class Paint { kUniform = 0, kFace = 1, kVertex = 2, kChecker = 3, kNormal = 4, kCorner = 5 };

struct SurfacePaint {
  Paint paint = Paint::kUniform;
  LinearRgb base{0.52f, 0.495f, 0.465f};
  GlBuffer colours;    ///< kFace, kVertex, kCorner: sRGB bytes r, g, b, 255 per face, vertex or triangle corner
  GlBuffer corner_uv;  ///< kChecker: (u, v) of each triangle corner in cells of the checker, two floats each; kCorner:
                       ///< texture coordinates
  /// kCorner: the picture of each triangle, which multiplies its colours, -1: none; per picture its first pixel, width
  /// and height; pixels as those of ColourImage
  GlBuffer triangle_pictures, pictures, pixels;
};

struct DrawOptions {
  int width = 1200, height = 900;
  int samples = 2;         ///< per pixel and direction: samples^2 are averaged
  bool is_flat = false;    ///< a normal per triangle instead of per vertex
  double wire_pixels = 0;  ///< half the width of drawn edges, 0: none
  double lighting = 1;     ///< 1: light and shadow in full, 0: colours as they are
  int sky_lights = 40;     ///< directions that make up the soft light from above; each costs a depth map
};

/// Draws a surface, smooth or flat. A key light shines from the upper left, and a sky from many directions, each with
/// its shadows, so that folds and contacts are dark. The background stays clear.
/// \throw DeviceError
Image draw(GlContext& context, const GpuSurface& surface, const SurfacePaint& paint, const Camera& camera,
           const DrawOptions& options);

/// Bytes r, g, b, 255 as SurfacePaint takes them.
GlBuffer upload_colours(std::span<const VertexColour> colours);
/// Paint of a mesh's colours, materials and pictures.
/// \pre all attributes are by vertex, see split_vertices
SurfacePaint colour_paint(const TriangleMesh& mesh, const MeshAttributes& attributes);

}  // namespace skeletex
