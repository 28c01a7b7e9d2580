// SPDX-License-Identifier: MIT
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>

#include "skeletex/analysis/manifold.h"
#include "skeletex/io/atomic_file.h"
#include "skeletex/model/error.h"
#include "support/corrupted.h"
#include "support/full_disk.h"
#include "support/load_model.h"
#include "support/scratch.h"
#include "support/shapes.h"

namespace skeletex {
namespace {

constexpr std::uint64_t kSeed = 20260102;

std::string error_of(const std::function<void()>& run) {
  try {
    run();
  } catch (const IoError& error) {
    return error.what();
  }
  return "no error";
}

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

/// Reads `bytes` as a file of the given ending.
MeshFile read_as(const ScratchFolder& folder, const std::string& extension, const std::string& bytes) {
  write_bytes(folder / ("mesh" + extension), bytes);
  return read_mesh(folder / ("mesh" + extension));
}
std::string message_as(const ScratchFolder& folder, const std::string& extension, const std::string& bytes) {
  return error_of([&] { read_as(folder, extension, bytes); });
}

template <typename T>
void put(std::string& bytes, T value, bool is_big_endian = false) {
  char raw[sizeof value];
  std::memcpy(raw, &value, sizeof value);
  if (is_big_endian) std::reverse(raw, raw + sizeof value);
  bytes.append(raw, sizeof value);
}

const std::vector<Vec3> kTetrahedron{{0, 0, 0}, {1, 0, 0}, {0, 1.5, 0}, {0, 0, -2.25}};
const std::vector<Triangle> kTetrahedronFaces{{0, 1, 2}, {0, 3, 1}, {0, 2, 3}, {1, 3, 2}};

const std::string kObj =
    "# a tetrahedron\nmtllib none.mtl\nv 0 0 0\nv 1 0 0 0.5 0.5 0.5\nv 0 1.5 0\nvn 0 0 1\nv 0 0 -2.25\nf 1 2 3\nf 1//1 "
    "4//1 2//1\nf -4 -2 -1\nf 2/7/1 4/8/1 3/9\n";
const std::string kOff =
    "OFF\n# a tetrahedron\n4 4 0\n0 0 0\n1 0 0 # second\n0 1.5 0\n\n0 0 -2.25\n3 0 1 2\n3 0 3 1 255 0 0\n3 0 2 3\n3 1 "
    "3 2\n";
const std::string kPly =
    "ply\nformat ascii 1.0\ncomment made by hand\nelement vertex 4\nproperty float x\nproperty float y\nproperty float "
    "z\nelement face 4\n"
    "property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1.5 0\n0 0 -2.25\n3 0 1 2\n3 0 3 1\n3 0 2 "
    "3\n3 1 3 2\n";

std::string stl_ascii() {
  std::string text = "solid an outer shell\n";
  for (const Triangle& t : kTetrahedronFaces) {
    text += "facet normal nan 0 0\n  outer loop\n";
    for (const int i : t)
      text += fmt::format("    vertex {} {} {}\n", kTetrahedron[i][0], kTetrahedron[i][1], kTetrahedron[i][2]);
    text += "  endloop\nendfacet\n";
  }
  return text + "endsolid\n";
}

std::string stl_binary(const std::vector<Triangle>& triangles = kTetrahedronFaces) {
  std::string bytes = "solid is what binary files begin with, too";
  bytes.resize(80);
  put(bytes, static_cast<std::uint32_t>(triangles.size()));
  for (const Triangle& t : triangles) {
    bytes.append(12, '\0');
    for (const int i : t)
      for (const double x : kTetrahedron[i]) put(bytes, static_cast<float>(x));
    bytes.append(2, '\0');
  }
  return bytes;
}

/// With all that PLY allows: other types, lists at vertices, properties before the indices, elements of no use.
std::string ply_binary(bool is_big_endian) {
  std::string bytes = std::string("ply\nformat binary_") + (is_big_endian ? "big" : "little") +
                      "_endian 1.0\nobj_info x\nelement camera 2\nproperty list ushort short what\nproperty float64 "
                      "f\nelement vertex 4\nproperty uchar red\nproperty double x\n"
                      "property float32 y\nproperty float z\nproperty list uint8 double weights\nelement nothing "
                      "2000000000\nelement face 4\nproperty uchar intensity\n"
                      "property list uint ushort vertex_index\nproperty list char float uv\nelement edge 1\nproperty "
                      "int a\nend_header\n";
  for (int i = 0; i < 2; ++i) {
    put(bytes, static_cast<std::uint16_t>(i), is_big_endian);
    for (int k = 0; k < i; ++k) put(bytes, std::int16_t{-3}, is_big_endian);
    put(bytes, 0.5, is_big_endian);
  }
  for (const Vec3& p : kTetrahedron) {
    put(bytes, std::uint8_t{200});
    put(bytes, p[0], is_big_endian);
    put(bytes, static_cast<float>(p[1]), is_big_endian);
    put(bytes, static_cast<float>(p[2]), is_big_endian);
    put(bytes, std::uint8_t{1});
    put(bytes, 1.0, is_big_endian);
  }
  for (const Triangle& t : kTetrahedronFaces) {
    put(bytes, std::uint8_t{1});
    put(bytes, std::uint32_t{3}, is_big_endian);
    for (const int i : t) put(bytes, static_cast<std::uint16_t>(i), is_big_endian);
    put(bytes, std::int8_t{0});
  }
  put(bytes, 7, is_big_endian);
  return bytes;
}

const std::vector<std::pair<std::string, std::string>>& small_files() {
  static const std::vector<std::pair<std::string, std::string>> files{{".obj", kObj},
                                                                      {".off", kOff},
                                                                      {".ply", kPly},
                                                                      {".stl", stl_ascii()},
                                                                      {".stl", stl_binary()},
                                                                      {".ply", ply_binary(false)},
                                                                      {".ply", ply_binary(true)}};
  return files;
}

TEST(MeshFiles, EveryFormatGivesTheSameTetrahedron) {
  const ScratchFolder folder;
  for (const auto& [extension, bytes] : small_files()) {
    SCOPED_TRACE(extension + " " + bytes.substr(0, 60));
    const MeshFile file = read_as(folder, extension, bytes);
    EXPECT_EQ(file.faces_in_file, 4);
    EXPECT_EQ(file.triangles, 4);
    EXPECT_EQ(file.degenerate_faces, 0);
    EXPECT_EQ(file.vertices_in_file, extension == ".stl" ? 12 : 4);
    EXPECT_EQ(file.merged_vertices, extension == ".stl" ? 8 : 0);
    EXPECT_EQ(file.mesh.positions.size(), 4u);
    const ManifoldReport report = measure_manifold(file.mesh);
    EXPECT_TRUE(report.is_closed_manifold());
    EXPECT_NEAR(signed_volume(file.mesh), 0.5625, 1e-12);
    if (extension != ".stl") {
      EXPECT_EQ(file.mesh.positions, kTetrahedron);
    }
    if (extension == ".off" || extension == ".ply") {
      EXPECT_EQ(file.mesh.triangles, kTetrahedronFaces);
    }
  }
}

TEST(MeshFiles, TextMayHaveAnyLineEndsSpacesAndContinuations) {
  const ScratchFolder folder;
  for (const auto& [extension, text] : {small_files()[0], small_files()[1], small_files()[2], small_files()[3]}) {
    for (const std::string end : {"\r\n", "\r", " \t\n", "\n\n"}) {
      if (extension == ".ply" && end == "\n\n") continue;
      std::string other;
      for (const char c : text) other += c == '\n' ? end : std::string(1, c);
      EXPECT_EQ(read_as(folder, extension, other).mesh.triangles.size(), 4u) << extension;
    }
    EXPECT_EQ(read_as(folder, extension, text.substr(0, text.size() - 1)).mesh.triangles.size(), 4u);
  }
  EXPECT_EQ(read_as(folder, ".OBJ", "v 0 0 \\\n0\nv +1 0 0\nv 0 1e0 0\nf 1 \\\r\n 2 3\n").triangles, 1);
  EXPECT_EQ(read_as(folder, ".off", "\n# first\nCOFF 3 1\n0 0 0 1 1 1\n1 0 0 .5 .5 .5\n0 1 0 0 0 0\n3 0 1 2").triangles,
            1);
}

TEST(MeshFiles, TextMayBeginWithAByteOrderMark) {
  const ScratchFolder folder;
  for (const auto& [extension, text] : {small_files()[0], small_files()[1], small_files()[2], small_files()[3]})
    EXPECT_EQ(read_as(folder, extension, "\xef\xbb\xbf" + text).mesh.triangles.size(), 4u) << extension;
}

TEST(MeshFiles, ObjMayHaveAByteOrderMarkBeforeItsFirstVertex) {
  const ScratchFolder folder;
  const auto& [extension, text] = small_files()[0];
  ASSERT_EQ(extension, ".obj");
  const MeshFile good = read_as(folder, extension, text);
  std::string marked = text;
  marked.insert(marked.find("v "), "\xef\xbb\xbf");
  const MeshFile file = read_as(folder, extension, "# put together\n" + marked);
  EXPECT_EQ(file.mesh.positions, good.mesh.positions);
  EXPECT_EQ(file.mesh.triangles, good.mesh.triangles);
  EXPECT_TRUE(contains(message_as(folder, extension, "v 0 0 0\n\xc2\xa0v 1 0 0\nv 0 1 0\nf 1 2 3\n"), "line 2"));
}

TEST(MeshFiles, ObjThatEndsInAFaceSaysSo) {
  const ScratchFolder folder;
  const std::string vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  EXPECT_TRUE(contains(message_as(folder, ".obj", vertices + "f 1 2 3\nf 1 2"), "line 5: the file ends within a face"));
  EXPECT_TRUE(read_as(folder, ".obj", vertices + "f 1 2 3").ends_in_face);
  EXPECT_FALSE(read_as(folder, ".obj", vertices + "f 1 2 3\n").ends_in_face);
}

TEST(MeshFiles, FarFromTheOriginAndBeyondSinglePrecisionTheyAreWrittenAsDoubles) {
  const ScratchFolder folder;
  for (const auto& [scale, offset] : {std::pair{1.0, 1e6}, {1e-40, 0.0}, {1e39, 0.0}})
    for (const char* name : {"m.ply", "m.obj"}) {
      TriangleMesh mesh{kTetrahedron, kTetrahedronFaces};
      for (Vec3& p : mesh.positions) p = scale / 3 * p + Vec3::Constant(offset);
      write_mesh(folder / name, mesh);
      EXPECT_EQ(read_mesh(folder / name).mesh.positions, mesh.positions) << name << ' ' << scale;
    }
}

TEST(MeshFiles, NumbersKeepDoublePrecision) {
  const ScratchFolder folder;
  const std::string numbers = "0.1234567890123456 -1e-50 100000.00000000001";
  const Vec3 expected(0.1234567890123456, -1e-50, 100000.00000000001);
  const std::string others = "1 0 0\n0 1 0\n";
  EXPECT_EQ(read_as(folder, ".off", "OFF\n3 1 0\n" + numbers + "\n" + others + "3 0 1 2\n").mesh.positions[0],
            expected);
  EXPECT_EQ(read_as(folder, ".obj", "v " + numbers + "\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").mesh.positions[0], expected);
  const auto ply = [](const std::string& format, const std::string& values) {
    return "ply\nformat " + format +
           " 1.0\nelement vertex 3\nproperty double x\nproperty double y\nproperty double z\n"
           "element face 1\nproperty list uchar int vertex_indices\nend_header\n" +
           values;
  };
  EXPECT_EQ(read_as(folder, ".ply", ply("ascii", numbers + "\n" + others + "3 0 1 2\n")).mesh.positions[0], expected);
  for (const bool is_big : {false, true}) {
    std::string values;
    for (const Vec3& p : {expected, Vec3(1, 0, 0), Vec3(0, 1, 0)})
      for (const double x : p) put(values, x, is_big);
    put(values, std::uint8_t{3});
    for (const int i : {0, 1, 2}) put(values, i, is_big);
    const std::string format = is_big ? "binary_big_endian" : "binary_little_endian";
    EXPECT_EQ(read_as(folder, ".ply", ply(format, values)).mesh.positions[0], expected);
  }
}

TEST(MeshFiles, StlMergesCornersThatAreEqualInSinglePrecision) {
  const ScratchFolder folder;
  std::string text = stl_ascii();
  const std::size_t at = text.find("vertex 1 0 0", text.find("vertex 1 0 0") + 1);
  text.replace(at, 12, "vertex 1.00000000001 -0.0 0");
  const MeshFile file = read_as(folder, ".stl", text);
  EXPECT_EQ(file.mesh.positions.size(), 4u);
  EXPECT_EQ(file.merged_vertices, 8);
}

TEST(MeshFiles, PolygonsBecomeFansAndFacesAreCountedInAndOut) {
  const ScratchFolder folder;
  const MeshFile file = read_as(
      folder, ".off",
      "OFF\n6 5 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n0.5 2 0\n5 5 5\n4 0 1 2 3\n5 0 1 2 4 3\n3 0 1 1\n2 0 1\n4 0 1 1 2\n");
  EXPECT_EQ(file.faces_in_file, 5);
  EXPECT_EQ(file.degenerate_faces, 2);
  EXPECT_EQ(file.triangles, 2 + 3 + 1);
  EXPECT_EQ(file.mesh.triangles,
            (std::vector<Triangle>{{0, 1, 2}, {0, 2, 3}, {0, 1, 2}, {0, 2, 4}, {0, 4, 3}, {0, 1, 2}}));
  EXPECT_EQ(file.mesh.positions.size(), 6u) << "a vertex without faces is kept for validation";
  const MeshFile obj = read_as(folder, ".obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\nf 1 2 2\nf 1 2\nf\n");
  EXPECT_EQ(obj.faces_in_file, 4);
  EXPECT_EQ(obj.degenerate_faces, 3);
  EXPECT_EQ(obj.triangles, 1);
  const MeshFile stl = read_as(folder, ".stl", stl_binary({{0, 1, 2}, {0, 1, 1}, {0, 2, 3}}));
  EXPECT_EQ(stl.faces_in_file, 3);
  EXPECT_EQ(stl.degenerate_faces, 1);
  EXPECT_EQ(stl.triangles, 2);
}

TEST(MeshFiles, FacesThatAreNotManifoldAreKept) {
  const ScratchFolder folder;
  // Three triangles at one edge, one twice, one the other way round: OpenMesh's own importer drops most of these.
  const std::string faces = "3 0 1 2\n3 0 1 3\n3 0 1 4\n3 0 1 2\n3 0 2 1\n";
  const MeshFile file = read_as(folder, ".off", "OFF\n5 5 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n0 -1 0\n" + faces);
  EXPECT_EQ(file.triangles, 5);
}

TEST(MeshFiles, NumbersThatAreNoneAreLeftToValidation) {
  const ScratchFolder folder;
  for (const std::string extension : {".obj", ".off", ".ply"}) {
    const std::string v = extension == ".obj" ? "v " : "";
    std::string text =
        extension == ".off" ? "OFF\n3 1 0\n"
        : extension == ".ply"
            ? "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
              "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
            : "";
    text += v + "0 nan 0\n" + v + "1 0 -inf\n" + v + "1e400 1e39 1e-400\n" +
            (extension == ".obj" ? "f 1 2 3\n" : "3 0 1 2\n");
    const MeshFile file = read_as(folder, extension, text);
    ASSERT_EQ(file.mesh.positions.size(), 3u);
    EXPECT_TRUE(std::isnan(file.mesh.positions[0][1]));
    EXPECT_EQ(file.mesh.positions[0][0], 0);
    EXPECT_EQ(file.mesh.positions[1], Vec3(1, 0, -std::numeric_limits<double>::infinity()));
    EXPECT_EQ(file.mesh.positions[2], Vec3(std::numeric_limits<double>::infinity(), 1e39, 0));
    EXPECT_EQ(file.triangles, 1);
  }
}

TEST(MeshFiles, ErrorsNameFileLineAndReason) {
  const ScratchFolder folder;
  struct Case {
    std::string extension, bytes;
    std::vector<std::string> parts;
  };
  const auto replaced = [](std::string text, const std::string& from, const std::string& to) {
    return text.replace(text.find(from), from.size(), to);
  };
  const std::vector<Case> cases{
      {".off", replaced(kOff, "1.5", "1,5"), {"mesh.off: line 6:", "\"1,5\""}},
      {".off", replaced(kOff, "3 0 2 3", "3 0 2 4"), {"line 11:", "vertex 4 does not exist", "0 to 3"}},
      {".off", replaced(kOff, "3 0 2 3", "3 0 2 -1"), {"line 11:", "vertex -1"}},
      {".off", replaced(kOff, "3 0 2 3", "4 0 2 3"), {"line 11:", "4 corners"}},
      {".off", replaced(kOff, "4 4 0", "5 4 0"), {"line 13:", "after 3 of 4 faces"}},
      {".off", replaced(kOff, "4 4 0", "4 2000000000 0"), {"after 4 of 2000000000 faces"}},
      {".off", replaced(kOff, "4 4 0", "3000000000 4 0"), {"line 3:", "more than can be read"}},
      {".off", replaced(kOff, "OFF", "4OFF"), {"line 1:", "4OFF"}},
      {".off", replaced(kOff, "OFF", "OFF BINARY"), {"binary OFF"}},
      {".off", "solid", {"not an OFF file"}},
      {".off", "OFF\n0 0 0\n", {"no faces"}},
      {".obj", replaced(kObj, "f 1 2 3", "f 1 2 9"), {"line 8: vertex 9 does not exist; the file has 4"}},
      {".obj", replaced(kObj, "f 1 2 3", "f 1 2 0"), {"line 8:", "\"0\""}},
      {".obj", replaced(kObj, "f 1 2 3", "f 1 2 /3"), {"line 8:", "\"/3\""}},
      {".obj", replaced(kObj, "-4 -2", "-5 -2"), {"line 10:", "vertex -5 does not exist"}},
      {".obj", replaced(kObj, "v 0 1.5 0", "v 0 1.5"), {"line 5:", "three coordinates"}},
      {".obj", replaced(kObj, "f 1 2 3", "f 1 2 3 2"), {"line 8:", "twice"}},
      {".obj", "nothing of the kind\n", {"no faces"}},
      {".ply", replaced(kPly, "3 0 2 3", "3 0 2 4"), {"line 17:", "vertex 4"}},
      {".ply", replaced(kPly, "face 4", "face 5"), {"line 19:", "after 4 of 5"}},
      {".ply", replaced(kPly, "end_header\n", ""), {"line 10:", "found \"0\""}},
      {".ply", replaced(kPly, "property float z\n", ""), {"x, y and z"}},
      {".ply", replaced(kPly, "property float z", "property quad z"), {"line 7:", "type"}},
      {".ply", replaced(kPly, "vertex_indices", "corners"), {"vertex_indices"}},
      {".ply", replaced(kPly, "ascii", "utf8"), {"line 2:", "\"utf8\""}},
      {".ply", ply_binary(false).substr(0, ply_binary(false).size() - 9), {"face 3 (of 4)", "ends after 3 of 4"}},
      {".ply", "OFF\n", {"not a PLY file"}},
      {".stl", replaced(stl_ascii(), "vertex 1 0 0", "vertex 1 0 inf"), {"line 5:", "inf"}},
      {".stl", replaced(stl_ascii(), "endloop", "vertex"), {"line 7:", "\"endloop\" is expected"}},
      {".stl", stl_ascii().substr(0, 200), {"ends in triangle 1"}},
      {".stl", replaced(stl_ascii(), "endsolid\n", ""), {"without \"endsolid\""}},
      {".stl", stl_binary().substr(0, 200), {"after 2 of 4 triangles"}},
      {".stl", "short", {"not an STL file"}},
      {".xyz", "0 0 0\n", {".obj, .off, .ply and .stl"}},
      {".obj", "", {"the file is empty"}},
  };
  for (const Case& c : cases) {
    const std::string message = message_as(folder, c.extension, c.bytes);
    EXPECT_TRUE(contains(message, "mesh" + c.extension)) << message;
    for (const std::string& part : c.parts)
      EXPECT_TRUE(contains(message, part)) << "expected \"" << part << "\" in: " << message;
  }
  EXPECT_TRUE(contains(error_of([&] { read_mesh(folder / "none.obj"); }), "cannot open"));
  EXPECT_TRUE(contains(error_of([&] { read_mesh(folder.path()); }), "folder"));
}

TEST(MeshFiles, CutAtAnyLineOrByteTheyAreRefused) {
  const ScratchFolder folder;
  for (const auto& [extension, bytes] : small_files()) {
    const bool is_binary = bytes.find('\0') != std::string::npos;
    if (extension == ".obj") continue;  // OBJ announces nothing
    for (std::size_t size = 0; size + (is_binary ? 1 : 9) < bytes.size(); ++size)
      if (is_binary || bytes[size] == '\n') {
        EXPECT_NE(message_as(folder, extension, bytes.substr(0, size)), "no error") << extension << " cut at " << size;
      }
  }
}

TEST(MeshFiles, ReadsOrRefusesDamagedFilesButNeverCrashes) {
  const ScratchFolder folder;
  for (const auto& [extension, good] : small_files()) {
    int refused = 0;
    for_each_corruption(good, 1000, kSeed, [&](const std::string& bytes) {
      try {
        const MeshFile file = read_as(folder, extension, bytes);
        for (const Triangle& t : file.mesh.triangles)
          for (const int i : t) ASSERT_TRUE(i >= 0 && i < static_cast<int>(file.mesh.positions.size()));
        ASSERT_EQ(file.triangles, static_cast<int>(file.mesh.triangles.size()));
      } catch (const IoError&) {
        ++refused;
      }
    });
    EXPECT_GT(refused, 100) << extension;
  }
}

TEST(MeshFiles, WrittenMeshesComeBackAsTheyWere) {
  const ScratchFolder folder;
  TriangleMesh mesh = transformed(mushroom_shape(16).mesh, random_similarity(kSeed));
  // What both formats can hold: single precision.
  for (Vec3& p : mesh.positions)
    for (double& x : p) x = static_cast<float>(x);
  mesh.positions[0] = {1e-30f, -0.1f, 3e37f};
  for (const char* name : {"a.ply", "a.obj", "A.PLY"}) {
    write_mesh(folder / name, mesh);
    const MeshFile file = read_mesh(folder / name);
    EXPECT_EQ(file.mesh.triangles, mesh.triangles);
    ASSERT_EQ(file.mesh.positions.size(), mesh.positions.size());
    for (std::size_t i = 0; i < mesh.positions.size(); ++i)
      EXPECT_EQ(file.mesh.positions[i].cast<float>(), mesh.positions[i].cast<float>()) << name << " " << i;
  }
  EXPECT_EQ(folder.file_count(), 3);
  EXPECT_TRUE(contains(error_of([&] { write_mesh(folder / "a.stl", mesh); }), ".ply or .obj"));
}

TEST(MeshFiles, PlyCarriesColoursAndAProperty) {
  const ScratchFolder folder;
  const TriangleMesh mesh{kTetrahedron, kTetrahedronFaces};
  const std::vector<VertexColour> vertex_colours{{1, 2, 3}, {4, 5, 6}, {7, 8, 9}, {10, 11, 12}},
      face_colours{{255, 0, 0}, {0, 255, 0}, {0, 0, 255}, {9, 9, 9}};
  const std::vector<float> distances{0.25f, 0.5f, 1, 2};
  write_mesh(folder / "m.ply", mesh, {vertex_colours, face_colours, "distance", distances, {}});
  const std::string bytes = read_bytes(folder / "m.ply");
  const std::string header =
      "ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float "
      "z\nproperty uchar red\nproperty uchar green\n"
      "property uchar blue\nproperty float distance\nelement face 4\nproperty list uchar int vertex_indices\nproperty "
      "uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n";
  ASSERT_EQ(bytes.substr(0, header.size()), header);
  ASSERT_EQ(bytes.size(), header.size() + 4 * (12 + 3 + 4) + 4 * (1 + 12 + 3));
  std::string second;
  for (const float x : {1.0f, 0.0f, 0.0f}) put(second, x);
  second += "\4\5\6";
  put(second, 0.5f);
  EXPECT_EQ(bytes.substr(header.size() + 19, 19), second);
  EXPECT_EQ(bytes.substr(bytes.size() - 3), "\t\t\t");
  EXPECT_EQ(read_mesh(folder / "m.ply").mesh.positions, kTetrahedron);
  EXPECT_TRUE(contains(error_of([&] {
                         write_mesh(folder / "n.ply", mesh, {vertex_colours, {}, "", distances, {}});
                       }),
                       "name"));
  EXPECT_TRUE(contains(error_of([&] {
                         write_mesh(folder / "n.ply", mesh, {std::span(vertex_colours).first(3), {}, "", {}, {}});
                       }),
                       "as many"));
  EXPECT_EQ(folder.file_count(), 1);
}

TEST(AtomicFiles, AreWhollyWrittenOrNotAtAll) {
  const ScratchFolder folder;
  const auto path = folder / "file";
  write_text_atomically(path, "before");
  EXPECT_THROW(write_atomically(path,
                                [](const std::filesystem::path& temporary) {
                                  write_bytes(temporary, "half");
                                  throw std::runtime_error("interrupted");
                                }),
               std::runtime_error);
  EXPECT_EQ(read_bytes(path), "before");
  EXPECT_EQ(folder.file_count(), 1);
  for (const rlim_t space : {0, 1, 4000, 9999}) {
    const FullDisk disk(space);
    const std::string message = error_of([&] { write_text_atomically(path, std::string(10000, 'x')); });
    EXPECT_TRUE(contains(message, "file: cannot write")) << message;
  }
  const TriangleMesh mesh = capsule_shape().mesh;
  for (const char* name : {"m.ply", "m.obj"}) {
    const FullDisk disk(3000);
    EXPECT_TRUE(contains(error_of([&] { write_mesh(folder / name, mesh); }), "cannot write"));
  }
  EXPECT_EQ(read_bytes(path), "before");
  EXPECT_EQ(folder.file_count(), 1);
  write_text_atomically(path, "after");
  EXPECT_EQ(read_bytes(path), "after");
}

TEST(AtomicFiles, SayWhatIsWrongWithTheFolderOrTheName) {
  const ScratchFolder folder;
  write_text_atomically(folder / "file", "x");
  EXPECT_TRUE(contains(error_of([&] { write_text_atomically(folder / "none/file", "x"); }), "does not exist"));
  EXPECT_TRUE(contains(error_of([&] { write_text_atomically(folder / "file/file", "x"); }), "does not exist"));
  EXPECT_TRUE(contains(error_of([&] { write_text_atomically(folder.path(), "x"); }), "is a folder"));
  EXPECT_TRUE(contains(error_of([&] { write_text_atomically("", "x"); }), "not a file name"));
  EXPECT_TRUE(contains(error_of([&] { write_text_atomically(folder / std::string(300, 'a'), "x"); }), "cannot write"));
  if (::geteuid() != 0) {  // whom permissions do not bind
    std::filesystem::permissions(folder.path(),
                                 std::filesystem::perms::owner_read | std::filesystem::perms::owner_exec);
    EXPECT_TRUE(contains(error_of([&] { write_text_atomically(folder / "new", "x"); }), "cannot write in"));
    std::filesystem::permissions(folder.path(), std::filesystem::perms::owner_all);
  }
  EXPECT_EQ(folder.file_count(), 1);
}

TEST(AtomicFiles, FollowLinksAndLeaveDevicesInPlace) {
  const ScratchFolder folder;
  write_text_atomically(folder / "file", "before");
  std::filesystem::create_symlink("file", folder / "link");
  write_text_atomically(folder / "link", "after");
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "link"));
  EXPECT_EQ(read_bytes(folder / "file"), "after");
  write_text_atomically("/dev/null", "nothing");
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/null"));
}

const char* const kSkeleton = R"({"mesh": "x.off",
 "nodes": [
  {"name": "hip", "position": [0.1, -0.0, 1e-7]},
  {"name": "knee", "position": [0, 0, -1]},
  {"position": [0, 0.333333333333333314829616256247, -2]}],
 "bones": [
  {"name": "thigh", "head": 0, "tail": "knee", "s": [1, 0, 0], "colour": "red"},
  {"name": "shin", "head": "knee", "tail": "node_2"}]})";

TEST(SkeletonFiles, NameNodesByIndexOrNameAndComeBackBitByBit) {
  const ScratchFolder folder;
  write_bytes(folder / "s.json", kSkeleton);
  const Skeleton skeleton = read_skeleton(folder / "s.json");
  ASSERT_EQ(skeleton.nodes.size(), 3u);
  ASSERT_EQ(skeleton.bones.size(), 2u);
  EXPECT_EQ(skeleton.nodes[2].name, "node_2");
  EXPECT_EQ(skeleton.bones[0].tail, 1);
  EXPECT_EQ(skeleton.bones[1].tail, 2);
  EXPECT_EQ(*skeleton.bones[0].s, Vec3(1, 0, 0));
  EXPECT_FALSE(skeleton.bones[1].s.has_value());
  const Skeleton again = skeleton_from_json(nlohmann::json::parse(skeleton_to_json(skeleton).dump()), "again");
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_EQ(std::memcmp(again.nodes[i].position.data(), skeleton.nodes[i].position.data(), 3 * sizeof(double)), 0);
  EXPECT_EQ(skeleton_to_json(again), skeleton_to_json(skeleton));
}

TEST(SkeletonFiles, ErrorsNameLineOrEntry) {
  const ScratchFolder folder;
  const auto message = [&](const std::string& from, const std::string& to) {
    std::string text = kSkeleton;
    text.replace(text.find(from), from.size(), to);
    write_bytes(folder / "s.json", text);
    return error_of([&] { read_skeleton(folder / "s.json"); });
  };
  const std::vector<std::array<std::string, 3>> cases{
      {"-1]},", "-1}},", "s.json: line 4: not JSON"},
      {"\"knee\", \"position\"", "\"hip\", \"position\"", "nodes[1] (\"hip\"): the name is already that of nodes[0]"},
      {"\"shin\"", "\"thigh\"", "bones[1] (\"thigh\"): the name is already"},
      {"[0, 0, -1]", "[0, 0]", "nodes[1] (\"knee\"), \"position\": three numbers"},
      {"[0, 0, -1]", "[0, \"0\", -1]", "a finite number"},
      {"[0, 0, -1]", "[0, 1e999, -1]", "number overflow"},
      {"\"position\": [0, 0, -1]", "\"at\": 1", "\"position\" is missing"},
      {"\"head\": 0", "\"head\": 3", "bones[0] (\"thigh\"), \"head\": a whole number from 0 to 2"},
      {"\"head\": 0", "\"head\": -1", "a whole number from 0 to 2"},
      {"\"head\": 0", "\"head\": 0.5", "the index or the name of a node"},
      {"\"head\": 0", "\"head\": 18446744073709551615", "a whole number from 0 to 2"},
      {"\"tail\": \"knee\"", "\"tail\": \"ankle\"", "there is no node \"ankle\""},
      {"\"tail\": \"knee\"", "\"tail\": 0", "head and tail are the same node"},
      {"[1, 0, 0]", "[0, 0, 0]", "\"s\": the zero vector"},
      {"\"bones\"", "\"bodies\"", "\"bones\" is missing"},
      {"{\"mesh\": \"x.off\",", "[", "s.json: line"},
  };
  for (const auto& [from, to, part] : cases)
    EXPECT_TRUE(contains(message(from, to), part)) << part << ": " << message(from, to);
  write_bytes(folder / "s.json", R"({"nodes":[],"bones":[]})");
  EXPECT_TRUE(contains(error_of([&] { read_skeleton(folder / "s.json"); }), "no bones"));
  write_bytes(folder / "s.json", std::string(200000, '['));
  EXPECT_TRUE(contains(error_of([&] { read_skeleton(folder / "s.json"); }), "not JSON"));
  write_bytes(folder / "s.json", "[1]");
  EXPECT_TRUE(contains(error_of([&] { read_skeleton(folder / "s.json"); }), "an object"));
}

TEST(SkeletonFiles, ReadsOrRefusesDamagedFilesButNeverCrashes) {
  const ScratchFolder folder;
  int refused = 0;
  for_each_corruption(kSkeleton, 3000, kSeed, [&](const std::string& bytes) {
    write_bytes(folder / "s.json", bytes);
    try {
      for (const Bone& bone : read_skeleton(folder / "s.json").bones) ASSERT_NE(bone.head, bone.tail);
    } catch (const IoError&) {
      ++refused;
    }
  });
  EXPECT_GT(refused, 1000);
}

TEST(ModelConfigs, ResolvePathsAgainstTheirOwnFolder) {
  const ScratchFolder folder;
  write_bytes(folder / "m.json", R"({"name":"m","mesh":"../meshes/m.off","skeleton":"/s.json","credits":"nobody"})");
  const ModelConfig config = read_model_config(folder / "m.json");
  EXPECT_EQ(config.mesh, folder.path().parent_path() / "meshes/m.off");
  EXPECT_EQ(config.skeleton, "/s.json");
  write_bytes(folder / "m.json", R"({"name":"m","mesh":3})");
  EXPECT_TRUE(contains(error_of([&] { read_model_config(folder / "m.json"); }), "\"mesh\": a string"));
}

TEST(StandardModels, EveryConfigNamesAClosedMeshAndASkeletonThatCanBeRead) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(SKELETEX_SOURCE_DIR "/configs/models")) {
    const std::string name = entry.path().stem().string();
    SCOPED_TRACE(name);
    const ModelConfig config = read_model_config(entry.path());
    EXPECT_EQ(config.name, name);
    EXPECT_FALSE(config.credits.empty());
    const MeshFile file = read_mesh(config.mesh);
    EXPECT_EQ(file.degenerate_faces, 0);
    EXPECT_GE(file.triangles, file.faces_in_file);
    EXPECT_TRUE(measure_manifold(file.mesh).is_closed_manifold());
    EXPECT_GT(signed_volume(file.mesh), 0);
    const Skeleton skeleton = read_skeleton(config.skeleton);
    EXPECT_EQ(bone_bases(skeleton).size(), skeleton.bones.size());
    ++count;
  }
  EXPECT_EQ(count, 23);
}

}  // namespace
}  // namespace skeletex
