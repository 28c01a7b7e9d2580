// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <fstream>
#include <numbers>

#include "skeletex/convert/encode_model.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/pose/pose_mesh.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/render/draw.h"
#include "skeletex/render/gpu_model.h"
#include "skeletex/render/scene.h"
#include "skeletex/render/texture_image.h"
#include "skeletex/skeleton/pose.h"
#include "support/scratch.h"
#include "support/shapes.h"

namespace skeletex {
namespace {

GlContext& gl() {
  static GlContext context;
  return context;
}
ClContext& cl() {
  static ClContext context;
  return context;
}

SkeletexModel model_of(const Shape& shape, Method method) {
  EncodeOptions options;
  options.width = options.height = 64;
  options.method = method;
  return encode_model(cl(), shape.mesh, shape.skeleton, options).model;
}

double largest_difference(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  double largest = a.size() == b.size() ? 0 : std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) largest = std::max(largest, (a[i] - b[i]).norm());
  return largest;
}

TEST(Render, ShaderAndLibraryPlaceEveryVertexAlikeInEveryPose) {
  for (const NamedShape& named :
       {NamedShape{"creature", 0, creature_shape()}, {"torus", 1, torus_shape()}, {"capsule", 0, capsule_shape()}})
    for (const Method method : {Method::kVsm, Method::kSpd}) {
      SCOPED_TRACE(named.name + " " + to_string(method));
      const SkeletexModel model = model_of(named.shape, method);
      const TriangleMesh bind = reconstruct_mesh(cl(), model);
      GpuSurface surface = upload_surface(gl(), bind);
      EXPECT_LT(largest_difference(download_positions(surface), bind.positions), 1e-6 * model.diagonal);
      const GpuModel device = upload_model(model);
      displace(gl(), device, model, model.skeleton, DistanceRule::kFromBone, surface);
      EXPECT_LT(largest_difference(download_positions(surface), bind.positions), 1e-5 * model.diagonal);
      if (named.genus > 0) continue;  // rotations are for trees
      Pose pose;
      for (std::size_t i = 0; i < model.skeleton.bones.size(); ++i)
        pose.rotations.push_back(Eigen::Quaterniond(Eigen::AngleAxisd(
            0.3 + 0.1 * static_cast<double>(i % 5), Vec3(1, static_cast<double>(i % 3), 0.5).normalized())));
      const Skeleton posed = apply_pose(model.skeleton, pose);
      for (const DistanceRule rule : {DistanceRule::kFromBone, DistanceRule::kFromFoot}) {
        displace(gl(), device, model, posed, rule, surface);
        EXPECT_LT(largest_difference(download_positions(surface),
                                     reconstruct_mesh(cl(), model, posed, {Deformation::kPaper, rule}).positions),
                  1e-5 * model.diagonal);
      }
      const Skin skin = make_skin(cl(), model, row_points(cl(), model, RowChoice::kInner));
      const GpuSkin gpu_skin = upload_skin(skin, bind);
      Skeleton stretched = posed;
      for (Node& node : stretched.nodes) node.position *= 1.3;
      for (const Skeleton& skeleton : {posed, stretched}) {
        pose_skin(gl(), gpu_skin, skin, bone_motions(model.skeleton, skeleton), skeleton, surface);
        EXPECT_LT(largest_difference(download_positions(surface), reconstruct_mesh(cl(), model, skeleton).positions),
                  1e-5 * model.diagonal);
      }
    }
}

/// Coverage by edge functions at pixel centres, in double.
std::vector<bool> rasterize(const TriangleMesh& mesh, const Camera& camera, int width, int height) {
  std::vector<bool> mask(static_cast<std::size_t>(width) * height, false);
  for (const Triangle& t : mesh.triangles) {
    Eigen::Vector2d p[3];
    for (int c = 0; c < 3; ++c) {
      const Vec3 q = mesh.positions[t[c]] - camera.eye;
      const double depth = camera.is_orthographic ? 1 : -camera.back.dot(q);
      p[c] = {(0.5 + 0.5 * camera.right.dot(q) / (camera.tan_x * depth)) * width,
              (0.5 - 0.5 * camera.up.dot(q) / (camera.tan_y * depth)) * height};
    }
    const auto cross = [](const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); };
    const double area = cross(p[1] - p[0], p[2] - p[0]);
    if (area == 0) continue;
    const auto [x0, x1] = std::minmax({p[0].x(), p[1].x(), p[2].x()});
    const auto [y0, y1] = std::minmax({p[0].y(), p[1].y(), p[2].y()});
    for (int y = std::max(0, static_cast<int>(y0)); y < std::min<double>(height, y1 + 1); ++y)
      for (int x = std::max(0, static_cast<int>(x0)); x < std::min<double>(width, x1 + 1); ++x) {
        const Eigen::Vector2d centre(x + 0.5, y + 0.5);
        bool is_inside = true;
        for (int c = 0; c < 3; ++c) is_inside &= cross(p[(c + 1) % 3] - p[c], centre - p[c]) / area >= 0;
        if (is_inside) mask[static_cast<std::size_t>(y) * width + x] = true;
      }
  }
  return mask;
}

TEST(Render, CoversThePixelsThatAnIndependentRasterizerCovers) {
  const Shape shape = creature_shape();
  const GpuSurface surface = upload_surface(gl(), shape.mesh);
  for (const double fov : {0.0, 35.0}) {
    const View view{.azimuth_deg = 40, .elevation_deg = 20, .fov_deg = fov};
    const int width = 320, height = 200;
    const Camera camera = fit_camera(view, shape.mesh.positions, width, height);
    const Image image =
        draw(gl(), surface, {}, camera, {.width = width, .height = height, .samples = 1, .sky_lights = 8});
    const std::vector<bool> mask = rasterize(shape.mesh, camera, width, height);
    int covered = 0, different = 0;
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        const bool is_drawn = image.at(x, y)[3] > 0.5f, is_expected = mask[static_cast<std::size_t>(y) * width + x];
        covered += is_expected;
        different += is_drawn != is_expected;
      }
    EXPECT_GT(covered, width * height / 8);
    EXPECT_LE(different, covered / 500);  // centres within rounding of an edge
  }
}

TEST(Render, FitsEveryPointIntoThePictureAndFillsIt) {
  const Shape shape = creature_shape();
  for (const double fov : {0.0, 20.0, 70.0})
    for (const auto& [width, height] : {std::array{400, 200}, {200, 400}, {300, 300}})
      for (const double azimuth : {0.0, 77.0, 200.0})
        for (const double elevation : {-90.0, 0.0, 35.0, 90.0}) {
          const Camera camera = fit_camera({.azimuth_deg = azimuth, .elevation_deg = elevation, .fov_deg = fov},
                                           shape.mesh.positions, width, height);
          const Eigen::Matrix4d matrix = view_projection(camera, Vec3::Zero());
          double largest = 0;
          for (const Vec3& p : shape.mesh.positions) {
            const Eigen::Vector4d clip = matrix * p.homogeneous();
            ASSERT_GT(clip.w(), 0);
            largest = std::max({largest, std::abs(clip.x() / clip.w()), std::abs(clip.y() / clip.w())});
            ASSERT_LE(std::abs(clip.z() / clip.w()), 1);
          }
          EXPECT_NEAR(largest, 0.92, 0.01) << "fov " << fov << ", azimuth " << azimuth << ", elevation " << elevation;
        }
}

TEST(Render, TurnsATableAtOneDistanceWithEveryPointInEveryPicture) {
  const std::vector<Vec3> points = creature_shape().mesh.positions;
  for (const double fov : {0.0, 20.0, 70.0})
    for (const double elevation : {-90.0, 0.0, 35.0}) {
      const View view{.azimuth_deg = 12, .elevation_deg = elevation, .fov_deg = fov};
      const std::vector<Camera> cameras = turntable(view, points, 400, 300, 7);
      ASSERT_EQ(cameras.size(), 7u);
      EXPECT_LT((cameras[0].back - fit_camera(view, points, 400, 300).back).norm(), 1e-12);
      double largest = 0;
      for (std::size_t i = 0; i < cameras.size(); ++i) {
        // One turn about the up axis carries each camera to the next, and the last to the first.
        const Eigen::AngleAxisd step(2 * std::numbers::pi / 7, Vec3::UnitY());
        const Camera& next = cameras[(i + 1) % cameras.size()];
        EXPECT_LT((step * cameras[i].back - next.back).norm(), 1e-9);
        EXPECT_LT((step * cameras[i].right - next.right).norm(), 1e-9);
        EXPECT_NEAR(next.eye.y(), cameras[0].eye.y(), 1e-9);
        EXPECT_EQ(next.tan_x, cameras[0].tan_x);
        const Eigen::Matrix4d matrix = view_projection(cameras[i], Vec3::Zero());
        for (const Vec3& p : points) {
          const Eigen::Vector4d clip = matrix * p.homogeneous();
          ASSERT_GT(clip.w(), 0);
          ASSERT_LE(std::abs(clip.z() / clip.w()), 1);
          largest = std::max({largest, std::abs(clip.x() / clip.w()), std::abs(clip.y() / clip.w())});
        }
      }
      EXPECT_NEAR(largest, 0.92, 0.01) << "fov " << fov << ", elevation " << elevation;
    }
}

TEST(Render, TurnsTheModelsLeftSideToTheEyeAtNinetyDegrees) {
  const std::vector<Vec3> points{Vec3(-1, -1, -1), Vec3(1, 1, 1)};
  const Camera front = fit_camera({.azimuth_deg = 0, .elevation_deg = 0}, points, 100, 100);
  EXPECT_LT((front.back - Vec3::UnitZ()).norm(), 1e-12);
  EXPECT_LT((front.right - Vec3::UnitX()).norm(), 1e-12);
  const Camera left = fit_camera({.azimuth_deg = 90, .elevation_deg = 0}, points, 100, 100);
  EXPECT_LT((left.back - Vec3::UnitX()).norm(), 1e-12);
}

TEST(Render, NormalsOfARoundShapeAreRadial) {
  const Shape shape = capsule_shape(2, 0.5, 96, 72);
  const GpuSurface surface = upload_surface(gl(), shape.mesh);
  std::vector<float> normals(3 * shape.mesh.positions.size());
  surface.normals.read(normals.size() * sizeof(float), normals.data());
  double largest = 0;
  for (std::size_t i = 0; i < shape.mesh.positions.size(); ++i) {
    const Vec3 p = shape.mesh.positions[i];
    const Vec3 foot(0, 0, std::clamp(p.z(), -1.0, 1.0));
    largest = std::max(largest,
                       (Vec3(normals[3 * i], normals[3 * i + 1], normals[3 * i + 2]) - (p - foot).normalized()).norm());
  }
  EXPECT_LT(largest, 0.05);
}

TEST(Render, NormalsInTheFlatCornerOfACapAreThoseAroundIt) {
  // A plane, and in it between A and B a triangle that stands on edge: at the third vertex its angle is nearly half a
  // turn.
  TriangleMesh mesh{{Vec3(0, 0, 0), Vec3(2, 0, 0), Vec3(1, 0, 1e-3), Vec3(1, 1, 0), Vec3(1, -1, 0)},
                    {{0, 2, 3}, {2, 1, 3}, {0, 1, 2}, {0, 4, 1}}};
  const GpuSurface surface = upload_surface(gl(), mesh);
  std::vector<float> normals(3 * mesh.positions.size());
  surface.normals.read(normals.size() * sizeof(float), normals.data());
  EXPECT_GT(normals[3 * 2 + 2], 0.999);
}

TEST(Render, TrianglesUpsideDownInASurfaceLookLikeIt) {
  const TriangleMesh plate{{{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}}, {{0, 1, 2}, {0, 2, 3}}},
      partly_turned{plate.positions, {{0, 1, 2}, {0, 3, 2}}}, turned{plate.positions, {{0, 2, 1}, {0, 3, 2}}};
  for (const double fov : {0.0, 40.0})
    for (const double azimuth : {20.0, 200.0}) {  // from before and behind
      const Camera camera =
          fit_camera({.azimuth_deg = azimuth, .elevation_deg = 10, .fov_deg = fov}, plate.positions, 60, 60);
      const auto picture = [&](const TriangleMesh& mesh, const Vec3& normal) {
        GpuSurface surface = upload_surface(gl(), mesh);
        write_normals(surface, std::vector<Vec3>(mesh.positions.size(), normal));
        return draw(gl(), surface, {}, camera, {.width = 60, .height = 60, .samples = 1, .sky_lights = 8});
      };
      const Vec3 to_viewer = azimuth < 90 ? Vec3(Vec3::UnitZ()) : Vec3(-Vec3::UnitZ());
      const Image expected = picture(azimuth < 90 ? plate : turned, to_viewer);
      EXPECT_GT(expected.at(30, 30)[1], 0.05f);
      if (azimuth < 90) {
        EXPECT_EQ(picture(partly_turned, to_viewer).rgba, expected.rgba);
      }
      EXPECT_EQ(picture(plate, Vec3::UnitZ()).rgba, expected.rgba);  // from behind: the inside of an open surface
    }
}

TEST(Render, APartInShadowIsDarkerThanTheSamePartInTheOpen) {
  // A plate below the camera's light, with and without a smaller plate between.
  const auto plate = [](double size, double z, TriangleMesh& mesh) {
    const int first = static_cast<int>(mesh.positions.size());
    for (const auto& [x, y] : {std::array{-1, -1}, {1, -1}, {1, 1}, {-1, 1}})
      mesh.positions.emplace_back(size * x, size * y, z);
    mesh.triangles.push_back({first, first + 1, first + 2});
    mesh.triangles.push_back({first, first + 2, first + 3});
  };
  TriangleMesh open, shaded;
  plate(1, 0, open);
  plate(1, 0, shaded);
  plate(0.3, 0.4, shaded);
  const Camera camera = fit_camera({.azimuth_deg = 0, .elevation_deg = 0, .fov_deg = 0}, open.positions, 100, 100);
  const auto brightness = [&](const TriangleMesh& mesh) {
    const Image image = draw(gl(), upload_surface(gl(), mesh), {}, camera, {.width = 100, .height = 100, .samples = 1});
    return image.at(62, 66)[1];  // beside the small plate, away from the key light
  };
  EXPECT_LT(brightness(shaded), 0.8f * brightness(open));
  EXPECT_GT(brightness(shaded), 0.05f);
}

TEST(Render, NamesEachTrianglesBoneAndKeepsItsCheckerTogether) {
  const SkeletexModel model = model_of(creature_shape(), Method::kVsm);
  const Lattice lattice = number_lattice(model);
  const TriangleMesh mesh = reconstruct_mesh(cl(), model);
  const std::vector<int> bones = triangle_bones(lattice, mesh.triangles);
  std::vector<int> counts(model.patches.size(), 0);
  for (const int bone : bones) ++counts.at(bone);
  for (std::size_t bone = 0; bone < counts.size(); ++bone) {
    const Rectangle& rectangle = model.patches[bone].rectangle;
    EXPECT_GE(counts[bone], 2 * rectangle.width * (rectangle.height - 3)) << bone;  // its quads; and strips and fans
  }
  const int cells = 24;
  const std::vector<std::array<float, 2>> uv = checker_coordinates(model, mesh, cells);
  ASSERT_EQ(uv.size(), 3 * mesh.triangles.size());
  for (std::size_t i = 0; i < uv.size(); i += 3)
    for (int c = 0; c < 3; ++c) {
      ASSERT_TRUE(std::isfinite(uv[i + c][0]) && std::isfinite(uv[i + c][1]));
      ASSERT_LE(std::abs(uv[i][1] - uv[i + (c + 1) % 3][1]), 0.5f * cells + 1e-3f);
    }
}

TEST(Render, SkeletonsBecomeClosedMeshesWithABonePerTriangle) {
  const Skeleton skeleton = creature_shape().skeleton;
  const TriangleMesh mesh = skeleton_mesh(skeleton, 0.05);
  EXPECT_EQ(skeleton_mesh_bones(skeleton).size(), mesh.triangles.size());
  EXPECT_GT(signed_volume(mesh), 0);
}

TEST(Image, BlendsTilesAndComesBackFromDisk) {
  Image red = make_image(4, 2), blue = make_image(4, 2);
  for (int x = 0; x < 4; ++x) {
    red.at(x, 0)[0] = red.at(x, 0)[3] = 1;
    blue.at(x, 1)[2] = blue.at(x, 1)[3] = 0.5f;
  }
  Image both = red;
  blend_over(both, blue);
  EXPECT_FLOAT_EQ(both.at(0, 0)[0], 1);
  EXPECT_FLOAT_EQ(both.at(3, 1)[2], 0.5f);
  fill_background(both, {1, 1, 1});
  EXPECT_FLOAT_EQ(both.at(3, 1)[2], 1);
  EXPECT_FLOAT_EQ(both.at(3, 1)[0], 0.5f);
  const Image three = tile(std::array{red, blue, red}, 2);
  EXPECT_EQ(three.width, 8);
  EXPECT_EQ(three.height, 4);
  EXPECT_FLOAT_EQ(three.at(0, 2)[0], 1);
  const ScratchFolder scratch;
  write_png(scratch / "a.png", three);
  std::ifstream file(scratch / "a.png", std::ios::binary);
  std::string signature(8, '\0');
  file.read(signature.data(), 8);
  EXPECT_EQ(signature, "\x89PNG\r\n\x1a\n");
  EXPECT_THROW(write_png(scratch / "missing/a.png", three), IoError);
  EXPECT_THROW(write_exr_image(scratch / "missing/a.exr", three), IoError);
}

TEST(Image, TextureAndLayoutShowEveryTexel) {
  const SkeletexModel model = model_of(y_shape(), Method::kVsm);
  for (const Image& image : {map_image(model, 256), layout_image(model, 256)}) {
    EXPECT_EQ(image.width, 256);
    for (std::size_t i = 3; i < image.rgba.size(); i += 4) ASSERT_EQ(image.rgba[i], 1);
  }
}

TEST(View, RefusesWhatIsNoView) {
  const auto parse = [](const char* text) { return parse_view(nlohmann::json::parse(text), "view"); };
  const View view = parse(R"({"azimuth": 10, "fov": 0, "up": [0, 0, 1], "front": [0, -1, 0]})");
  EXPECT_EQ(view.azimuth_deg, 10);
  EXPECT_EQ(view.up, Vec3::UnitZ());
  for (const char* text :
       {"[1]", R"({"azimut": 1})", R"({"zoom": 0})", R"({"up": [0, 1]})", R"({"elevation": "high"})"})
    EXPECT_THROW(parse(text), IoError) << text;
  EXPECT_THROW(fit_camera({.up = Vec3::Zero()}, {}, 10, 10), InputError);
  EXPECT_THROW(fit_camera({.up = Vec3::UnitY(), .front = Vec3::UnitY()}, {}, 10, 10), InputError);
}

TEST(GlContext, NamesTheDevicesWhenThereIsNoSuchOne) {
  EXPECT_FALSE(gl().renderer().empty());
  EXPECT_THROW(GlContext("no such device"), DeviceError);
}

}  // namespace
}  // namespace skeletex
