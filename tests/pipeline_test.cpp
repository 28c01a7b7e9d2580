// SPDX-License-Identifier: MIT
// The main path from end to end: mesh and skeleton -> model -> mesh.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <numeric>

#include "skeletex/analysis/manifold.h"
#include "skeletex/analysis/metro.h"
#include "skeletex/convert/encode_model.h"
#include "skeletex/convert/resample/resample.h"
#include "skeletex/io/model_file.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "support/load_model.h"
#include "support/shapes.h"

namespace skeletex {
namespace {

const char* const kStandardModels[] = {
    "armadillo", "bear",     "bear_bis", "bull",       "bull_16",      "bunny00",     "bunny00_9",      "cactus",
    "camel",     "camel_16", "cow",      "diplodocus", "double_torus", "eight",       "eight_dumbbell", "eight_theta",
    "homer",     "knot1",    "man",      "pinion",     "pinion_5",     "triceratops", "triceratops_17"};

/// Every method for all bones, and each bone's own.
const std::optional<Method> kMethodChoices[] = {Method::kVsm, Method::kSpd, std::nullopt};

std::string name_of(const std::optional<Method>& method) { return method ? to_string(*method) : "hybrid"; }

void expect_watertight(const TriangleMesh& mesh, int genus, const std::string& what) {
  const ManifoldReport report = measure_manifold(mesh);
  EXPECT_TRUE(report.is_closed_manifold())
      << what << ": " << report.boundary_edges.size() << " boundary edges, " << report.non_manifold_edges.size()
      << " non-manifold edges, " << report.misoriented_edges.size() << " misoriented";
  EXPECT_EQ(report.components, 1) << what;
  EXPECT_EQ(report.genus, genus) << what;
  EXPECT_TRUE(report.non_finite_vertices.empty()) << what;
  EXPECT_GT(signed_volume(mesh), 0) << what;
}

}  // namespace

class StandardModel : public testing::TestWithParam<const char*> {};

TEST_P(StandardModel, ComesBackClosedByEveryMethod) {
  ClContext context;
  const TestModel model = load_standard_model(GetParam());
  for (const std::optional<Method>& method : kMethodChoices) {
    EncodeOptions options;
    options.method = method;
    options.width = options.height = 128;
    const EncodeResult encoded = encode_model(context, model.mesh, model.skeleton, options);
    const std::string what = model.name + " method " + name_of(method);
    EXPECT_GE(encoded.report.used_fraction, 0.95) << what;
    double area = 0;
    for (const BoneReport& bone : encoded.report.bones) {
      area += bone.area;
      if (bone.method == Method::kVsm) {
        EXPECT_EQ(bone.flipped_triangles, 0) << what << " " << bone.name;
      }
    }
    EXPECT_NEAR(area, surface_area(model.mesh), 1e-9 * area) << what;
    expect_watertight(reconstruct_mesh(context, encoded.model), encoded.report.genus, what);
    for (const int size : {32, 81})
      expect_watertight(reconstruct_mesh(context, resample_model(context, encoded.model, size)), encoded.report.genus,
                        what + " at " + std::to_string(size));
  }
}

TEST_P(StandardModel, ComesBackClosedWithTexelsThatAreSnappedAndFitted) {
  ClContext context;
  const TestModel model = load_standard_model(GetParam());
  EncodeOptions options;
  options.width = options.height = 96;
  options.has_snap = options.has_fit = true;
  const EncodeResult encoded = encode_model(context, model.mesh, model.skeleton, options);
  expect_watertight(reconstruct_mesh(context, encoded.model), encoded.report.genus, model.name);
}

INSTANTIATE_TEST_SUITE_P(All, StandardModel, testing::ValuesIn(kStandardModels),
                         [](const auto& parameter) { return std::string(parameter.param); });

TEST(Pipeline, ErrorFallsAsTheTextureGrows) {
  ClContext context;
  const TestModel model = load_standard_model("bear");
  double last = 1;
  for (const auto& [size, limit] : {std::pair{128, 7e-5}, std::pair{512, 1e-6}}) {
    EncodeOptions options;
    options.width = options.height = size;
    const EncodeResult encoded = encode_model(context, model.mesh, model.skeleton, options);
    const double mean = symmetric_mean(measure_metro(context, model.mesh, reconstruct_mesh(context, encoded.model)));
    EXPECT_LT(mean, limit);
    EXPECT_LT(mean, last);
    last = mean;
  }
}

TEST(Hybrid, IsNotWorseThanTheBetterMethodByMoreThanAFifth) {
  ClContext context;
  struct Case {
    const char* name;
    int size;
    std::optional<bool> has_snap;  // SPD cannot snap
  };
  for (const Case& each : {Case{"bunny00", 512, false}, Case{"bear", 128, false}, Case{"bear_bis", 256, {}},
                           Case{"bull", 128, {}}, Case{"camel", 96, {}}}) {
    const TestModel model = load_standard_model(each.name);
    const auto mean_error = [&](std::optional<Method> method) {
      EncodeOptions options;
      options.method = method;
      options.width = options.height = each.size;
      options.has_snap = options.has_fit = each.has_snap;
      return symmetric_mean(
          measure_metro(context, model.mesh,
                        reconstruct_mesh(context, encode_model(context, model.mesh, model.skeleton, options).model)));
    };
    const double better = std::min(mean_error(Method::kVsm), mean_error(Method::kSpd));
    const double ratio = mean_error(std::nullopt) / better;
    RecordProperty(each.name, std::to_string(ratio));
    EXPECT_LE(ratio, 1.2) << each.name;
  }
}

TEST(Pipeline, ASecondEncodeGivesTheSameBytes) {
  ClContext context;
  const TestModel model = load_standard_model("eight");
  EncodeOptions options;
  options.width = 96, options.height = 64;
  const EncodeResult first = encode_model(context, model.mesh, model.skeleton, options),
                     second = encode_model(context, model.mesh, model.skeleton, options);
  EXPECT_EQ(first.model.texture.along, second.model.texture.along);
  EXPECT_EQ(first.model.texture.around, second.model.texture.around);
  EXPECT_EQ(first.model.texture.out, second.model.texture.out);
}

TEST(Pipeline, AModelSurvivesItsFileBitByBit) {
  ClContext context;
  const TestModel model = load_standard_model("bear");
  EncodeOptions options;
  options.width = options.height = 128;
  const SkeletexModel encoded = encode_model(context, model.mesh, model.skeleton, options).model;
  const auto path = std::filesystem::temp_directory_path() / "skeletex_pipeline_test.skx.exr";
  write_model(path, encoded);
  const TriangleMesh before = reconstruct_mesh(context, encoded), after = reconstruct_mesh(context, read_model(path));
  std::filesystem::remove(path);
  EXPECT_EQ(before.triangles, after.triangles);
  EXPECT_EQ(before.positions, after.positions);
}

TEST(Pipeline, ThePapersRecipeAndOtherOptionsWorkOnGeneratedShapes) {
  ClContext context;
  for (const auto& [name, genus, shape] : all_shapes()) {
    EncodeOptions options;
    options.width = 80, options.height = 56;
    options.vsm = {1, 0, 0};
    options.row_spacing = RowSpacing::kUniform;
    options.has_prefilter = false;
    options.texel_share = TexelShare::kArea;
    for (const Method method : {Method::kVsm, Method::kSpd}) {
      options.method = method;
      const EncodeResult encoded = encode_model(context, shape.mesh, shape.skeleton, options);
      expect_watertight(reconstruct_mesh(context, encoded.model), genus, name);
    }
  }
}

}  // namespace skeletex
