// SPDX-License-Identifier: MIT
#pragma once
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace skeletex {

enum class MeshFormat { kObj, kOff, kPly, kStlAscii, kStlBinary };

/// What a mesh file holds, found before OpenMesh reads it.
struct MeshSurvey {
  MeshFormat format = MeshFormat::kObj;
  std::size_t vertices = 0;  ///< for STL, the corners of all triangles
  std::size_t faces = 0;
  std::size_t small_faces = 0;  ///< of them, faces with fewer than three different vertices (OBJ only)
  /// The file in the plainest form of its format: vertices and faces, and nothing else.
  std::string plain;
  /// Coordinates that are no finite single-precision numbers; they stand as 0 in a plain text.
  struct OddCoordinate {
    std::size_t vertex;
    int axis;
    double value;
  };
  std::vector<OddCoordinate> odd_coordinates;
};

/// Walks through a mesh file before OpenMesh reads it. OpenMesh 9's readers take a file at its word: they do not notice
/// that it ends early, go on with zeros after the first word they cannot parse (which "nan" is), run for ever in a
/// header without end, and lose their place at comments, colours or properties that they do not expect. The survey
/// checks that everything announced is there, that every number is one and every index exists, and leaves out what is
/// not read. \param extension  lower case with dot: ".obj", ".off", ".ply" or ".stl" \throw IoError with the line
/// (text) or element (binary)
MeshSurvey survey_mesh(std::string_view bytes, const std::string& extension, const std::string& where);

}  // namespace skeletex
