// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/thin_triangles.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "skeletex/geometry/half_edge.h"
#include "skeletex/geometry/point_triangle.h"

namespace skeletex {
namespace {

using Face = OpenMesh::FaceHandle;
using HalfEdge = OpenMesh::HalfedgeHandle;
using Vertex = OpenMesh::VertexHandle;

constexpr double kThinSine2 = 0.0075961;  // 5 degrees
constexpr double kTurnCosine = 0.93969;   // 20 degrees
/// How far the surface may move. A mesh's own error shrinks with the square of its cells, h, and on this scale 15 h^2
/// adds no more than the vertices that are left out would have taken away; h / 20 bounds it for coarse meshes.
constexpr double kTolerance = 15, kLargestTolerance = 0.05;
/// What costs least goes first.
constexpr std::array<double, 3> kPasses{0.01, 0.1, 1};

/// The square of the sine of the smallest angle, which lies between the longest sides.
double least_sine2(const Vec3& a, const Vec3& b, const Vec3& c) {
  std::array<double, 3> sides{(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()};
  std::sort(sides.begin(), sides.end());
  return sides[1] > 0 ? (b - a).cross(c - a).squaredNorm() / (sides[1] * sides[2]) : 0;
}
bool is_thin(const Vec3& a, const Vec3& b, const Vec3& c) { return least_sine2(a, b, c) < kThinSine2; }

Vec3 normal_of(const Vec3& a, const Vec3& b, const Vec3& c) { return (b - a).cross(c - a).stableNormalized(); }

class ThinTriangles {
 public:
  explicit ThinTriangles(const TriangleMesh& mesh)
      : mesh_(mesh), links_(build_half_edges(mesh)), moved_(mesh.positions.size(), 0.0) {
    links_.request_vertex_status(), links_.request_edge_status(), links_.request_face_status();
  }

  ReducedMesh run(const std::vector<int>& thin) {
    const double cell = std::sqrt(surface_area(mesh_) / static_cast<double>(mesh_.positions.size())),
                 largest = std::min(kTolerance * cell / bounding_box(mesh_).diagonal(), kLargestTolerance) * cell;
    for (const double share : kPasses) {
      tolerance_ = share * largest;
      pass(thin);
    }
    return reduced();
  }

 private:
  void pass(std::vector<int> thin) {
    for (std::size_t i = 0; i < thin.size(); ++i) {
      const Face face(thin[i]);
      if (links_.status(face).deleted() || !is_face_thin(face)) continue;
      for (const Face changed : collapse_edge(face) ? faces_around(last_kept_) : flip_longest(face))
        if (is_face_thin(changed)) thin.push_back(changed.idx());
    }
  }
  const Vec3& at(Vertex vertex) const { return mesh_.positions[vertex.idx()]; }
  Vertex begin(HalfEdge edge) const { return links_.from_vertex_handle(edge); }
  Vertex end(HalfEdge edge) const { return links_.to_vertex_handle(edge); }
  /// The vertex across an edge in its triangle.
  Vertex apex(HalfEdge edge) const { return end(links_.next_halfedge_handle(edge)); }
  HalfEdge opposite(HalfEdge edge) const { return links_.opposite_halfedge_handle(edge); }
  bool is_face_thin(Face face) const {
    const HalfEdge edge = links_.halfedge_handle(face);
    return is_thin(at(begin(edge)), at(end(edge)), at(apex(edge)));
  }
  std::vector<Face> faces_around(Vertex vertex) const {
    std::vector<Face> faces;
    for (const Face face : links_.vf_range(vertex)) faces.push_back(face);
    return faces;
  }
  std::array<HalfEdge, 3> edges_of(Face face) const {
    const HalfEdge first = links_.halfedge_handle(face), second = links_.next_halfedge_handle(first);
    return {first, second, links_.next_halfedge_handle(second)};
  }

  /// How far the surface moves when an edge is collapsed into its second vertex, in the middles of the edges around,
  /// old and new, added to what it has moved before; none when the edge may not be collapsed.
  std::optional<double> collapse_distance(HalfEdge edge) {
    const Vec3 &from = at(begin(edge)), &to = at(end(edge));
    int thin_before = 0, thin_after = 0;
    double least_before = 1, least_after = 1;
    fan_.clear();
    for (const HalfEdge spoke : links_.voh_range(begin(edge))) {
      const Vec3 &b = at(end(spoke)), &c = at(apex(spoke));
      fan_.push_back({b, c});
      const double before = least_sine2(from, b, c);
      thin_before += static_cast<int>(before < kThinSine2);
      least_before = std::min(least_before, before);
      if (spoke == edge || apex(spoke) == end(edge)) continue;
      const double after = least_sine2(to, b, c);
      thin_after += static_cast<int>(after < kThinSine2);
      least_after = std::min(least_after, after);
      if (normal_of(from, b, c).dot(normal_of(to, b, c)) < (before < kThinSine2 ? 0 : kTurnCosine)) return {};
    }
    const bool is_better = thin_after < thin_before && least_after >= std::min(least_before, kThinSine2);
    if (!is_better || !has_room(apex(edge)) || !has_room(apex(opposite(edge))) || !links_.is_collapse_ok(edge))
      return {};
    double distance = distance_from_fan(from, to);
    for (const auto& [b, c] : fan_)
      distance = std::max({distance, distance_from_fan(0.5 * (from + b), to), distance_from_fan(0.5 * (to + b), from)});
    distance += moved_[begin(edge).idx()];
    if (!(distance <= tolerance_)) return {};
    return distance;
  }
  /// The distance of a point from the triangles or segments between a point and the sides of `fan_`.
  double distance_from_fan(const Vec3& point, const Vec3& centre) const {
    double least2 = std::numeric_limits<double>::infinity();
    for (const auto& [b, c] : fan_) least2 = std::min(least2, offset_from_triangle(point, centre, b, c).squaredNorm());
    return std::sqrt(least2);
  }
  /// Whether a vertex can lose an edge.
  bool has_room(Vertex vertex) const { return links_.valence(vertex) > 3; }

  /// Collapses the edge of a triangle that costs least; false where none may be collapsed.
  bool collapse_edge(Face face) {
    std::optional<double> least;
    HalfEdge best;
    for (const HalfEdge side : edges_of(face))
      for (const HalfEdge edge : {side, opposite(side)})
        if (const std::optional<double> distance = collapse_distance(edge); distance && (!least || *distance < *least))
          least = distance, best = edge;
    if (!least) return false;
    last_kept_ = end(best);
    double& moved = moved_[last_kept_.idx()];
    moved = std::max(moved, *least);
    links_.collapse(best);
    return true;
  }

  /// Flips a triangle's longest edge where the vertex across lies on it; gives the triangles that have changed.
  std::vector<Face> flip_longest(Face face) {
    HalfEdge edge;
    double longest2 = 0;
    for (const HalfEdge side : edges_of(face)) {
      const double length2 = (at(end(side)) - at(begin(side))).squaredNorm();
      if (length2 > longest2) longest2 = length2, edge = side;
    }
    if (!edge.is_valid() || !has_room(begin(edge)) || !has_room(end(edge)) ||
        !links_.is_flip_ok(links_.edge_handle(edge)))
      return {};
    const Face other = links_.face_handle(opposite(edge));
    const Vec3 &a = at(begin(edge)), &b = at(apex(edge)), &c = at(end(edge)), &d = at(apex(opposite(edge)));
    const Vec3 normal = normal_of(a, d, c), across = (c - a).cross(d - b).stableNormalized();
    const bool is_other_thin = is_thin(a, d, c);
    const int before = 1 + static_cast<int>(is_other_thin),
              after = static_cast<int>(is_thin(a, d, b)) + static_cast<int>(is_thin(d, c, b));
    const double turn = is_other_thin ? 0 : kTurnCosine;
    if (after >= before || !(std::abs((b - a).dot(across)) <= tolerance_) || normal.dot(normal_of(a, d, b)) < turn ||
        normal.dot(normal_of(d, c, b)) < turn)
      return {};
    links_.flip(links_.edge_handle(edge));
    return {face, other};
  }

  ReducedMesh reduced() const {
    ReducedMesh result;
    std::vector<int> numbers(mesh_.positions.size(), -1);
    for (const Vertex vertex : links_.all_vertices()) {
      if (links_.status(vertex).deleted()) continue;
      numbers[vertex.idx()] = static_cast<int>(result.vertices.size());
      result.vertices.push_back(vertex.idx());
    }
    for (const Face face : links_.all_faces()) {
      if (links_.status(face).deleted()) continue;
      const HalfEdge edge = links_.halfedge_handle(face);
      result.triangles.push_back({numbers[begin(edge).idx()], numbers[end(edge).idx()], numbers[apex(edge).idx()]});
    }
    return result;
  }

  const TriangleMesh& mesh_;
  HalfEdgeMesh links_;
  double tolerance_ = 0;                  ///< of the pass
  std::vector<double> moved_;             ///< per vertex how far those that went into it lie from the surface at most
  std::vector<std::array<Vec3, 2>> fan_;  ///< the sides across of the triangles around a vertex
  Vertex last_kept_;
};

}  // namespace

std::vector<int> thin_triangles(const TriangleMesh& mesh) {
  std::vector<int> thin;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const auto [a, b, c] = mesh.triangles[i];
    if (is_thin(mesh.positions[a], mesh.positions[b], mesh.positions[c])) thin.push_back(static_cast<int>(i));
  }
  return thin;
}

ReducedMesh without_thin_triangles(const TriangleMesh& mesh) { return ThinTriangles(mesh).run(thin_triangles(mesh)); }

}  // namespace skeletex
