// SPDX-License-Identifier: MIT
#pragma once
#include <string>

namespace skeletex {

enum class MeshFormat { kObj, kOff, kPly, kStlAscii, kStlBinary };

struct MeshSurvey {
  MeshFormat format;
  std::size_t vertices = 0;  ///< corners, for STL
  std::size_t faces = 0;
};

/// Walks through a mesh file before OpenMesh reads it. OpenMesh 9's readers take a file at its word: they do not notice
/// that it ends early, count on with what they could not parse, and can run for ever in a broken header. The survey
/// checks that everything announced is there and every number is one, and takes out of the text what the readers would
/// trip over (comments, colours behind faces, material files).
/// \param bytes      the file's contents; edited in place
/// \param extension  lower case with dot: ".obj", ".off", ".ply" or ".stl"
/// \throw IoError with the line (text) or element (binary)
MeshSurvey survey_mesh(std::string& bytes, const std::string& extension, const std::string& where);

}  // namespace skeletex
