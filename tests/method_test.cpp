// SPDX-License-Identifier: MIT
#include "skeletex/convert/parameterize/method.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/SparseLU>
#include <algorithm>
#include <cmath>

#include "skeletex/analysis/manifold.h"
#include "skeletex/analysis/metro.h"
#include "skeletex/convert/encode_model.h"
#include "skeletex/io/model_file.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "support/load_model.h"
#include "support/scratch.h"

namespace skeletex {
namespace {

/// A barycentric map with mean value weights (Floater 2003), solved on the host: a method that the library lacks.
class MeanValueMap : public ParameterizationMethod {
 public:
  std::vector<MapReport> map(ClContext&, std::span<Chart> charts, const MapOptions&) const override {
    std::vector<MapReport> reports;
    for (Chart& chart : charts) {
      solve(chart);
      reports.push_back({.flipped_triangles = count_flipped(chart)});
    }
    return reports;
  }

 private:
  /// tan(angle / 2) at a corner of a triangle.
  static double half_tangent(const Chart& chart, int half_edge) {
    const Triangle& t = chart.triangles[half_edge / 3];
    const int c = half_edge % 3;
    const Vec3 a = (chart.positions[t[(c + 1) % 3]] - chart.positions[t[c]]).normalized(),
               b = (chart.positions[t[(c + 2) % 3]] - chart.positions[t[c]]).normalized();
    return (a - b).norm() / std::max(1e-9, (a + b).norm());
  }

  static void solve(Chart& chart) {
    const HalfEdgeTable& table = chart.half_edges;
    const int count = static_cast<int>(chart.positions.size());
    std::vector<int> rows(count, -1);
    int row_count = 0;
    for (int i = 0; i < count; ++i)
      if (chart.kinds[i] == ChartVertex::kInner) rows[i] = row_count++;
    for (const bool is_u : {true, false}) {
      std::vector<double>& x = is_u ? chart.u : chart.v;
      std::vector<Eigen::Triplet<double>> entries;
      Eigen::VectorXd right = Eigen::VectorXd::Zero(row_count);
      for (int h = 0; h < static_cast<int>(table.twins.size()); ++h) {
        const int next = HalfEdgeTable::next(h), from = chart.triangles[h / 3][h % 3],
                  to = chart.triangles[h / 3][next % 3];
        if (rows[from] < 0 || (!is_u && is_pole(chart.kinds[to]))) continue;  // a pole has no v
        const double weight = (half_tangent(chart, h) + half_tangent(chart, HalfEdgeTable::next(table.twins[h]))) /
                              std::max(1e-9, (chart.positions[to] - chart.positions[from]).norm());
        entries.emplace_back(rows[from], rows[from], weight);
        if (!is_u) right[rows[from]] += weight * (chart.turns[h / 3][next % 3] - chart.turns[h / 3][h % 3]);
        if (rows[to] >= 0)
          entries.emplace_back(rows[from], rows[to], -weight);
        else
          right[rows[from]] += weight * x[to];
      }
      Eigen::SparseMatrix<double> matrix(row_count, row_count);
      matrix.setFromTriplets(entries.begin(), entries.end());
      const Eigen::SparseLU<Eigen::SparseMatrix<double>> solver(matrix);
      const Eigen::VectorXd solution = solver.solve(right);
      for (int i = 0; i < count; ++i)
        if (rows[i] >= 0) x[i] = solution[rows[i]];
    }
  }
};

Method mean_value_method() {
  static const Method method = register_method({"mean-value", false}, std::make_unique<MeanValueMap>());
  return method;
}

TEST(Method, ARegisteredOneEncodesWritesAndReads) {
  const Method method = mean_value_method();
  ClContext context;
  const TestModel bear = load_standard_model("bear");
  EncodeOptions options;
  options.width = options.height = 256;
  options.method = method;
  const EncodeResult encoded = encode_model(context, bear.mesh, bear.skeleton, options);
  for (const BoneReport& bone : encoded.report.bones) EXPECT_EQ(bone.flipped_triangles, 0) << bone.name;
  EXPECT_TRUE(encoded.report.snap) << "what is done with maps is done with this one";

  const ScratchFolder scratch;
  const auto path = scratch / "mean-value.skx.exr";
  write_model(path, encoded.model);
  const SkeletexModel model = read_model(path);
  for (const Patch& patch : model.patches) EXPECT_EQ(patch.method, method);
  const TriangleMesh mesh = reconstruct_mesh(context, model);
  EXPECT_TRUE(measure_manifold(mesh).is_closed_manifold());
  EXPECT_LT(symmetric_mean(measure_metro(context, bear.mesh, mesh)), 1e-4);
}

TEST(Method, NamesAreThoseOfTheTable) {
  for (const Method method : all_methods()) EXPECT_EQ(method_named(to_string(method)), method);
  EXPECT_TRUE(is_height_field(Method::kSpd));
  EXPECT_FALSE(is_height_field(Method::kVsm));
  EXPECT_THROW(register_method({"vsm", false}, std::make_unique<MeanValueMap>()), InputError);
  try {
    method_named("lscm");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("\"lscm\""), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("spd, vsm"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace skeletex
