// SPDX-License-Identifier: MIT
#pragma once
#include <memory>
#include <span>
#include <vector>

#include "skeletex/device/context.h"
#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// Distances divided by the bounding box diagonal of mesh A. `std` is about the mean; `max` is over the points that
/// were measured, so the true maximum can be slightly larger.
struct DistanceStatistics {
  double mean = 0, std = 0, rms = 0, max = 0;
};

/// Angles between normals at points of a surface and at the points of the other one that are nearest to them, degrees.
struct AngleStatistics {
  double mean = 0, percent95 = 0, percent99 = 0;  ///< 95 and 99 percent lie below
};
struct NormalStatistics {
  AngleStatistics surface;  ///< between the triangles' normals
  AngleStatistics shading;  ///< between normals that are interpolated from corners
};

struct MetroOptions {
  /// Points spread evenly over each surface; 0: ten per vertex of the mesh with more vertices, at least 100 000.
  long samples = 0;
  /// Shading normals of A and B; without, those of vertex_normals.
  const CornerValues<Vec3>*normals_a = nullptr, *normals_b = nullptr;
};

struct MetroReport {
  double diagonal = 0;          ///< of A
  DistanceStatistics forward;   ///< from points on A's surface to B
  DistanceStatistics backward;  ///< from points on B's surface to A
  DistanceStatistics vertex;    ///< from A's vertices to B: what the paper's Figure 14 shows
  NormalStatistics forward_normals, backward_normals;
  std::vector<float> vertex_distances;  ///< per vertex of A, world units
  double seconds = 0;
};
/// The mean of both directions, as resolution studies plot it.
inline double symmetric_mean(const MetroReport& report) { return (report.forward.mean + report.backward.mean) / 2; }

/// Distances between two surfaces as the metro tool (Cignoni et al. 1998) and the paper measure them, on the device.
/// Deterministic: the points are a low-discrepancy set over each triangle, in numbers that follow its area.
/// The device finds the nearest triangles in single precision, the distances to them are then computed in double: means
/// are within 1e-9 diagonals, single distances within 2e-7 where two triangles are equally near.
/// The meshes need not be closed or manifold; triangles without area are measured to, but get no points.
/// \throw InputError when a mesh is empty or has no area, an index is out of range or a position is not finite
/// Cost: some 3 million points per second and CPU core; 100 bytes per triangle and 60 MB.
MetroReport measure_metro(ClContext& context, const TriangleMesh& a, const TriangleMesh& b,
                          const MetroOptions& options = {});

/// The mean of both directions' means, and the larger one of their maxima, over the diagonal of A.
struct SymmetricDistance {
  double mean = 0, max = 0;
};
/// A surface that others are measured against, prepared once: what measure_metro says of distances, without its normals
/// and vertices.
class SymmetricMetro {
 public:
  /// \param surface  A of measure_metro; must outlive this
  /// \param samples  points on each surface, at least 1
  /// \throw InputError as above
  SymmetricMetro(ClContext& context, const TriangleMesh& surface, long samples);
  ~SymmetricMetro();
  SymmetricMetro(const SymmetricMetro&) = delete;
  SymmetricMetro& operator=(const SymmetricMetro&) = delete;

  /// \throw InputError as above
  SymmetricDistance measure(const TriangleMesh& other);

 private:
  struct Prepared;
  ClContext& context_;
  long samples_;
  std::unique_ptr<Prepared> prepared_;
};

/// Distance from each point to the nearest point of the mesh, as exact as above, world units. The points may come in
/// any order.
/// \throw InputError as above, or when a point is not finite
std::vector<float> closest_distances(ClContext& context, const TriangleMesh& mesh, std::span<const Vec3> points);

}  // namespace skeletex
