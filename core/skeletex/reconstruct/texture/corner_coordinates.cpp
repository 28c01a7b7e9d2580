// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/texture/corner_coordinates.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/skeleton/separation_planes.h"

namespace skeletex {

std::vector<int> triangle_bones(const Lattice& lattice, const std::vector<Triangle>& triangles) {
  std::vector<int> bones;
  bones.reserve(triangles.size());
  for (const Triangle& t : triangles) {
    // Inner vertices come first, and every triangle has one: seams and poles never join up without the row next to
    // them.
    const VertexIndex vertex = *std::min_element(t.begin(), t.end());
    bones.push_back(static_cast<int>(std::upper_bound(lattice.first_inner.begin(), lattice.first_inner.end(), vertex) -
                                     lattice.first_inner.begin()) -
                    1);
  }
  return bones;
}

namespace {

/// v of the vertices of a seam, as its columns go along it.
using SeamTurns = std::unordered_map<int, double>;

SeamTurns turns_of_seam(const PreparedModel& model, const TriangleMesh& mesh, BoneIndex bone, BoneEnd end) {
  const EndSeam seam = end_seam(model.model, model.separation, model.lattice, mesh.positions, bone, end);
  SeamTurns turns;
  for (std::size_t i = 0; i < seam.turns.size(); ++i) turns[seam.ring.vertices[i]] = seam.turns[i];
  return turns;
}

/// Rows and columns of the corners of one triangle. Poles have no v of their own: they take the mean of the others.
class CornerPlaces {
 public:
  /// \param seams  of the bone's head and tail
  CornerPlaces(const PreparedModel& model, const std::array<SeamTurns, 2>& seams, BoneIndex bone,
               const Triangle& triangle)
      : model_(model),
        seams_(seams),
        bone_(bone),
        rectangle_(model.model.patches[bone].rectangle),
        triangle_(triangle) {
    int row = 1;
    for (const VertexIndex vertex : triangle) row = std::max(row, row_of(vertex));
    const BoneEnd near_end = row <= 1 ? BoneEnd::kHead : BoneEnd::kTail;
    for (int c = 0; c < 3; ++c) place(c, near_end);
  }

  void append(std::vector<std::array<double, 2>>& coordinates) {
    const int anchor = is_pole_[0] ? 1 : 0;
    double sum = 0;
    for (int c = 0; c < 3; ++c) {
      v_[c] += std::round(v_[anchor] - v_[c]);
      sum += is_pole_[c] ? 0 : v_[c];
    }
    const double others = 3 - static_cast<double>(std::count(is_pole_.begin(), is_pole_.end(), true));
    for (int c = 0; c < 3; ++c) coordinates.push_back({u_[c], is_pole_[c] ? sum / others : v_[c]});
  }

 private:
  int inner_number(VertexIndex vertex) const { return vertex - model_.lattice.first_inner[bone_]; }
  /// -1 for vertices of seams and poles
  int row_of(VertexIndex vertex) const {
    const int inner = inner_number(vertex);
    return inner >= 0 && inner < rectangle_.width * (rectangle_.height - 2) ? 1 + inner / rectangle_.width : -1;
  }
  void place(int c, BoneEnd near_end) {
    const VertexIndex vertex = triangle_[c];
    const int row = row_of(vertex);
    const auto& poles = model_.lattice.poles[bone_];
    is_pole_[c] = vertex == poles[0] || vertex == poles[1];
    if (row >= 0) {
      u_[c] = static_cast<double>(row) / (rectangle_.height - 1);
      v_[c] = static_cast<double>(inner_number(vertex) % rectangle_.width) / rectangle_.width;
      return;
    }
    u_[c] = near_end == BoneEnd::kHead ? 0 : 1;
    if (!is_pole_[c]) v_[c] = seams_[static_cast<int>(near_end)].at(vertex);
  }

  const PreparedModel& model_;
  const std::array<SeamTurns, 2>& seams_;
  int bone_;
  Rectangle rectangle_;
  Triangle triangle_;
  std::array<double, 3> u_{}, v_{};
  std::array<bool, 3> is_pole_{};
};

}  // namespace

std::vector<std::array<double, 2>> corner_coordinates(const PreparedModel& model, const TriangleMesh& mesh) {
  const std::vector<int> bones = triangle_bones(model.lattice, mesh.triangles);
  std::vector<std::array<double, 2>> coordinates;
  coordinates.reserve(3 * mesh.triangles.size());
  std::vector<std::array<SeamTurns, 2>> seams;
  for (BoneIndex bone = 0; bone < static_cast<int>(model.model.patches.size()); ++bone)
    seams.push_back(
        {turns_of_seam(model, mesh, bone, BoneEnd::kHead), turns_of_seam(model, mesh, bone, BoneEnd::kTail)});
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    CornerPlaces(model, seams[bones[t]], bones[t], mesh.triangles[t]).append(coordinates);
  return coordinates;
}

}  // namespace skeletex
