// SPDX-License-Identifier: MIT
#include "skeletex/convert/segment/separation_network.h"

#include <algorithm>
#include <limits>
#include <numeric>

namespace skeletex {

SeparationNetwork::SeparationNetwork(const CutMesh& mesh, const NodeCells& node,
                                     const std::vector<std::uint8_t>& labels)
    : mesh_(mesh), node_(node), labels_(labels) {
  for (auto& values : corner_values_) values.resize(node_.cells.size());
  for (int t = 0; t < mesh.triangle_count(); ++t) {
    const std::uint8_t a = labels_[mesh_.origins[3 * t]];
    if (a == labels_[mesh_.origins[3 * t + 1]] && a == labels_[mesh_.origins[3 * t + 2]]) continue;
    MixedTriangle mixed;
    mixed.triangle = t;
    divide(mixed);
    triangles.push_back(mixed);
  }
}

int SeparationNetwork::edge_slot(int half_edge) {
  const int canonical = std::min(half_edge, mesh_.opposites[half_edge]);
  const auto [found, is_new] = edge_of_.try_emplace(canonical, static_cast<int>(edges.size()));
  if (is_new) edges.push_back({canonical, mesh_.opposites[canonical], static_cast<int>(points.size()), 0, {-1, -1}});
  return found->second;
}

DividedEdge& SeparationNetwork::edge(int half_edge) { return edges[edge_slot(half_edge)]; }

/// Upper envelope of the cells' values along an edge, from one end's cell to the other's. Each step goes to a cell that
/// is larger at the far end, so that it ends there whatever rounding does.
void SeparationNetwork::find_edge_points(DividedEdge& divided) {
  const int a = mesh_.origins[divided.half_edge], b = mesh_.target(divided.half_edge);
  const int last = labels_[b];
  const int count = static_cast<int>(node_.cells.size());
  divided.first_point = static_cast<int>(points.size());
  double t = 0;
  for (int cell = labels_[a]; cell != last;) {
    const double from_a = value(cell, a), from_b = value(cell, b);
    int next = last;
    double next_t = 2, next_b = -std::numeric_limits<double>::infinity();
    for (int c = 0; c < count; ++c) {
      const double to_b = value(c, b);
      if (c == cell || (c != last && !(to_b > from_b))) continue;
      const double lead_a = from_a - value(c, a), lead_b = to_b - from_b;
      const double crossing = lead_a > 0 && lead_a + lead_b > 0 ? std::clamp(lead_a / (lead_a + lead_b), t, 1.0) : t;
      if (crossing < next_t || (crossing == next_t && to_b > next_b)) {
        next = c;
        next_t = crossing;
        next_b = to_b;
      }
    }
    t = next_t;
    NetworkPoint point;
    point.position = mesh_.positions[a] + t * (mesh_.positions[b] - mesh_.positions[a]);
    point.cells = {cell, next, -1};
    point.weights[0] = t;
    points.push_back(point);
    components_.add();
    ++divided.point_count;
    cell = next;
  }
}

/// Barycentric weights of a point in one of the triangles that it lies in.
Barycentric SeparationNetwork::weights_in(int point, TriangleIndex triangle) const {
  const NetworkPoint& p = points[point];
  if (p.triangle >= 0) return p.weights;
  for (int c = 0; c < 3; ++c) {
    const int h = 3 * triangle + c;
    const auto found = edge_of_.find(std::min(h, mesh_.opposites[h]));
    if (found == edge_of_.end()) continue;
    const DividedEdge& divided = edges[found->second];
    if (point < divided.first_point || point >= divided.first_point + divided.point_count) continue;
    const double t = h == divided.half_edge ? p.weights[0] : 1 - p.weights[0];
    Barycentric w{};
    w[c] = 1 - t;
    w[(c + 1) % 3] = t;
    return w;
  }
  return {};
}

SeparationNetwork::Ring SeparationNetwork::Ring::part(int begin, int end, int closing_point) const {
  Ring result;
  for (int s = begin;; s = (s + 1) % size()) {
    result.cells.push_back(cells[s]);
    result.regions.push_back(regions[s]);
    result.points.push_back(s == end ? closing_point : points[s]);
    if (s == end) return result;
  }
}

/// The separation plane between the first two regions of a ring, from its first point on.
void SeparationNetwork::add_piece(const Ring& ring, int to, MixedTriangle& triangle) {
  const int from = ring.points[0];
  pieces.push_back({{from, to}, {ring.regions[0], ring.regions[1]}, {ring.cells[0], ring.cells[1]}});
  ++triangle.piece_count;
  components_.unite(from, to);
}

/// A cell is convex: where it comes twice it is one region.
/// \return whether one does
bool SeparationNetwork::split_at_repeated_cell(const Ring& ring, MixedTriangle& triangle) {
  const int size = ring.size();
  for (int p = 0; p < size; ++p)
    for (int q = p + 1; q < size; ++q) {
      if (ring.cells[p] != ring.cells[q]) continue;
      if (ring.regions[p] != ring.regions[q]) {
        merges.push_back({ring.regions[p], ring.regions[q]});
        ++triangle.merge_count;
      }
      const int before = (p + size - 1) % size;
      resolve(ring.part(p, q - 1, ring.points[q - 1]), triangle);
      resolve(ring.part(q, before, ring.points[before]), triangle);
      return true;
    }
  return false;
}

/// Where a third cell takes over first along the separation plane between the first two cells of a ring.
NetworkPoint SeparationNetwork::end_of_first_plane(const Ring& ring, TriangleIndex triangle) const {
  const int i = ring.cells[0], j = ring.cells[1];
  const Barycentric start = weights_in(ring.points[0], triangle);
  Barycentric slope_ij;
  for (int c = 0; c < 3; ++c) slope_ij[c] = corner_values_[c][i] - corner_values_[c][j];
  // Along g_i = g_j, with i on the left.
  const Barycentric along{slope_ij[1] - slope_ij[2], slope_ij[2] - slope_ij[0], slope_ij[0] - slope_ij[1]};
  int third = -1;
  double nearest = std::numeric_limits<double>::infinity();
  for (int l = 0; l < static_cast<int>(node_.cells.size()); ++l) {
    if (l == i || l == j) continue;
    double lag = 0, slope = 0;
    for (int c = 0; c < 3; ++c) {
      const double gain = corner_values_[c][l] - corner_values_[c][i];
      lag -= start[c] * gain;
      slope += along[c] * gain;
    }
    if (!(slope > 0)) continue;
    const double distance = std::max(lag, 0.0) / slope;
    if (distance < nearest) {
      nearest = distance;
      third = l;
    }
  }
  if (third < 0) {
    third = ring.cells[2];
    nearest = 0;
  }
  NetworkPoint corner;
  corner.triangle = triangle;
  corner.cells = {i, j, third};
  double sum = 0;
  for (int c = 0; c < 3; ++c) sum += corner.weights[c] = std::clamp(start[c] + nearest * along[c], 0.0, 1.0);
  corner.position = Vec3::Zero();
  for (int c = 0; c < 3; ++c) {
    corner.weights[c] /= sum;
    corner.position += corner.weights[c] * mesh_.positions[mesh_.origins[3 * triangle + c]];
  }
  return corner;
}

/// Finds the separation planes inside a part of a triangle from the cells around it: the plane from one point of the
/// ring ends where a third cell takes over first, which divides the ring in two.
void SeparationNetwork::resolve(Ring ring, MixedTriangle& triangle) {
  while (ring.size() > 2) {
    if (split_at_repeated_cell(ring, triangle)) return;
    const NetworkPoint corner = end_of_first_plane(ring, triangle.triangle);
    const int point = components_.add(), third = corner.cells[2];
    points.push_back(corner);
    add_piece(ring, point, triangle);
    const auto place = std::find(ring.cells.begin() + 2, ring.cells.end(), third);
    if (place != ring.cells.end()) {
      const int p = static_cast<int>(place - ring.cells.begin());
      resolve(ring.part(1, p, point), triangle);
      ring = ring.part(p, 0, point);
    } else {  // a cell that lies inside the triangle altogether
      ring.points[0] = point;
      ring.cells.insert(ring.cells.begin() + 1, third);
      ring.regions.insert(ring.regions.begin() + 1, triangle.region_count++);
      ring.points.insert(ring.points.begin() + 1, point);
    }
  }
  if (ring.size() == 2) add_piece(ring, ring.points[1], triangle);
}

void SeparationNetwork::divide(MixedTriangle& triangle) {
  triangle.first_piece = static_cast<int>(pieces.size());
  triangle.first_merge = static_cast<int>(merges.size());
  Ring ring;
  int cell = labels_[mesh_.origins[3 * triangle.triangle]];
  for (int c = 0; c < 3; ++c) {
    const int h = 3 * triangle.triangle + c;
    if (labels_[mesh_.origins[h]] == labels_[mesh_.target(h)]) continue;
    DividedEdge& divided = edge(h);
    if (divided.point_count == 0) find_edge_points(divided);
    const bool is_forward = divided.half_edge == h;
    for (int k = 0; k < divided.point_count; ++k) {
      const int point = divided.first_point + (is_forward ? k : divided.point_count - 1 - k);
      ring.cells.push_back(cell);
      ring.points.push_back(point);
      cell = points[point].cells[is_forward ? 1 : 0];
    }
  }
  triangle.region_count = ring.size();
  ring.regions.resize(ring.cells.size());
  std::iota(ring.regions.begin(), ring.regions.end(), 0);
  if (ring.size() > 2)
    for (int c = 0; c < 3; ++c)
      for (std::size_t l = 0; l < node_.cells.size(); ++l)
        corner_values_[c][l] = value(static_cast<int>(l), mesh_.origins[3 * triangle.triangle + c]);
  resolve(std::move(ring), triangle);
}

}  // namespace skeletex
