// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/convert/sample/device_maps.h"
#include "skeletex/convert/snap/lattice_mesh.h"
#include "skeletex/model/texture.h"

namespace skeletex {

/// A vertex of the original inside a map.
struct PlacedVertex {
  int patch, point;  ///< its number among the vertices of DeviceMaps
  float x, y;        ///< in the cells of the patch
  int texel;         ///< whose quad it is measured around
};
/// By lines of the texture.
struct PlacedVertices {
  std::vector<PlacedVertex> all;
  std::vector<int> first_of_line;  ///< and the end
};
/// The inner vertices of VSM patches' charts, numbered as in DeviceMaps.
/// \param texture_width, texture_height  texels
PlacedVertices place_vertices(std::span<const Chart> charts, std::span<const Patch> patches, int texture_width,
                              int texture_height);

/// How far the original's vertices are from a lattice, measured again where that has changed. Found among the quads
/// around their places in the map (guard.cl); what looks too far next to seams and poles is compared to the strips and
/// fans there.
class VertexDistances {
 public:
  /// All that is given by reference must outlive this.
  VertexDistances(const SkeletexModel& model, std::span<const Chart> charts, const DeviceLayout& layout,
                  const DeviceMaps& maps, const PlacedVertices& placed);

  /// Lists the vertices that no texel sits on, for `start`.
  /// \param vertex_points  of the features' vertices, see SnapFeatures
  /// \param anchors        per texel, see ReadingPositions
  void list(std::span<const int> vertex_points, std::vector<int> anchors);
  /// After a move: those near texels that have gone back.
  void list(std::span<const int> vertex_points, const LatticeMesh& lattice, const std::vector<int>& back);
  /// Queues the measuring of those that are listed; what the host does next comes beside it.
  void start(ClContext& context, const LatticeMesh& lattice, float limit);
  /// \param context  the same
  /// \param changed  triangles since the call before
  /// \return of vertices that are further than the limit, the triangles that they are nearest to
  std::vector<int> take_far(ClContext& context, const LatticeMesh& lattice, const std::vector<int>& changed,
                            float limit);
  /// What holds texels, but for those that have gone back since the last call of `list`.
  std::vector<int> take_anchors() { return std::move(anchors_); }

 private:
  /// As it was measured last, to the quads around it.
  struct MeasuredVertex {
    float distance2 = 0;
    int nearest = -1;
    bool is_far = false;
    bool is_compared = false;  ///< to strips and fans as well
    int nearer = -1;           ///< then the triangle that it is nearest to, -1 if it is not far
  };
  std::vector<int> triangles_at_far(const LatticeMesh& lattice, const std::vector<int>& changed, float limit);
  void compare_to_ends(const LatticeMesh& lattice, const std::vector<int>& asked, float limit);
  void add_around(const LatticeMesh& lattice, int texel);

  const SkeletexModel& model_;
  std::span<const Chart> charts_;
  const DeviceLayout& layout_;
  const DeviceMaps& maps_;
  const PlacedVertices& placed_;
  std::vector<MeasuredVertex> vertices_;  // as placed_
  std::vector<int> asked_;                // of these
  ClBuffer<float> device_distances_;      // of those asked
  ClBuffer<int> device_nearest_;
  std::vector<int> far_;                         // of placed_
  std::vector<int> anchors_;                     // per texel
  std::vector<char> is_held_;                    // vertices of the maps that a texel sits on
  std::vector<char> are_near_, are_lines_near_;  // texels, and lines of the texture that have some
};

}  // namespace skeletex
