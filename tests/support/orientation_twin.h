// SPDX-License-Identifier: MIT
#pragma once
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <vector>

#include "skeletex/geometry/best_rotation.h"
#include "support/filter_twin.h"

namespace skeletex::twin {

struct OrientationPull {
  std::vector<Eigen::Quaterniond> rotations;
  std::vector<Vec3> normals, b;
};

/// The kernels of orientation.cl from their definition, by vertex and by edge.
inline OrientationPull pull_orientations(const SkeletexModel& model, const Lattice& lattice,
                                         const std::vector<Vec3>& points, const std::vector<Triangle>& ends,
                                         const SurfaceMatrices& matrices, std::vector<std::vector<Vec3>> sources,
                                         const std::vector<double>& weights, double scale) {
  const int count = static_cast<int>(points.size()), inner = lattice.inner_count;
  const int first_seam = lattice.first_sample.empty() ? count : lattice.first_sample[0];
  for (std::vector<Vec3>& source : sources) {  // as a whole they face as the surface does
    const auto middle = [&](const std::vector<Vec3>& of) {
      Vec3 sum = Vec3::Zero();
      for (int i = 0; i < count; ++i) sum += matrices.mass[i] * of[i];
      return Vec3(sum / matrices.mass.sum());
    };
    const Vec3 here = middle(points), there = middle(source);
    std::vector<Vec3> from, to;
    for (int i = 0; i < count; ++i) {
      from.push_back(std::sqrt(matrices.mass[i]) * (source[i] - there));
      to.push_back(std::sqrt(matrices.mass[i]) * (points[i] - here));
    }
    const Eigen::Quaterniond rotation = best_rotation(from, to);
    for (Vec3& p : source) p = rotation * p;
  }

  struct Directions {
    Vec3 along, around, normal;
    bool has_normal() const { return along.cross(around).norm() > 1e-3 * along.norm() * around.norm(); }
  };
  const auto directions = [&](const std::vector<Vec3>& p, int bone, int row, int j) {
    const auto [x, y, width, height] = model.patches[bone].rectangle;
    const auto at = [&](int r, int c) {
      return p[lattice.first_inner[bone] + (std::clamp(r, 1, height - 2) - 1) * width + (c + width) % width];
    };
    Directions d{at(row + 1, j) - at(row - 1, j), at(row, j + 1) - at(row, j - 1), Vec3::Zero()};
    if (d.has_normal()) d.normal = d.along.cross(d.around).normalized();
    return d;
  };
  const auto normals_of = [&](const std::vector<Vec3>& p) {
    std::vector<Vec3> normals(count, Vec3::Zero());
    for (int bone = 0; bone < static_cast<int>(model.patches.size()); ++bone)
      for (int row = 1; row + 1 < model.patches[bone].rectangle.height; ++row)
        for (int j = 0; j < model.patches[bone].rectangle.width; ++j)
          normals[lattice.first_inner[bone] + (row - 1) * model.patches[bone].rectangle.width + j] =
              directions(p, bone, row, j).normal;
    return normals;
  };
  std::vector<std::vector<int>> inner_neighbours(count);
  for (const Triangle& t : ends)
    for (const int v : t)
      for (const int other : t)
        if (v >= inner && other < inner) inner_neighbours[v].push_back(other);
  for (std::vector<int>& list : inner_neighbours) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
  }
  const auto add_ends = [&](std::vector<Vec3>& field) {
    for (int v = inner; v < count; ++v) {
      field[v] = Vec3::Zero();
      for (const int other : inner_neighbours[v]) field[v] += field[other];
      if (field[v].norm() > 1e-6) field[v].normalize();
    }
  };

  OrientationPull pull{std::vector<Eigen::Quaterniond>(count, Eigen::Quaterniond::Identity()), normals_of(points),
                       std::vector<Vec3>(count, Vec3::Zero())};
  for (int bone = 0; bone < static_cast<int>(model.patches.size()); ++bone) {
    const auto [x, y, width, height] = model.patches[bone].rectangle;
    for (int row = 1; row + 1 < height; ++row)
      for (int j = 0; j < width; ++j) {
        const int v = lattice.first_inner[bone] + (row - 1) * width + j;
        const Directions here = directions(points, bone, row, j);
        Eigen::Vector4d sum = Eigen::Vector4d::Zero();
        for (std::size_t m = 0; m < sources.size(); ++m) {
          const Directions there = directions(sources[m], bone, row, j);
          Eigen::Quaterniond q = Eigen::Quaterniond::Identity();
          if (here.has_normal() && there.has_normal() && 1 + here.normal.dot(there.normal) >= 1e-3) {
            q = Eigen::Quaterniond::FromTwoVectors(here.normal, there.normal);
            const Vec3 a = (q * here.along).normalized(), b = (q * here.around).normalized();
            const Vec3 to_a = there.along.normalized(), to_b = there.around.normalized();
            const double s = (a.cross(to_a) + b.cross(to_b)).dot(there.normal), c = a.dot(to_a) + b.dot(to_b);
            q = Eigen::AngleAxisd(std::atan2(s, c), there.normal) * q;
          }
          sum += weights[m] * (q.w() < 0 ? -1 : 1) * q.coeffs();
        }
        const double u = model.patches[bone].row_u[row];
        double from_seam = 1;
        if (lattice.poles[bone][0] < 0) from_seam = std::min(from_seam, u);
        if (lattice.poles[bone][1] < 0) from_seam = std::min(from_seam, 1 - u);
        const auto step = [](double t) {
          t = std::clamp(t, 0.0, 1.0);
          return t * t * (3 - 2 * t);
        };
        const Eigen::Quaterniond mean(Eigen::Vector4d(sum.normalized()));
        const double degrees50 = std::cos(25 * M_PI / 180), degrees100 = std::cos(50 * M_PI / 180);
        const double share = step((0.9 - from_seam) / 0.5) * step((mean.w() - degrees100) / (degrees50 - degrees100));
        pull.rotations[v].coeffs() =
            ((1 - share) * Eigen::Quaterniond::Identity().coeffs() + share * mean.coeffs()).normalized();
      }
  }
  for (int pass = 0; pass < 2; ++pass) {
    const std::vector<Eigen::Quaterniond> before = pull.rotations;
    for (int bone = 0; bone < static_cast<int>(model.patches.size()); ++bone) {
      const auto [x, y, width, height] = model.patches[bone].rectangle;
      for (int row = 1; row + 1 < height; ++row)
        for (int j = 0; j < width; ++j) {
          Eigen::Vector4d sum = Eigen::Vector4d::Zero();
          for (int r = std::max(1, row - 1); r <= std::min(height - 2, row + 1); ++r)
            for (const int c : {j + width - 1, j, j + 1})
              sum += before[lattice.first_inner[bone] + (r - 1) * width + c % width].coeffs();
          pull.rotations[lattice.first_inner[bone] + (row - 1) * width + j].coeffs() = sum.normalized();
        }
    }
  }
  for (int v = 0; v < inner; ++v) pull.normals[v] = pull.rotations[v] * pull.normals[v];
  for (int v = inner; v < count; ++v) {
    Eigen::Vector4d sum = Eigen::Vector4d::Zero();
    for (const int other : inner_neighbours[v]) sum += pull.rotations[other].coeffs();
    if (sum.norm() > 1e-6) pull.rotations[v].coeffs() = sum.normalized();
  }
  add_ends(pull.normals);
  std::vector<std::vector<Vec3>> source_normals;
  for (const std::vector<Vec3>& source : sources) add_ends(source_normals.emplace_back(normals_of(source)));

  const auto mean_normal = [](const std::vector<Vec3>& normals, int v, int other) {
    const Vec3 n = normals[v] + normals[other];
    return n.norm() > 0.1 ? Vec3(n.normalized()) : Vec3(Vec3::Zero());
  };
  for (int column = 0; column < count; ++column)
    for (Eigen::SparseMatrix<double>::InnerIterator entry(matrices.laplace, column); entry; ++entry) {
      const int v = static_cast<int>(entry.row());
      if (v == column) continue;
      const Vec3 edge = points[v] - points[column];
      Vec3 rotated = 0.5 * (pull.rotations[v] * edge + pull.rotations[column] * edge);
      if (std::max(v, column) >= first_seam) {
        double slope = 0;
        for (std::size_t m = 0; m < sources.size(); ++m) {
          const Vec3 e = sources[m][v] - sources[m][column];
          if (e.norm() > 0) slope += weights[m] * mean_normal(source_normals[m], v, column).dot(e) / e.norm();
        }
        const Vec3 n = mean_normal(pull.normals, v, column);
        rotated -= (n.dot(rotated) - slope * rotated.norm()) * n;
      }
      pull.b[v] -= scale * scale * entry.value() * (rotated - edge);
    }
  return pull;
}

}  // namespace skeletex::twin
