// SPDX-License-Identifier: MIT
#include "skeletex/io/mesh_survey.h"

#include <fmt/format.h>

#include <cstring>

#include "skeletex/model/error.h"

namespace skeletex {

MeshSurvey survey_mesh(std::string& bytes, const std::string& extension, const std::string& where) {
  if (bytes.empty()) throw IoError(where + ": the file is empty");
  if (extension == ".obj") return {MeshFormat::kObj};
  if (extension == ".off") return {MeshFormat::kOff};
  if (extension == ".ply") return {MeshFormat::kPly};
  if (extension == ".stl") return {MeshFormat::kStlAscii};
  throw IoError(fmt::format("{}: meshes are read from .obj, .off, .ply and .stl files, not from \"{}\"", where, extension));
}

}  // namespace skeletex
