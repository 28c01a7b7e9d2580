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

/// Reads OBJ, PLY (ascii, binary), OFF, STL or glTF (gltf_surface.h) by the ending, in double precision. Faces are
/// counted in and out, so that nothing is dropped silently: faces in file = triangles - (corners beyond three of kept
/// polygons) + degenerate faces. NaN and infinity are kept (not in STL) for validation to report. An UTF-8 byte order
/// mark is skipped.
/// \throw IoError naming the file, what is wrong and, where the format allows, the line
MeshFile read_mesh(const std::filesystem::path& path);
/// Reads the pictures of a mesh's materials, and first the files that an OBJ names for its materials.
/// \param path  of the mesh; names are relative to its folder
/// \return sentences about files that are missing; their materials stay as they are
/// \throw IoError when a file is there but damaged
std::vector<std::string> read_materials(const std::filesystem::path& path, MeshFile& file);

/// 8 bits per channel, sRGB, and opacity.
struct VertexColour {
  unsigned char r, g, b, a = 255;
  bool operator==(const VertexColour&) const = default;
};
VertexColour bytes_of(const Colour& colour);

/// What a mesh file holds beside the mesh.
struct WrittenAttributes {
  std::span<const VertexColour> vertex_colours = {};
  std::span<const VertexColour> face_colours = {};  ///< PLY alone
  struct Numbers {
    std::string name;
    std::span<const float> values;  ///< per vertex
  };
  std::vector<Numbers> vertex_numbers = {};  ///< PLY alone
  std::span<const Vec3> vertex_normals = {};
  const CornerValues<Eigen::Vector2f>* texture_coordinates = nullptr;
  std::string image_file = {};  ///< the picture that they belong to, as the file names it
};

/// Writes PLY (binary, little endian), OBJ, STL (binary) or glTF (.glb) by the ending, under a temporary name that is
/// renamed when complete. Positions have single precision; in PLY and OBJ double where that is needed: far from the
/// origin, and for very small or large meshes. STL takes no attributes, glTF normals and colours; there normals are
/// those of the triangles where none are given. An OBJ with a picture comes with a file of its material, of the same
/// name with the ending .mtl.
/// \throw IoError (unknown ending, folder not writable, disk full, attributes that do not fit the mesh, a number that
/// is not finite): no file is left behind
void write_mesh(const std::filesystem::path& path, const TriangleMesh& mesh, const WrittenAttributes& attributes = {});
/// The same with normals, colours and numbers by vertex. glTF holds the first picture.
/// \pre normals and colours have no corners of their own
void write_mesh(const std::filesystem::path& path, const TriangleMesh& mesh, const MeshAttributes& attributes);

}  // namespace skeletex
