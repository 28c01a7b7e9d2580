// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "skeletex/io/atomic_file.h"
#include "skeletex/io/gltf/write_gltf.h"
#include "skeletex/io/mesh/text_reader.h"
#include "skeletex/io/mesh_file.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

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

bool has_opacity(std::span<const VertexColour> colours) {
  return std::any_of(colours.begin(), colours.end(), [](const VertexColour& colour) { return colour.a != 255; });
}

void append(std::string& out, VertexColour colour, bool has_alpha) {
  append(out, colour.r);
  append(out, colour.g);
  append(out, colour.b);
  if (has_alpha) append(out, colour.a);
}

/// Whether positions take double precision: far from the origin, or where single precision ends.
bool needs_double(const TriangleMesh& mesh) {
  constexpr double kMostDiagonals = 8, kSmallest = 1e-30, kLargest = 1e37;  // a rounding of 2^-22 diagonals
  const BoundingBox box = bounding_box(mesh);
  const double farthest = std::max(box.lower.cwiseAbs().maxCoeff(), box.upper.cwiseAbs().maxCoeff());
  return box.diagonal() < kSmallest || farthest > kLargest || farthest > kMostDiagonals * box.diagonal();
}

/// What is written must be a number.
void check_finite(const TriangleMesh& mesh, const WrittenAttributes& attributes, const std::string& where) {
  for (std::size_t i = 0; i < mesh.positions.size(); ++i)
    for (int axis = 0; axis < 3; ++axis)
      if (!std::isfinite(mesh.positions[i][axis]))
        throw IoError(fmt::format("{}: {} of vertex {} is {}, which the file cannot hold; nothing was written", where,
                                  "xyz"[axis], i, mesh.positions[i][axis]));
  for (std::size_t i = 0; i < attributes.vertex_normals.size(); ++i)
    if (!attributes.vertex_normals[i].allFinite())
      throw IoError(fmt::format("{}: the normal of vertex {} is not finite; nothing was written", where, i));
  for (const auto& [name, values] : attributes.vertex_numbers)
    for (std::size_t i = 0; i < values.size(); ++i)
      if (!std::isfinite(values[i]))
        throw IoError(fmt::format("{}: {} of vertex {} is not finite; nothing was written", where, name, i));
}

/// Names of properties end at a space.
std::string property_name(std::string name) {
  std::replace_if(
      name.begin(), name.end(), [](unsigned char c) { return c <= ' ' || c == 127; }, '_');
  return name;
}

std::string ply_header(const TriangleMesh& mesh, const WrittenAttributes& attributes) {
  constexpr const char* kColour = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  constexpr const char* kAlpha = "property uchar alpha\n";
  std::string header = "ply\nformat binary_little_endian 1.0\n";
  if (!attributes.image_file.empty()) header += fmt::format("comment TextureFile {}\n", attributes.image_file);
  header += fmt::format("element vertex {0}\nproperty {1} x\nproperty {1} y\nproperty {1} z\n", mesh.positions.size(),
                        needs_double(mesh) ? "double" : "float");
  if (!attributes.vertex_normals.empty()) header += "property float nx\nproperty float ny\nproperty float nz\n";
  if (!attributes.vertex_colours.empty()) header += kColour;
  if (has_opacity(attributes.vertex_colours)) header += kAlpha;
  for (const auto& numbers : attributes.vertex_numbers)
    header += fmt::format("property float {}\n", property_name(numbers.name));
  header += fmt::format("element face {}\nproperty list uchar int vertex_indices\n", mesh.triangles.size());
  if (attributes.texture_coordinates) header += "property list uchar float texcoord\n";
  if (!attributes.face_colours.empty()) header += kColour;
  if (has_opacity(attributes.face_colours)) header += kAlpha;
  return header + "end_header\n";
}

void write_ply(OutputFile& file, const TriangleMesh& mesh, const WrittenAttributes& attributes) {
  const bool has_vertex_alpha = has_opacity(attributes.vertex_colours),
             has_face_alpha = has_opacity(attributes.face_colours);
  const bool has_doubles = needs_double(mesh);
  file.write(ply_header(mesh, attributes));
  write_blocks(file, mesh.positions.size(), [&](std::size_t i, std::string& out) {
    for (const double x : mesh.positions[i]) has_doubles ? append(out, x) : append(out, static_cast<float>(x));
    for (int axis = 0; axis < 3 && !attributes.vertex_normals.empty(); ++axis)
      append(out, static_cast<float>(attributes.vertex_normals[i][axis]));
    if (!attributes.vertex_colours.empty()) append(out, attributes.vertex_colours[i], has_vertex_alpha);
    for (const auto& numbers : attributes.vertex_numbers) append(out, numbers.values[i]);
  });
  write_blocks(file, mesh.triangles.size(), [&](std::size_t i, std::string& out) {
    append(out, static_cast<unsigned char>(3));
    for (const int corner : mesh.triangles[i]) append(out, static_cast<std::int32_t>(corner));
    if (attributes.texture_coordinates) {
      append(out, static_cast<unsigned char>(6));
      for (const int corner : attributes.texture_coordinates->of(mesh, i))
        for (const float x : attributes.texture_coordinates->values[corner]) append(out, x);
    }
    if (!attributes.face_colours.empty()) append(out, attributes.face_colours[i], has_face_alpha);
  });
}

constexpr const char* kMaterial = "surface";

void write_obj(OutputFile& file, const TriangleMesh& mesh, const WrittenAttributes& attributes,
               const std::string& material_file) {
  const auto* const texture = attributes.texture_coordinates;
  const int digits = needs_double(mesh) ? 17 : 9;
  if (!material_file.empty()) file.write(fmt::format("mtllib {}\nusemtl {}\n", material_file, kMaterial));
  write_blocks(file, mesh.positions.size(), [&](std::size_t i, std::string& out) {
    const Vec3& p = mesh.positions[i];
    fmt::format_to(std::back_inserter(out), "v {:.{}g} {:.{}g} {:.{}g}", p[0], digits, p[1], digits, p[2], digits);
    if (!attributes.vertex_colours.empty()) {
      const VertexColour& c = attributes.vertex_colours[i];
      fmt::format_to(std::back_inserter(out), " {:.4f} {:.4f} {:.4f}", c.r / 255.0, c.g / 255.0, c.b / 255.0);
    }
    out += '\n';
  });
  write_blocks(file, attributes.vertex_normals.size(), [&](std::size_t i, std::string& out) {
    const Vec3& n = attributes.vertex_normals[i];
    fmt::format_to(std::back_inserter(out), "vn {:.6f} {:.6f} {:.6f}\n", n[0], n[1], n[2]);
  });
  write_blocks(file, texture ? texture->values.size() : 0, [&](std::size_t i, std::string& out) {
    fmt::format_to(std::back_inserter(out), "vt {:.7f} {:.7f}\n", texture->values[i].x(), texture->values[i].y());
  });
  const bool has_normals = !attributes.vertex_normals.empty();
  write_blocks(file, mesh.triangles.size(), [&](std::size_t i, std::string& out) {
    const Triangle& t = mesh.triangles[i];
    out += 'f';
    for (int k = 0; k < 3; ++k) {
      fmt::format_to(std::back_inserter(out), " {}", t[k] + 1);
      if (texture) fmt::format_to(std::back_inserter(out), "/{}", texture->of(mesh, i)[k] + 1);
      if (has_normals) fmt::format_to(std::back_inserter(out), "{}/{}", texture ? "" : "/", t[k] + 1);
    }
    out += '\n';
  });
}

void write_stl(OutputFile& file, const TriangleMesh& mesh) {
  std::string header(80, ' ');
  header.replace(0, 8, "Skeletex");  // anything but "solid", which begins files in ASCII
  append(header, static_cast<std::uint32_t>(mesh.triangles.size()));
  file.write(header);
  write_blocks(file, mesh.triangles.size(), [&](std::size_t i, std::string& out) {
    for (const double x : area_vector(mesh, mesh.triangles[i]).stableNormalized()) append(out, static_cast<float>(x));
    for (const int corner : mesh.triangles[i])
      for (const double x : mesh.positions[corner]) append(out, static_cast<float>(x));
    append(out, std::uint16_t{0});
  });
}

/// One mesh without a skin.
GltfScene scene_of(const TriangleMesh& mesh, const MeshAttributes& attributes, const std::string& name) {
  GltfScene scene;
  scene.materials.push_back(material_of(attributes, scene.images));
  scene.meshes.push_back({name, {primitive_of(mesh, attributes).primitive}});
  scene.nodes.emplace_back().name = name;
  scene.nodes[0].mesh = 0;
  return scene;
}

void check_attributes(const TriangleMesh& mesh, const WrittenAttributes& attributes, const std::string& where) {
  const auto fits = [](std::size_t size, std::size_t count) { return size == 0 || size == count; };
  const std::size_t vertices = mesh.positions.size();
  const auto& numbers = attributes.vertex_numbers;
  if (!fits(attributes.vertex_colours.size(), vertices) || !fits(attributes.vertex_normals.size(), vertices) ||
      std::any_of(numbers.begin(), numbers.end(), [&](const auto& n) { return n.values.size() != vertices; }) ||
      !fits(attributes.face_colours.size(), mesh.triangles.size()) ||
      (attributes.texture_coordinates && !fits(attributes.texture_coordinates->corners.size(), mesh.triangles.size())))
    throw IoError(fmt::format(
        "{}: there must be as many colours, normals or values as the mesh has vertices or triangles", where));
  if (std::any_of(numbers.begin(), numbers.end(), [](const auto& n) { return n.name.empty(); }))
    throw IoError(fmt::format("{}: the numbers of the vertices need a name", where));
  check_finite(mesh, attributes, where);
}

}  // namespace

VertexColour bytes_of(const Colour& colour) {
  const auto byte = [](float x) { return static_cast<unsigned char>(std::lround(255 * std::clamp(x, 0.0f, 1.0f))); };
  return {byte(srgb_from_linear(colour[0])), byte(srgb_from_linear(colour[1])), byte(srgb_from_linear(colour[2])),
          byte(colour[3])};
}

void write_mesh(const std::filesystem::path& path, const TriangleMesh& mesh, const WrittenAttributes& attributes) {
  const std::string extension = lower_case(path.extension().string());
  constexpr std::array kEndings{".ply", ".obj", ".stl", ".glb"};
  if (std::find(kEndings.begin(), kEndings.end(), extension) == kEndings.end())
    throw IoError(
        fmt::format("{}: meshes are written as .ply, .obj, .stl or .glb, not as \"{}\"", path.string(), extension));
  check_attributes(mesh, attributes, path.string());
  if (extension == ".glb") {
    MeshAttributes own;
    own.normals.values.assign(attributes.vertex_normals.begin(), attributes.vertex_normals.end());
    for (const auto& [r, g, b, a] : attributes.vertex_colours)
      own.colours.values.emplace_back(linear_from_srgb(r / 255.f), linear_from_srgb(g / 255.f),
                                      linear_from_srgb(b / 255.f), a / 255.f);
    return write_gltf(path, scene_of(mesh, own, path.stem().string()));
  }
  std::string material_file;
  if (extension == ".obj" && attributes.texture_coordinates && !attributes.image_file.empty()) {
    const std::filesystem::path material = std::filesystem::path(path).replace_extension(".mtl");
    material_file = material.filename().string();
    write_text_atomically(material, fmt::format("newmtl {}\nKd 1 1 1\nmap_Kd {}\n", kMaterial, attributes.image_file));
  }
  write_atomically(path, [&](const std::filesystem::path& temporary) {
    OutputFile file(temporary, path);
    if (extension == ".ply")
      write_ply(file, mesh, attributes);
    else if (extension == ".stl")
      write_stl(file, mesh);
    else
      write_obj(file, mesh, attributes, material_file);
    file.close();
  });
}

void write_mesh(const std::filesystem::path& path, const TriangleMesh& mesh, const MeshAttributes& attributes) {
  if (lower_case(path.extension().string()) == ".glb")
    return write_gltf(path, scene_of(mesh, attributes, path.stem().string()));
  std::vector<VertexColour> colours;
  for (const Colour& colour : attributes.colours.values) colours.push_back(bytes_of(colour));
  WrittenAttributes written;
  written.vertex_colours = colours;
  written.vertex_normals = attributes.normals.values;
  for (const VertexNumbers& numbers : attributes.numbers)
    written.vertex_numbers.push_back({numbers.name, numbers.values});
  if (!attributes.texture_coordinates.empty()) written.texture_coordinates = &attributes.texture_coordinates;
  if (!attributes.materials.empty()) written.image_file = attributes.materials[0].image_file.string();
  write_mesh(path, mesh, written);
}

}  // namespace skeletex
