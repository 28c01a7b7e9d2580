// SPDX-License-Identifier: MIT
#include "skeletex/io/mesh/mesh_builder.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "skeletex/io/mesh/text_reader.h"
#include "skeletex/model/error.h"

namespace skeletex {

std::optional<std::string> MeshBuilder::add_face(std::span<const int> corners) {
  polygon_.clear();
  std::unique_copy(corners.begin(), corners.end(), std::back_inserter(polygon_));
  while (polygon_.size() > 1 && polygon_.front() == polygon_.back()) polygon_.pop_back();
  if (polygon_.size() > 3) {
    sorted_ = polygon_;
    std::sort(sorted_.begin(), sorted_.end());
    const auto twice = std::adjacent_find(sorted_.begin(), sorted_.end());
    if (twice != sorted_.end())
      return fmt::format("the face runs through vertex {} (counted from 0) twice; split it into simple polygons",
                         *twice);
  }
  ++file_.faces_in_file;
  if (polygon_.size() < 3) ++file_.degenerate_faces;
  for (std::size_t i = 2; i < polygon_.size(); ++i)
    file_.mesh.triangles.push_back({polygon_[0], polygon_[i - 1], polygon_[i]});
  return std::nullopt;
}

MeshFile MeshBuilder::take(const std::string& where) {
  if (file_.faces_in_file == 0)
    throw IoError(where + ": the file has no faces; it is not a mesh, or not what its ending says");
  if (file_.mesh.positions.size() > kMostElements) throw IoError(where + ": the mesh is too large");
  file_.triangles = static_cast<int>(file_.mesh.triangles.size());
  file_.vertices_in_file = vertex_count();
  return std::move(file_);
}

}  // namespace skeletex
