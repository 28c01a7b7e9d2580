// SPDX-License-Identifier: MIT
#include "skeletex/model/mesh_attributes.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "skeletex/io/image_file.h"
#include "skeletex/io/mesh/mesh_builder.h"
#include "skeletex/io/mesh_file.h"
#include "skeletex/model/error.h"
#include "support/corrupted.h"
#include "support/scratch.h"

namespace skeletex {
namespace {

MeshFile read_as(const ScratchFolder& folder, const std::string& name, const std::string& bytes) {
  write_bytes(folder / name, bytes);
  return read_mesh(folder / name);
}

Vec3 srgb_bytes(const Colour& colour) {
  Vec3 bytes;
  for (int i = 0; i < 3; ++i) bytes[i] = std::round(255 * srgb_from_linear(colour[i]));
  return bytes;
}

/// A picture of 2 x 2 pixels.
ColourImage four_pixels() { return {2, 2, {255, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 255, 255, 255, 255, 128}}; }

TEST(MeshAttributes, CornersOfAnObjKeepTheirNormalsAndTextureCoordinatesInTheFan) {
  const ScratchFolder folder;
  const MeshFile file = read_as(folder, "m.obj",
                                "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 1 1 0 0 0 1\nv 0 1 0\n"
                                "vn 0 0 2\nvn 1 0 1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
                                "f 1 2 3\nf 2/2/2 2/2/2 3/3/1 4/4/1 1/1/1\nf 1//9 3/9 4\n");
  const MeshAttributes& attributes = file.attributes;
  ASSERT_EQ(file.mesh.triangles, (std::vector<Triangle>{{0, 1, 2}, {1, 2, 3}, {1, 3, 0}, {0, 2, 3}}));
  EXPECT_EQ(attributes.texture_coordinates.corners,
            (std::vector<Triangle>{{-1, -1, -1}, {1, 2, 3}, {1, 3, 0}, {-1, -1, -1}}));
  // Corners without a normal take that of their triangle.
  ASSERT_EQ(attributes.normals.corners.size(), 4u);
  for (std::size_t t = 0; t < 4; ++t)
    for (int k = 0; k < 3; ++k) {
      const Vec3& normal = attributes.normals.values[attributes.normals.corners[t][k]];
      const bool is_second = (t == 1 || t == 2) && k == 0;
      EXPECT_LT((normal - (is_second ? Vec3(1, 0, 1).normalized() : Vec3(0, 0, 1))).norm(), 1e-12);
    }
  ASSERT_EQ(attributes.colours.values.size(), 4u);
  EXPECT_EQ(srgb_bytes(attributes.colours.values[1]), Vec3(0, 255, 0));
  EXPECT_EQ(srgb_bytes(attributes.colours.values[3]), Vec3(255, 255, 255));
}

TEST(MeshAttributes, ValuesThatNoFaceOfAnObjNamesAreThoseOfTheVerticesOrNone) {
  const std::string vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\n", face = "f 1 2 3\n";
  for (const std::string normal : {"vn 0 0 1\n", "vn 0 0 0\n"}) {
    const MeshAttributes one = read_obj(vertices + normal + "vt 0 0\n" + face, "one.obj").attributes;
    EXPECT_TRUE(one.normals.empty());
    EXPECT_TRUE(one.texture_coordinates.empty());
  }
  const MeshAttributes each =
      read_obj(vertices + "vn 0 0 2\nvn 1 0 0\nvn 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n" + face, "each.obj").attributes;
  ASSERT_EQ(each.normals.values.size(), 3u);
  EXPECT_EQ(each.normals.values[0], Vec3(0, 0, 1));
  EXPECT_TRUE(each.normals.corners.empty());
  EXPECT_EQ(each.texture_coordinates.values.size(), 3u);
}

TEST(MeshAttributes, MaterialsOfAnObjComeFromItsFiles) {
  const ScratchFolder folder;
  write_image(folder / "two by two.png", four_pixels());
  write_bytes(folder / "m.mtl",
              "newmtl skin\nKd 0 0 0\nmap_Kd -s 1 1 1 -clamp on two by two.png\nnewmtl cloth\nKd 1 0.5 0\nnewmtl "
              "unused\nmap_Kd none.png\n");
  MeshFile file = read_as(folder, "m.obj",
                          "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\nusemtl skin\nf 3 2 1\nusemtl cloth\nf 1 2 "
                          "3\nusemtl skin\nf 3 1 2\n");
  EXPECT_EQ(file.attributes.triangle_materials, (std::vector<int>{-1, 0, 1, 0}));
  EXPECT_TRUE(read_materials(folder / "m.obj", file).empty());
  ASSERT_EQ(file.attributes.materials.size(), 2u);
  EXPECT_EQ(file.attributes.materials[0].image.rgba, four_pixels().rgba);
  EXPECT_EQ(file.attributes.materials[0].base, Colour(1, 1, 1, 1));
  EXPECT_EQ(srgb_bytes(file.attributes.materials[1].base), Vec3(255, 128, 0));

  MeshFile lost = read_as(folder, "lost.obj", "mtllib none.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl a\nf 1 2 3\n");
  const std::vector<std::string> missing = read_materials(folder / "lost.obj", lost);
  ASSERT_EQ(missing.size(), 1u);
  EXPECT_NE(missing[0].find("none.mtl"), std::string::npos);

  write_bytes(folder / "bad.png", "\x89PNG\r\n\x1a\n and then nothing of use");
  write_bytes(folder / "bad.mtl", "newmtl a\nmap_Kd bad.png\n");
  MeshFile bad = read_as(folder, "bad.obj", "mtllib bad.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl a\nf 1 2 3\n");
  EXPECT_THROW(read_materials(folder / "bad.obj", bad), IoError);
}

TEST(MeshAttributes, PlyBringsNormalsColoursAndNamedNumbers) {
  const ScratchFolder folder;
  const std::string header =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty float "
      "nx\nproperty float ny\nproperty float nz\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty float quality\nproperty int label\n"
      "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
  const MeshFile file = read_as(folder, "m.ply",
                                header +
                                    "0 0 0 0 0 1 255 0 7 0.5 3\n1 0 0 0 3 4 1 2 3 -1 4\n0 1 0 0 0 0 9 9 9 2 5\n3 0 "
                                    "1 2\n");
  const MeshAttributes& attributes = file.attributes;
  EXPECT_EQ(srgb_bytes(attributes.colours.values[0]), Vec3(255, 0, 7));
  EXPECT_EQ(attributes.colours.values[0][3], 1.f);
  ASSERT_EQ(attributes.numbers.size(), 2u);
  EXPECT_EQ(attributes.numbers[0].name, "quality");
  EXPECT_EQ(attributes.numbers[0].values, (std::vector<float>{0.5f, -1, 2}));
  EXPECT_EQ(attributes.numbers[1].values, (std::vector<float>{3, 4, 5}));
  // A normal of length 0 is none.
  EXPECT_LT((attributes.normals.values[attributes.normals.of(file.mesh, 0)[1]] - Vec3(0, 0.6, 0.8)).norm(), 1e-12);
  EXPECT_EQ(attributes.normals.values[attributes.normals.of(file.mesh, 0)[2]], Vec3(0, 0, 1));
}

TEST(MeshAttributes, OffBringsNormalsAndColours) {
  const ScratchFolder folder;
  const MeshFile bytes =
      read_as(folder, "a.off", "COFF\n3 1 0\n0 0 0 255 0 7 255\n1 0 0 1 2 3 255\n0 1 0 0 0 0 255\n3 0 1 2\n");
  EXPECT_EQ(srgb_bytes(bytes.attributes.colours.values[0]), Vec3(255, 0, 7));
  EXPECT_EQ(bytes.attributes.colours.values[0][3], 1.f);
  const MeshFile shares =
      read_as(folder, "b.off", "CNOFF\n3 1 0\n0 0 0 0 0 2 1 0 0.5\n1 0 0 0 0 1 1 1 1\n0 1 0 0 0 1 0 0 0\n3 0 1 2\n");
  EXPECT_EQ(srgb_bytes(shares.attributes.colours.values[0]), Vec3(255, 0, 128));
  EXPECT_EQ(shares.attributes.normals.values[0], Vec3(0, 0, 1));
}

TEST(Images, PngComesBackByteForByteAndDamagedFilesAreRefused) {
  const ScratchFolder folder;
  const ColourImage image = four_pixels();
  write_image(folder / "a.png", image);
  EXPECT_EQ(read_image(folder / "a.png").rgba, image.rgba);
  const std::string bytes = read_bytes(folder / "a.png");
  EXPECT_THROW(decode_image(bytes.substr(0, bytes.size() / 2), "half"), IoError);
  EXPECT_THROW(decode_image("GIF89a", "gif"), IoError);
  EXPECT_THROW(decode_image("\xff\xd8\xff\xe0 no jpeg", "jpeg"), IoError);
}

}  // namespace
}  // namespace skeletex
