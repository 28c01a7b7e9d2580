// SPDX-License-Identifier: MIT
#pragma once
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "skeletex/geometry/mesh.h"
#include "skeletex/model/mesh_attributes.h"

namespace skeletex {

struct MeshFile {
  TriangleMesh mesh;
  int faces_in_file = 0;  ///< polygons as the file counts them
  int triangles = 0;      ///< after polygons were split into fans
  int degenerate_faces =
      0;  ///< faces with fewer than three different vertices (after welding): they have no area and are left out
  int vertices_in_file = 0;   ///< for STL, three per triangle
  int merged_vertices = 0;    ///< equal positions welded (STL; other formats are not welded)
  bool ends_in_face = false;  ///< OBJ: the last line is a face without a line break, as where a file was cut
  MeshAttributes attributes;
  std::vector<std::string> material_files;  ///< that an OBJ names, as it names them
};

/// Reads OBJ, PLY (ascii, binary), OFF or STL by the ending, in double precision. Faces are counted in and out, so that
/// nothing is dropped silently: faces in file = triangles - (corners beyond three of kept polygons) + degenerate faces.
/// NaN and infinity are kept (not in STL) for validation to report. An UTF-8 byte order mark is skipped.
/// \throw IoError naming the file, what is wrong and, where the format allows, the line
MeshFile read_mesh(const std::filesystem::path& path);
/// Reads the pictures of a mesh's materials, and first the files that an OBJ names for its materials.
/// \param path  of the mesh; names are relative to its folder
/// \return sentences about files that are missing; their materials stay as they are
/// \throw IoError when a file is there but damaged
std::vector<std::string> read_materials(const std::filesystem::path& path, MeshFile& file);

/// Extra per-vertex data for PLY.
struct VertexColour {
  unsigned char r, g, b;
};
struct PlyAttributes {
  std::span<const VertexColour> vertex_colours;
  std::span<const VertexColour> face_colours;
  std::string vertex_property_name;  ///< with vertex_property: a float per vertex, e.g. "distance"
  std::span<const float> vertex_property;
  std::span<const Vec3> vertex_normals;  ///< nx, ny, nz
};

/// Writes binary PLY (little endian) or OBJ by the ending, under a temporary name that is renamed when complete.
/// Positions have single precision, or double where that is needed: far from the origin, and for very small or large
/// meshes. Attributes go into PLY only. \throw IoError (unknown ending, folder not writable, disk full, attributes that
/// do not fit the mesh, a number that is not finite): no file is left behind
void write_mesh(const std::filesystem::path& path, const TriangleMesh& mesh, const PlyAttributes& attributes = {});

}  // namespace skeletex
