// SPDX-License-Identifier: MIT
#include "skeletex/convert/sample/half_texels.h"

#include <Imath/half.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "skeletex/convert/encode_model.h"
#include "skeletex/reconstruct/lattice.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "support/load_model.h"

namespace skeletex {
namespace {

ClContext& device() {
  static ClContext context;
  return context;
}

using Planes = std::array<std::vector<float>, 3>;
Planes planes_of(const DisplacementTexture& texture) { return {texture.along, texture.around, texture.out}; }
SkeletexModel with_texels(SkeletexModel model, const Planes& planes) {
  model.texture.along = planes[0], model.texture.around = planes[1], model.texture.out = planes[2];
  return model;
}
bool is_half(float x) { return static_cast<float>(half(x)) == x; }
float nearest_half(float x) { return static_cast<float>(half(x)); }

/// The inner rows of all patches: act(texel, vertex of the lattice, whether a seam or a pole is next to its row).
template <class Act>
void for_each_inner(const SkeletexModel& model, const Lattice& lattice, const Act& act) {
  for (std::size_t bone = 0; bone < model.patches.size(); ++bone) {
    const Rectangle& r = model.patches[bone].rectangle;
    for (int row = 1; row + 1 < r.height; ++row)
      for (int j = 0; j < r.width; ++j)
        act(static_cast<std::size_t>(r.y + row) * model.texture.width + r.x + j,
            lattice.first_inner[bone] + (row - 1) * r.width + j, row == 1 || row == r.height - 2);
  }
}

struct Encoded {
  SkeletexModel exact, rounded;
  RoundingReport report;
  TriangleMesh mesh;  ///< of the exact one
  Lattice lattice;
};
Encoded encode(const std::string& name, std::optional<Method> method, int size, bool has_prefilter = true) {
  const TestModel source = load_standard_model(name);
  EncodeOptions options;
  options.width = options.height = size;
  options.method = method;
  options.has_prefilter = has_prefilter;
  Encoded encoded;
  encoded.exact = encode_model(device(), source.mesh, source.skeleton, options).model;
  options.has_half_texels = true;
  EncodeResult result = encode_model(device(), source.mesh, source.skeleton, options);
  encoded.rounded = std::move(result.model), encoded.report = *result.report.rounding;
  encoded.mesh = reconstruct_mesh(device(), encoded.exact);
  encoded.lattice = number_lattice(encoded.exact);
  return encoded;
}

/// The root of the mean over inner texels of the squared distances from the planes of the exact mesh's triangles
/// around, weighted by area.
double distance_from_planes(const Encoded& encoded, const SkeletexModel& model) {
  const std::vector<Vec3> points = lattice_positions(device(), model);
  std::vector<double> squares(points.size(), 0), areas(points.size(), 0);
  for (const Triangle& t : encoded.mesh.triangles) {
    const auto& p = encoded.mesh.positions;
    const Vec3 normal = (p[t[1]] - p[t[0]]).cross(p[t[2]] - p[t[0]]);
    const double area = normal.norm();
    if (area == 0) continue;
    for (const int vertex : t) {
      const double distance = normal.dot(points[vertex] - p[vertex]) / area;
      squares[vertex] += area * distance * distance, areas[vertex] += area;
    }
  }
  double sum = 0;
  int count = 0;
  for_each_inner(model, encoded.lattice, [&](std::size_t, int vertex, bool is_at_end) {
    // There the kernel has others than the strips' triangles.
    if (!is_at_end && areas[vertex] > 0) sum += squares[vertex] / areas[vertex], ++count;
  });
  return std::sqrt(sum / count);
}

SkeletexModel with_nearest(const SkeletexModel& model) {
  Planes planes = planes_of(model.texture);
  for (std::vector<float>& plane : planes) std::transform(plane.begin(), plane.end(), plane.begin(), nearest_half);
  return with_texels(model, planes);
}

TEST(HalfTexels, ArePointsNearTheSurfaceAsTheReportSays) {
  for (const char* const name : {"bear", "armadillo"})
    for (const int size : {128, 300}) {
      const Encoded encoded = encode(name, Method::kVsm, size);
      const double chosen = distance_from_planes(encoded, encoded.rounded),
                   nearest = distance_from_planes(encoded, with_nearest(encoded.exact));
      EXPECT_LT(chosen, 0.5 * nearest) << name << size;
      // By the derivative of points by texels, on the device, with the decoder's diagonals.
      EXPECT_NEAR(encoded.report.nearest, nearest, 0.05 * nearest) << name << size;
      EXPECT_NEAR(encoded.report.chosen, chosen, 0.1 * chosen) << name << size;
    }
}

TEST(HalfTexels, AreHalvesOfWhichSomeAreNotTheNearest) {
  const Encoded encoded = encode("bear", Method::kVsm, 128);
  const Planes exact = planes_of(encoded.exact.texture), rounded = planes_of(encoded.rounded.texture);
  int others = 0, all = 0;
  for_each_inner(encoded.exact, encoded.lattice, [&](std::size_t texel, int, bool) {
    bool is_other = false;
    for (int i = 0; i < 3; ++i) {
      EXPECT_TRUE(is_half(rounded[i][texel])) << texel;
      is_other = is_other || rounded[i][texel] != nearest_half(exact[i][texel]);
    }
    others += is_other, ++all;
  });
  EXPECT_GT(others, all / 2);
  // Seams and poles are not the kernel's.
  std::vector<char> is_inner(exact[0].size(), 0);
  for_each_inner(encoded.exact, encoded.lattice, [&](std::size_t texel, int, bool) { is_inner[texel] = 1; });
  for (std::size_t texel = 0; texel < is_inner.size(); ++texel)
    for (int i = 0; i < 3 && is_inner[texel] == 0; ++i) ASSERT_EQ(rounded[i][texel], exact[i][texel]) << texel;
}

TEST(HalfTexels, TurnNoMoreTrianglesThanTheNearest) {
  for (const char* const name : {"bear", "bunny00", "armadillo", "man"}) {
    const Encoded encoded = encode(name, Method::kVsm, 256);
    const auto turned = [&](const SkeletexModel& model) {
      const std::vector<Vec3> points = lattice_positions(device(), model);
      return std::count_if(encoded.mesh.triangles.begin(), encoded.mesh.triangles.end(), [&](const Triangle& t) {
        const auto normal_of = [&](const std::vector<Vec3>& p) -> Vec3 {
          return (p[t[1]] - p[t[0]]).cross(p[t[2]] - p[t[0]]);
        };
        return normal_of(points).dot(normal_of(encoded.mesh.positions)) < 0;
      });
    };
    const auto chosen = turned(encoded.rounded), nearest = turned(with_nearest(encoded.exact));
    RecordProperty(name, std::to_string(chosen) + " " + std::to_string(nearest));
    EXPECT_LE(static_cast<double>(chosen), 1.2 * static_cast<double>(nearest) + 10) << name;
  }
}

TEST(HalfTexels, OfSpdPatchesStayOnTheirRays) {
  const Encoded encoded = encode("bear", Method::kSpd, 96, false);
  const Planes exact = planes_of(encoded.exact.texture), rounded = planes_of(encoded.rounded.texture);
  for_each_inner(encoded.exact, encoded.lattice, [&](std::size_t texel, int, bool) {
    for (int i = 0; i < 3; ++i) ASSERT_EQ(rounded[i][texel], nearest_half(exact[i][texel])) << texel;
    ASSERT_LT(std::hypot(rounded[0][texel], rounded[1][texel]), 1e-5 * rounded[2][texel]);
  });
}

TEST(HalfTexels, OfAFinishedModelAreThoseOfTheEncoder) {
  for (const Method method : {Method::kVsm, Method::kSpd}) {
    const Encoded encoded = encode("bear", method, 128);
    const RoundedModel again = round_to_half(device(), encoded.exact);
    const Planes own = planes_of(encoded.rounded.texture), other = planes_of(again.model.texture);
    int same = 0, all = 0;
    for_each_inner(encoded.exact, encoded.lattice, [&](std::size_t texel, int, bool) {
      for (int i = 0; i < 3; ++i) {
        EXPECT_TRUE(is_half(other[i][texel]));
        same += own[i][texel] == other[i][texel], ++all;
      }
    });
    // Its points are those of the texels in single precision, so that a choice can fall the other way.
    EXPECT_GT(same, 0.97 * all);
    EXPECT_NEAR(again.report.nearest, encoded.report.nearest, 0.01 * encoded.report.nearest);
    EXPECT_NEAR(again.report.chosen, encoded.report.chosen, 0.02 * encoded.report.chosen);
    // What is rounded stays.
    const Planes twice = planes_of(round_to_half(device(), again.model).model.texture);
    for_each_inner(encoded.exact, encoded.lattice, [&](std::size_t texel, int, bool) {
      for (int i = 0; i < 3; ++i) EXPECT_EQ(other[i][texel], twice[i][texel]);
    });
  }
}

}  // namespace
}  // namespace skeletex
