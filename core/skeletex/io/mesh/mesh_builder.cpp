// SPDX-License-Identifier: MIT
#include "skeletex/io/mesh/mesh_builder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "skeletex/io/mesh/text_reader.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

/// Values that no face names are those of the vertices, if there are as many; others mean nothing.
template <class T>
void drop_unnamed(std::size_t vertices, CornerValues<T>& list) {
  if (list.corners.empty() && list.values.size() != vertices) list.values.clear();
  if (list.values.empty()) list.corners.clear();
}

}  // namespace

std::optional<std::string> MeshBuilder::add_face(const FaceCorners& face) {
  const std::span<const int> vertices = face.vertices;
  polygon_.clear();
  for (int i = 0; i < static_cast<int>(vertices.size()); ++i)
    if (polygon_.empty() || vertices[polygon_.back()] != vertices[i]) polygon_.push_back(i);
  while (polygon_.size() > 1 && vertices[polygon_.front()] == vertices[polygon_.back()]) polygon_.pop_back();
  if (polygon_.size() > 3) {
    sorted_.clear();
    for (const int i : polygon_) sorted_.push_back(vertices[i]);
    std::sort(sorted_.begin(), sorted_.end());
    const auto twice = std::adjacent_find(sorted_.begin(), sorted_.end());
    if (twice != sorted_.end())
      return fmt::format("the face runs through vertex {} (counted from 0) twice; split it into simple polygons",
                         *twice);
  }
  ++file_.faces_in_file;
  if (polygon_.size() < 3) ++file_.degenerate_faces;
  // Where a file begins to name normals, texture coordinates or materials, the faces before have none.
  const auto add = [this](std::span<const int> of, std::size_t i, std::vector<Triangle>& triangles) {
    if (of.empty() && triangles.empty()) return;
    triangles.resize(file_.mesh.triangles.size() - 1, Triangle{-1, -1, -1});
    triangles.push_back(of.empty() ? Triangle{-1, -1, -1}
                                   : Triangle{of[polygon_[0]], of[polygon_[i - 1]], of[polygon_[i]]});
  };
  for (std::size_t i = 2; i < polygon_.size(); ++i) {
    file_.mesh.triangles.push_back({vertices[polygon_[0]], vertices[polygon_[i - 1]], vertices[polygon_[i]]});
    add(face.normals, i, file_.attributes.normals.corners);
    add(face.texture_coordinates, i, file_.attributes.texture_coordinates.corners);
    if (face.material < 0 && file_.attributes.triangle_materials.empty()) continue;
    file_.attributes.triangle_materials.resize(file_.mesh.triangles.size() - 1, -1);
    file_.attributes.triangle_materials.push_back(face.material);
  }
  return std::nullopt;
}

void MeshBuilder::complete_normals() {
  CornerValues<Vec3>& normals = file_.attributes.normals;
  if (normals.values.empty()) return;
  std::vector<char> is_normal(normals.values.size());
  for (std::size_t i = 0; i < normals.values.size(); ++i) {
    const double length = normals.values[i].stableNorm();
    is_normal[i] = length > 0 && std::isfinite(length);
    if (is_normal[i]) normals.values[i] /= length;
  }
  if (normals.corners.empty()) {
    if (std::all_of(is_normal.begin(), is_normal.end(), [](char is) { return is; })) return;
    normals.corners = file_.mesh.triangles;
  }
  for (std::size_t t = 0; t < normals.corners.size(); ++t) {
    int own = -1;  // the triangle's normal
    for (int& corner : normals.corners[t]) {
      if (corner >= 0 && is_normal[corner]) continue;
      if (own < 0) {
        own = static_cast<int>(normals.values.size());
        const Vec3 area = area_vector(file_.mesh, file_.mesh.triangles[t]);
        const double length = area.stableNorm();
        normals.values.push_back(length > 0 && std::isfinite(length) ? Vec3(area / length) : Vec3(0, 0, 1));
        is_normal.push_back(1);
      }
      corner = own;
    }
  }
}

MeshFile MeshBuilder::take(const std::string& where, std::vector<std::string> material_files) {
  if (file_.faces_in_file == 0)
    throw IoError(where + ": the file has no faces; it is not a mesh, or not what its ending says");
  if (file_.mesh.positions.size() > kMostElements) throw IoError(where + ": the mesh is too large");
  file_.triangles = static_cast<int>(file_.mesh.triangles.size());
  file_.vertices_in_file = vertex_count();
  const auto fill_up = [this](std::vector<Triangle>& corners) {
    if (!corners.empty()) corners.resize(file_.mesh.triangles.size(), Triangle{-1, -1, -1});
  };
  fill_up(file_.attributes.normals.corners);
  fill_up(file_.attributes.texture_coordinates.corners);
  if (!file_.attributes.triangle_materials.empty())
    file_.attributes.triangle_materials.resize(file_.mesh.triangles.size(), -1);
  drop_unnamed(file_.mesh.positions.size(), file_.attributes.normals);
  drop_unnamed(file_.mesh.positions.size(), file_.attributes.texture_coordinates);
  complete_normals();
  file_.material_files = std::move(material_files);
  return std::move(file_);
}

MeshFile MeshBuilder::take(const std::string& where) { return take(where, {}); }

}  // namespace skeletex
