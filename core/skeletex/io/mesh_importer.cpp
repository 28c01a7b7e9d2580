// SPDX-License-Identifier: MIT
#include "skeletex/io/mesh_importer.h"

#include <fmt/format.h>

#include <algorithm>

#include "skeletex/model/error.h"

namespace skeletex {

OpenMesh::FaceHandle MeshImporter::add_face(const VHandles& corners) {
  for (const OpenMesh::VertexHandle corner : corners) corners_.push_back(corner.idx());
  corner_counts_.push_back(static_cast<int>(corners.size()));
  return OpenMesh::FaceHandle(static_cast<int>(corner_counts_.size()) - 1);
}

MeshFile MeshImporter::take(const std::string& where) {
  MeshFile result;
  result.faces_in_file = static_cast<int>(corner_counts_.size());
  result.vertices_in_file = static_cast<int>(mesh_.positions.size());
  std::vector<int> polygon, sorted;
  auto next = corners_.begin();
  for (std::size_t face = 0; face < corner_counts_.size(); ++face) {
    polygon.clear();
    for (int i = 0; i < corner_counts_[face]; ++i) {
      const int corner = *next++;
      if (corner < 0 || corner >= result.vertices_in_file)
        throw IoError(fmt::format("{}: face {} names vertex {}, but the file has vertices 0 to {} (counted from 0)",
                                  where, face, corner, result.vertices_in_file - 1));
      if (polygon.empty() || polygon.back() != corner) polygon.push_back(corner);
    }
    while (polygon.size() > 1 && polygon.front() == polygon.back()) polygon.pop_back();
    if (polygon.size() < 3) {
      ++result.degenerate_faces;
      continue;
    }
    if (polygon.size() > 3) {
      sorted = polygon;
      std::sort(sorted.begin(), sorted.end());
      const auto twice = std::adjacent_find(sorted.begin(), sorted.end());
      if (twice != sorted.end())
        throw IoError(
            fmt::format("{}: face {} (counted from 0) runs through vertex {} twice; split it into simple polygons",
                        where, face, *twice));
    }
    for (std::size_t i = 2; i < polygon.size(); ++i)
      mesh_.triangles.push_back({polygon[0], polygon[i - 1], polygon[i]});
  }
  result.triangles = static_cast<int>(mesh_.triangles.size());
  result.mesh = std::move(mesh_);
  return result;
}

}  // namespace skeletex
