// SPDX-License-Identifier: MIT
#include "skeletex/io/mesh_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "skeletex/io/atomic_file.h"
#include "skeletex/io/mesh/mesh_builder.h"
#include "skeletex/io/read_file.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

std::string lower_extension(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

template <typename T>
void append(std::string& out, T value) {
  static_assert(std::endian::native == std::endian::little, "binary PLY is written as it lies in memory");
  out.append(reinterpret_cast<const char*>(&value), sizeof value);
}

/// Calls add(i, block) for i in [0, count) and writes what it appends in blocks.
template <typename Add>
void write_blocks(OutputFile& file, std::size_t count, const Add& add) {
  std::string block;
  for (std::size_t i = 0; i < count; ++i) {
    add(i, block);
    if (block.size() < (std::size_t{1} << 20)) continue;
    file.write(block);
    block.clear();
  }
  file.write(block);
}

void append(std::string& out, VertexColour colour) {
  append(out, colour.r);
  append(out, colour.g);
  append(out, colour.b);
}

/// Whether positions take double precision: far from the origin, or where single precision ends.
bool needs_double(const TriangleMesh& mesh) {
  constexpr double kMostDiagonals = 8, kSmallest = 1e-30, kLargest = 1e37;  // a rounding of 2^-22 diagonals
  const BoundingBox box = bounding_box(mesh);
  const double farthest = std::max(box.lower.cwiseAbs().maxCoeff(), box.upper.cwiseAbs().maxCoeff());
  return box.diagonal() < kSmallest || farthest > kLargest || farthest > kMostDiagonals * box.diagonal();
}

/// What is written must be a number.
void check_finite(const TriangleMesh& mesh, const PlyAttributes& attributes, const std::string& where) {
  for (std::size_t i = 0; i < mesh.positions.size(); ++i)
    for (int axis = 0; axis < 3; ++axis)
      if (!std::isfinite(mesh.positions[i][axis]))
        throw IoError(fmt::format("{}: {} of vertex {} is {}, which the file cannot hold; nothing was written", where,
                                  "xyz"[axis], i, mesh.positions[i][axis]));
  for (std::size_t i = 0; i < attributes.vertex_normals.size(); ++i)
    if (!attributes.vertex_normals[i].allFinite())
      throw IoError(fmt::format("{}: the normal of vertex {} is not finite; nothing was written", where, i));
  for (std::size_t i = 0; i < attributes.vertex_property.size(); ++i)
    if (!std::isfinite(attributes.vertex_property[i]))
      throw IoError(fmt::format("{}: {} of vertex {} is not finite; nothing was written", where,
                                attributes.vertex_property_name, i));
}

void write_ply(OutputFile& file, const TriangleMesh& mesh, const PlyAttributes& attributes) {
  constexpr const char* kColour = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  const bool has_doubles = needs_double(mesh);
  std::string header = fmt::format(
      "ply\nformat binary_little_endian 1.0\nelement vertex {0}\nproperty {1} x\nproperty {1} y\nproperty {1} z\n",
      mesh.positions.size(), has_doubles ? "double" : "float");
  if (!attributes.vertex_normals.empty()) header += "property float nx\nproperty float ny\nproperty float nz\n";
  if (!attributes.vertex_colours.empty()) header += kColour;
  if (!attributes.vertex_property.empty())
    header += fmt::format("property float {}\n", attributes.vertex_property_name);
  header += fmt::format("element face {}\nproperty list uchar int vertex_indices\n", mesh.triangles.size());
  if (!attributes.face_colours.empty()) header += kColour;
  file.write(header + "end_header\n");
  write_blocks(file, mesh.positions.size(), [&](std::size_t i, std::string& out) {
    for (const double x : mesh.positions[i]) has_doubles ? append(out, x) : append(out, static_cast<float>(x));
    for (int axis = 0; axis < 3 && !attributes.vertex_normals.empty(); ++axis)
      append(out, static_cast<float>(attributes.vertex_normals[i][axis]));
    if (!attributes.vertex_colours.empty()) append(out, attributes.vertex_colours[i]);
    if (!attributes.vertex_property.empty()) append(out, attributes.vertex_property[i]);
  });
  write_blocks(file, mesh.triangles.size(), [&](std::size_t i, std::string& out) {
    append(out, static_cast<unsigned char>(3));
    for (const int corner : mesh.triangles[i]) append(out, static_cast<std::int32_t>(corner));
    if (!attributes.face_colours.empty()) append(out, attributes.face_colours[i]);
  });
}

void write_obj(OutputFile& file, const TriangleMesh& mesh) {
  const int digits = needs_double(mesh) ? 17 : 9;
  write_blocks(file, mesh.positions.size(), [&](std::size_t i, std::string& out) {
    const Vec3& p = mesh.positions[i];
    fmt::format_to(std::back_inserter(out), "v {:.{}g} {:.{}g} {:.{}g}\n", p[0], digits, p[1], digits, p[2], digits);
  });
  write_blocks(file, mesh.triangles.size(), [&](std::size_t i, std::string& out) {
    const Triangle& t = mesh.triangles[i];
    fmt::format_to(std::back_inserter(out), "f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1);
  });
}

}  // namespace

MeshFile read_mesh(const std::filesystem::path& path) {
  const std::string where = path.string(), extension = lower_extension(path);
  const std::string bytes = read_file(path);
  if (bytes.empty()) throw IoError(where + ": the file is empty");
  if (extension == ".obj") return read_obj(bytes, where);
  if (extension == ".off") return read_off(bytes, where);
  if (extension == ".ply") return read_ply(bytes, where);
  if (extension == ".stl") return read_stl(bytes, where);
  throw IoError(
      fmt::format("{}: meshes are read from .obj, .off, .ply and .stl files, not from \"{}\"", where, extension));
}

void write_mesh(const std::filesystem::path& path, const TriangleMesh& mesh, const PlyAttributes& attributes) {
  const std::string extension = lower_extension(path);
  if (extension != ".ply" && extension != ".obj")
    throw IoError(fmt::format("{}: meshes are written as .ply or .obj, not as \"{}\"", path.string(), extension));
  const auto fits = [](std::size_t size, std::size_t count) { return size == 0 || size == count; };
  if (!fits(attributes.vertex_colours.size(), mesh.positions.size()) ||
      !fits(attributes.vertex_normals.size(), mesh.positions.size()) ||
      !fits(attributes.vertex_property.size(), mesh.positions.size()) ||
      !fits(attributes.face_colours.size(), mesh.triangles.size()))
    throw IoError(fmt::format(
        "{}: there must be as many colours, normals or values as the mesh has vertices or triangles", path.string()));
  if (!attributes.vertex_property.empty() && attributes.vertex_property_name.empty())
    throw IoError(fmt::format("{}: the vertex property needs a name", path.string()));
  check_finite(mesh, attributes, path.string());
  write_atomically(path, [&](const std::filesystem::path& temporary) {
    OutputFile file(temporary, path);
    if (extension == ".ply")
      write_ply(file, mesh, attributes);
    else
      write_obj(file, mesh);
    file.close();
  });
}

}  // namespace skeletex
