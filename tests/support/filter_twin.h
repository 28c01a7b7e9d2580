// SPDX-License-Identifier: MIT
#pragma once
#include <Eigen/Geometry>
#include <Eigen/Sparse>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "skeletex/reconstruct/lattice.h"

namespace skeletex::twin {

/// A triangle and how much of it counts.
struct SharedTriangle {
  Triangle corners;
  double share = 1;
};

/// What the kernels of filter.cl and diffusion.cl take for the surface, as one list: both triangulations of every quad
/// between inner rows, half each, and the triangles at the ends.
inline std::vector<SharedTriangle> surface_triangles(const SkeletexModel& model, const Lattice& lattice,
                                                     std::span<const Triangle> end_triangles) {
  std::vector<SharedTriangle> triangles;
  for (std::size_t bone = 0; bone < model.patches.size(); ++bone) {
    const auto [x, y, width, height] = model.patches[bone].rectangle;
    for (int row = 0; row + 3 < height; ++row)
      for (int j = 0; j < width; ++j) {
        const int a = lattice.first_inner[bone] + row * width + j,
                  b = lattice.first_inner[bone] + row * width + (j + 1) % width;
        const int c = b + width, d = a + width;
        for (const Triangle& t : {Triangle{a, b, c}, Triangle{a, c, d}, Triangle{a, b, d}, Triangle{b, c, d}})
          triangles.push_back({t, 0.5});
      }
  }
  for (const Triangle& t : end_triangles) triangles.push_back({t, 1});
  return triangles;
}

struct SurfaceMatrices {
  Eigen::SparseMatrix<double> laplace;  ///< cotangent weights
  Eigen::VectorXd mass;                 ///< a third of the area around each vertex
};
inline SurfaceMatrices surface_matrices(const std::vector<SharedTriangle>& triangles, const std::vector<Vec3>& points) {
  const int count = static_cast<int>(points.size());
  SurfaceMatrices result{Eigen::SparseMatrix<double>(count, count), Eigen::VectorXd::Zero(count)};
  std::vector<Eigen::Triplet<double>> entries;
  for (const auto& [t, share] : triangles) {
    const double twice = (points[t[1]] - points[t[0]]).cross(points[t[2]] - points[t[0]]).norm();
    double edges2 = 0;
    for (int i = 0; i < 3; ++i) edges2 += (points[t[(i + 1) % 3]] - points[t[i]]).squaredNorm();
    for (int i = 0; i < 3; ++i) {
      const int a = t[(i + 1) % 3], b = t[(i + 2) % 3];
      const double weight = 0.5 * share * (points[a] - points[t[i]]).dot(points[b] - points[t[i]]) /
                            std::max(twice, 1.2e-4 * 0.5 * edges2);
      entries.emplace_back(a, b, -weight);
      entries.emplace_back(b, a, -weight);
      entries.emplace_back(a, a, weight);
      entries.emplace_back(b, b, weight);
      result.mass[t[i]] += share * twice / 6;
    }
  }
  result.laplace.setFromTriplets(entries.begin(), entries.end());
  return result;
}

inline std::vector<Vec3> area_vectors(const std::vector<SharedTriangle>& triangles, const std::vector<Vec3>& points) {
  std::vector<Vec3> vectors(points.size(), Vec3::Zero());
  for (const auto& [t, share] : triangles)
    for (const int v : t) vectors[v] += share / 6 * (points[t[1]] - points[t[0]]).cross(points[t[2]] - points[t[0]]);
  return vectors;
}

/// Perlin's improved noise with another hash: corner by corner.
inline double gradient_noise(const Vec3& p, std::uint32_t seed) {
  static constexpr std::array<std::array<int, 3>, 12> kSlopes{{{1, 1, 0},
                                                               {-1, 1, 0},
                                                               {1, -1, 0},
                                                               {-1, -1, 0},
                                                               {1, 0, 1},
                                                               {-1, 0, 1},
                                                               {1, 0, -1},
                                                               {-1, 0, -1},
                                                               {0, 1, 1},
                                                               {0, -1, 1},
                                                               {0, 1, -1},
                                                               {0, -1, -1}}};
  const auto scramble = [](std::uint32_t h) {
    h = (h ^ (h >> 16)) * 0x7feb352du;
    h = (h ^ (h >> 15)) * 0x846ca68bu;
    return h ^ (h >> 16);
  };
  double sum = 0;
  for (int corner = 0; corner < 8; ++corner) {
    double weight = 1, slope = 0;
    std::uint32_t h = scramble(seed);
    Vec3 way;
    for (int axis = 0; axis < 3; ++axis) {
      const int offset = corner >> axis & 1;
      const double f = p[axis] - std::floor(p[axis]), s = f * f * f * (f * (f * 6 - 15) + 10);
      weight *= offset == 1 ? s : 1 - s;
      way[axis] = f - offset;
      h = scramble(h + static_cast<std::uint32_t>(static_cast<int>(std::floor(p[axis])) + offset));
    }
    for (int axis = 0; axis < 3; ++axis) slope += kSlopes[h % 12][axis] * way[axis];
    sum += weight * slope;
  }
  return sum;
}

}  // namespace skeletex::twin
