// SPDX-License-Identifier: MIT
#pragma once
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "skeletex/io/mesh_file.h"

namespace skeletex {

/// A polygon of a file. Normals and texture coordinates are indices into those of the file, -1: none; where they are
/// empty, too.
struct FaceCorners {
  std::span<const int> vertices, normals = {}, texture_coordinates = {};
  int material = -1;
};

/// Collects the vertices and faces of a file. Faces are kept, whether they fit together or not, so that validation can
/// say what is wrong with them.
class MeshBuilder {
 public:
  void add_vertex(const Vec3& position) { file_.mesh.positions.push_back(position); }
  int vertex_count() const { return static_cast<int>(file_.mesh.positions.size()); }

  /// Adds a polygon as a fan of triangles, or counts it as degenerate where fewer than three of its corners differ.
  /// Nothing else is known of the corners.
  /// \return what is wrong with it, in which case it is not added
  std::optional<std::string> add_face(const FaceCorners& face);
  std::optional<std::string> add_face(std::span<const int> corners) { return add_face(FaceCorners{corners}); }
  int triangle_count() const { return static_cast<int>(file_.mesh.triangles.size()); }
  int face_count() const { return file_.faces_in_file; }

  /// Values of the vertices or of the faces' corners, as far as they are known; take() completes them.
  MeshAttributes& attributes() { return file_.attributes; }

  /// Corners without a normal take that of their triangle. Normals get unit length.
  /// \throw IoError when there are no faces, or too many vertices
  MeshFile take(const std::string& where);
  /// The same of a file that names the files of its materials.
  MeshFile take(const std::string& where, std::vector<std::string> material_files);

 private:
  void complete_normals();

  MeshFile file_;
  std::vector<int> polygon_, sorted_;  ///< corners of the face that is added, and their vertices
};

/// The readers of single formats.
/// \param bytes  the whole file
/// \param where  its name in messages
/// \throw IoError with the line (text) or the element (binary)
MeshFile read_obj(std::string_view bytes, const std::string& where);
MeshFile read_off(std::string_view bytes, const std::string& where);
MeshFile read_ply(std::string_view bytes, const std::string& where);
MeshFile read_stl(std::string_view bytes, const std::string& where);

}  // namespace skeletex
