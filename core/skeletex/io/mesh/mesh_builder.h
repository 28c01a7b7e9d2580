// SPDX-License-Identifier: MIT
#pragma once
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "skeletex/io/mesh_file.h"

namespace skeletex {

/// Collects the vertices and faces of a file. Faces are kept, whether they fit together or not, so that validation can
/// say what is wrong with them.
class MeshBuilder {
 public:
  void add_vertex(const Vec3& position) { file_.mesh.positions.push_back(position); }
  int vertex_count() const { return static_cast<int>(file_.mesh.positions.size()); }

  /// Adds a polygon as a fan of triangles, or counts it as degenerate where fewer than three of its corners differ.
  /// Nothing else is known of the corners.
  /// \return what is wrong with it, in which case it is not added
  std::optional<std::string> add_face(std::span<const int> corners);
  int face_count() const { return file_.faces_in_file; }

  /// \throw IoError when there are no faces, or too many vertices
  MeshFile take(const std::string& where);

 private:
  MeshFile file_;
  std::vector<int> polygon_, sorted_;
};

/// The readers of single formats.
/// \param bytes  the whole file    \param where  its name in messages
/// \throw IoError with the line (text) or the element (binary)
MeshFile read_obj(std::string_view bytes, const std::string& where);
MeshFile read_off(std::string_view bytes, const std::string& where);
MeshFile read_ply(std::string_view bytes, const std::string& where);
MeshFile read_stl(std::string_view bytes, const std::string& where);

}  // namespace skeletex
