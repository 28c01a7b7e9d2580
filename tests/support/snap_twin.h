// SPDX-License-Identifier: MIT
#pragma once
#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "skeletex/convert/snap/snap.h"

namespace skeletex::twin {

/// The reading positions of one patch, as snap_positions makes them: the kernels' steps one texel after the other.
struct SnapLattice {
  int width = 0, height = 0;
  std::vector<double> x, y;  ///< offsets, row by row
  std::vector<int> anchors;

  SnapLattice(int columns, int rows)
      : width(columns), height(rows), x(columns * rows, 0), y(columns * rows, 0), anchors(columns * rows, 0) {}
  int at(int column, int row) const { return row * width + (column % width + width) % width; }

  /// Smallest cross product at the corners of the quad to the right of and above a texel.
  double quad_cross(int column, int row) const {
    constexpr int kRight[4] = {0, 1, 1, 0}, kUp[4] = {0, 0, 1, 1};
    double px[4], py[4], least = 1e300;
    for (int i = 0; i < 4; ++i) {
      const int texel = at(column + kRight[i], row + kUp[i]);
      px[i] = kRight[i] + x[texel], py[i] = kUp[i] + y[texel];
    }
    for (int i = 0; i < 4; ++i) {
      const int before = (i + 3) % 4, after = (i + 1) % 4;
      least = std::min(least, (px[after] - px[i]) * (py[before] - py[i]) - (py[after] - py[i]) * (px[before] - px[i]));
    }
    return least;
  }
  /// Moves a texel unless that folds the map or takes it too near to an end.
  bool move(int column, int row, double dx, double dy) {
    if (row + dy < 0.6 || row + dy > height - 1 - 0.6) return false;
    const int texel = at(column, row);
    const double old_x = x[texel], old_y = y[texel];
    x[texel] = dx, y[texel] = dy;
    double least = 1e300;
    for (const int i : {-1, 0})
      for (const int j : {-1, 0}) least = std::min(least, quad_cross(column + j, row + i));
    if (least >= 0.05) return true;
    x[texel] = old_x, y[texel] = old_y;
    return false;
  }
  int colour(int column, int row) const { return 3 * (row % 2) + (width % 2 && column == width - 1 ? 2 : column % 2); }

  void snap_to_vertices(const std::vector<SnapFeatures::Vertex>& vertices) {
    struct Candidate {
      double distance;
      int column, row;
    };
    const int count = static_cast<int>(vertices.size());
    std::vector<int> rank, state(count, 0);
    for (const SnapFeatures::Vertex& vertex : vertices) rank.push_back(vertex.rank);
    const auto candidates = [&](int v) {
      std::vector<Candidate> found;
      const double bx = std::floor(vertices[v].x), by = std::floor(vertices[v].y);
      for (int i = 0; i < 2; ++i)
        for (int j = 0; j < 2; ++j)
          found.push_back({std::hypot(vertices[v].x - bx - j, vertices[v].y - by - i), static_cast<int>(bx) + j,
                           static_cast<int>(by) + i});
      std::stable_sort(found.begin(), found.end(),
                       [](const Candidate& a, const Candidate& b) { return a.distance < b.distance; });
      return found;
    };
    for (bool is_open = true; is_open;) {
      is_open = false;
      std::map<int, int> reservations;
      for (int v = 0; v < count; ++v)
        for (; state[v] < 4; ++state[v]) {
          const Candidate c = candidates(v)[state[v]];
          if (c.row < 1 || c.row > height - 2 || c.distance > 0.7 || anchors[at(c.column, c.row)] != 0) continue;
          reservations[at(c.column, c.row)] = std::max(reservations[at(c.column, c.row)], rank[v]);
          break;
        }
      for (int v = 0; v < count; ++v) {
        if (state[v] >= 4) continue;
        const Candidate c = candidates(v)[state[v]];
        bool is_strongest = true;
        for (int i = -1; i <= 1; ++i)
          for (int j = -1; j <= 1; ++j) {
            const auto reservation = reservations.find(at(c.column + j, c.row + i));
            is_strongest = is_strongest && (reservation == reservations.end() || reservation->second <= rank[v]);
          }
        if (is_strongest && move(c.column, c.row, vertices[v].x - c.column, vertices[v].y - c.row)) {
          anchors[at(c.column, c.row)] = 1 + v;
          state[v] = 5;
          continue;
        }
        state[v] += is_strongest;
        is_open = is_open || state[v] < 4;
      }
    }
  }

  /// \param first  row of those that are looked at, of every other one
  void relax(int first) {
    for (int c = 0; c < 6; ++c)
      for (int row = first; row + 1 < height; row += 2)
        for (int j = 0; j < width; ++j) {
          const int texel = at(j, row);
          if (anchors[texel] != 0 || colour(j, row) != c) continue;
          const int around[4] = {at(j - 1, row), at(j + 1, row), at(j, row - 1), at(j, row + 1)};
          double mean_x = 0, mean_y = 0;
          for (const int n : around) mean_x += x[n] / 4, mean_y += y[n] / 4;
          const double dx = (x[texel] + mean_x) / 2, dy = (y[texel] + mean_y) / 2;
          if (std::abs(dx - x[texel]) + std::abs(dy - y[texel]) >= 0.01 && std::max(std::abs(dx), std::abs(dy)) <= 0.5)
            move(j, row, dx, dy);
        }
  }

  /// \param first   as above
  /// \param chosen  in and out, per texel: what it chooses; the time before, -1 there for none
  void snap_to_edges(int first, const std::vector<SnapFeatures::Edge>& edges, bool is_again, std::vector<int>& chosen) {
    // The second time only bins of eight columns where a texel could not go to its edge, and that is not flat.
    const std::vector<int> before = chosen;
    const auto is_looked_at = [&](int column, int row) {
      const int first_column = column / 8 * 8;
      if (!is_again || first_column + 8 > width) return true;
      for (int j = first_column; j < first_column + 8; ++j)
        if (anchors[at(j, row)] == 0 && before[at(j, row)] >= 0) return true;
      return false;
    };
    const auto nearest = [&](const SnapFeatures::Edge& edge, int column, int row, double& dx, double& dy) {
      double best = 1e300;
      for (int turn = -2; turn <= 2; ++turn) {
        const double px = column + x[at(column, row)] + turn * width, py = row + y[at(column, row)];
        const double ex = edge.x[1] - edge.x[0], ey = edge.y[1] - edge.y[0];
        const double t = std::clamp(((px - edge.x[0]) * ex + (py - edge.y[0]) * ey) / (ex * ex + ey * ey), 0.0, 1.0);
        const double gx = edge.x[0] + t * ex - px, gy = edge.y[0] + t * ey - py;
        if (std::hypot(gx, gy) >= best) continue;
        best = std::hypot(gx, gy);
        dx = gx + x[at(column, row)], dy = gy + y[at(column, row)];
      }
      return best;
    };
    for (int row = first; row + 1 < height; row += 2)
      for (int j = 0; j < width; ++j) {
        chosen[at(j, row)] = -1;
        if (anchors[at(j, row)] != 0 || !is_looked_at(j, row)) continue;
        long best = 1L << 40;
        for (int e = 0; e < static_cast<int>(edges.size()); ++e) {
          double dx = 0, dy = 0;
          const double distance = nearest(edges[e], j, row, dx, dy);
          const long cost = std::lround(65536 * distance / std::sqrt(std::min(1.0, edges[e].dihedral / 0.5)));
          if (distance <= 0.7 && cost < best) best = cost, chosen[at(j, row)] = e;
        }
      }
    for (int c = 0; c < 6; ++c)
      for (int row = first; row + 1 < height; row += 2)
        for (int j = 0; j < width; ++j) {
          const int e = chosen[at(j, row)];
          if (e < 0 || colour(j, row) != c) continue;
          double dx = 0, dy = 0;
          nearest(edges[e], j, row, dx, dy);
          if (std::abs(dx) <= 1 && std::abs(dy) <= 1 && move(j, row, dx, dy))
            anchors[at(j, row)] = -1 - e;
          else if (edges[e].dihedral < 0.1)
            chosen[at(j, row)] = -1;
        }
  }

  void snap(const SnapFeatures& features) {
    snap_to_vertices(features.vertices);
    std::vector<int> chosen(x.size(), -1);
    for (const bool is_again : {false, true})
      for (const int first : {2, 1}) {
        relax(first);
        snap_to_edges(first, features.edges, is_again, chosen);
      }
  }
};

}  // namespace skeletex::twin
