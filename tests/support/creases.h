// SPDX-License-Identifier: MIT
#pragma once
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <utility>

#include "skeletex/reconstruct/lattice.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex {

/// Mean over the length of a model's seams, or of some arcs, of the angle between the two triangles at each of their
/// edges, degrees.
inline double mean_crease(ClContext& context, const SkeletexModel& model,
                          const std::function<bool(const SeamArc&)>& is_meant = {}) {
  const TriangleMesh mesh = reconstruct_mesh(context, model);
  const Lattice lattice = number_lattice(model);
  std::map<std::pair<int, int>, Vec3> normals;
  for (const Triangle& t : mesh.triangles) {
    const Vec3 normal =
        (mesh.positions[t[1]] - mesh.positions[t[0]]).cross(mesh.positions[t[2]] - mesh.positions[t[0]]);
    for (int i = 0; i < 3; ++i) normals[{t[i], t[(i + 1) % 3]}] = normal;
  }
  double sum = 0, length = 0;
  for (std::size_t a = 0; a < model.arcs.size(); ++a) {
    if (is_meant && !is_meant(model.arcs[a])) continue;
    for (std::size_t i = 0; i + 1 < model.arcs[a].samples.size(); ++i) {
      const int from = lattice.first_sample[a] + static_cast<int>(i);
      const Vec3 &one = normals.at({from, from + 1}), &other = normals.at({from + 1, from});
      const double edge = (mesh.positions[from + 1] - mesh.positions[from]).norm();
      sum += edge * std::atan2(one.cross(other).norm(), one.dot(other));
      length += edge;
    }
  }
  return sum / length * 180 / std::numbers::pi;
}

}  // namespace skeletex
