// SPDX-License-Identifier: MIT
#include "skeletex/edit/filter/filter.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <Eigen/SparseCholesky>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <random>
#include <set>

#include "skeletex/analysis/metro.h"
#include "skeletex/convert/encode_model.h"
#include "skeletex/edit/filter/coarsen.h"
#include "skeletex/edit/filter/differential.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/reconstruct/store_positions.h"
#include "support/filter_twin.h"
#include "support/load_model.h"
#include "support/mesh_topology.h"
#include "support/shapes.h"
#include "support/synthetic_model.h"

namespace skeletex {
namespace {

ClContext& device() {
  static ClContext context;
  return context;
}

SkeletexModel synthetic(const Skeleton& skeleton, int width, int height, double radius = 0.25, double relief = 1) {
  return SyntheticSurface(skeleton, radius, relief)
      .model(std::vector<std::pair<int, int>>(skeleton.bones.size(), {width, height}));
}

/// The model with its vertices where `place` puts them.
SkeletexModel placed(const SkeletexModel& model, const std::function<Vec3(const Vec3&)>& place) {
  std::vector<Vec3> positions = lattice_positions(device(), model);
  for (Vec3& p : positions) p = place(p);
  return store_positions(device(), model, positions);
}

/// A surface on the device with its twin.
struct TwinSurface {
  ModelSurface surface;
  std::vector<Vec3> points;
  std::vector<twin::SharedTriangle> triangles;
  twin::SurfaceMatrices matrices;
};
TwinSurface twin_surface(const SkeletexModel& model) {
  TwinSurface result{upload_surface(device(), model), {}, {}, {}};
  result.points = download_vectors(device(), result.surface.points);
  const std::vector<Triangle> ends = end_triangles(model, result.surface.positions);
  result.triangles = twin::surface_triangles(model, result.surface.lattice, ends);
  result.matrices = twin::surface_matrices(result.triangles, result.points);
  return result;
}

std::vector<SkeletexModel> twin_models() {
  std::vector<SkeletexModel> models{synthetic(lone_bone(), 12, 9), synthetic(y_branch(), 4, 4),
                                    synthetic(ring_with_arm(5), 21, 17),
                                    SyntheticSurface(cross(6), 0.3).model(random_sizes(6, 4, 40, 3))};
  // Ugly: texels all over the place, and some of them at one point.
  SkeletexModel ugly = synthetic(chain(2), 16, 16);
  std::mt19937 random(7);
  for (float& x : ugly.texture.around) x += 0.05f * static_cast<float>(random() % 1000) / 1000;
  const Rectangle& r = ugly.patches[0].rectangle;
  for (int row = 3; row < 6; ++row)
    for (std::vector<float>* plane : {&ugly.texture.along, &ugly.texture.around, &ugly.texture.out})
      for (int j = 1; j < 4; ++j) {
        const std::size_t at = static_cast<std::size_t>(r.y + row) * ugly.texture.width + r.x + j;
        (*plane)[at] = (*plane)[at - 1];
      }
  models.push_back(ugly);
  return models;
}

std::vector<float> random_values(std::size_t count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> any(-1, 1);
  std::vector<float> values(count);
  for (float& x : values) x = any(random);
  return values;
}

double norm_of_difference(const std::vector<float>& a, const Eigen::VectorXd& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += std::pow(static_cast<double>(a[i]) - b[static_cast<int>(i)], 2);
  return std::sqrt(sum);
}

ClBuffer<float> everywhere(const ModelSurface& surface) {
  return device().upload(std::vector<float>(surface.neighbours.vertex_count, 1.f));
}

/// RMS over the area of a vertex value against a closed form, relative to that form's.
double relative_rms(const ModelSurface& surface, const std::vector<float>& values,
                    const std::function<double(const Vec3&)>& exact) {
  const std::vector<float> areas =
      device().download(make_surface_operator(device(), surface.neighbours, surface.points).mass);
  double error = 0, size = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double expected = exact(surface.positions[i]);
    error += areas[i] * std::pow(values[i] - expected, 2);
    size += areas[i] * expected * expected;
  }
  return std::sqrt(error / size);
}

void expect_same_texels(const SkeletexModel& a, const SkeletexModel& b, double tolerance) {
  double largest = 0;
  for (std::size_t i = 0; i < a.texture.out.size(); ++i) {
    largest = std::max(largest, static_cast<double>(std::abs(a.texture.along[i] - b.texture.along[i])));
    largest = std::max(largest, static_cast<double>(std::abs(a.texture.around[i] - b.texture.around[i])));
    largest = std::max(largest, static_cast<double>(std::abs(a.texture.out[i] - b.texture.out[i])));
  }
  EXPECT_LE(largest, tolerance);
}

/// The same model with other names and another order of bones.
SkeletexModel with_bones_reordered(const SkeletexModel& model, const std::vector<int>& permutation) {
  SkeletexModel result = model;
  for (std::size_t i = 0; i < permutation.size(); ++i) {
    result.skeleton.bones[permutation[i]] = model.skeleton.bones[i];
    result.skeleton.bones[permutation[i]].name = "other" + std::to_string(i);
    result.patches[permutation[i]] = model.patches[i];
    result.ends[permutation[i]] = model.ends[i];
  }
  for (SeamArc& arc : result.arcs)
    for (BoneIndex& bone : arc.bones) bone = permutation[bone];
  for (SeamCorner& corner : result.corners)
    for (BoneIndex& bone : corner.bones) bone = permutation[bone];
  return result;
}

}  // namespace

TEST(Neighbours, AreThoseOfTheMeshOnBothSidesOfEverySeam) {
  for (const SkeletexModel& model : twin_models()) {
    const Lattice lattice = number_lattice(model);
    const TriangleMesh mesh = reconstruct_mesh(device(), model);
    const Neighbours table = find_neighbours(model, lattice, end_triangles(model, mesh.positions));
    std::set<std::pair<int, int>> edges;  // of the mesh, at vertices in no row: poles, samples, corners
    for (const Triangle& t : mesh.triangles)
      for (int i = 0; i < 3; ++i)
        if (t[i] >= lattice.inner_count) edges.insert({t[i], t[(i + 1) % 3]});
    std::set<std::pair<int, int>> listed;
    for (std::size_t k = 0; k + 1 < table.fan_vertices.size(); ++k) {
      const auto [v, begin] = table.fan_vertices[k];
      const int end = table.fan_vertices[k + 1].begin;
      for (int i = begin; i < end; ++i) {
        if (v >= lattice.inner_count) listed.insert({v, table.fans[i][0]});
        const bool is_last = i + 1 == end;
        if (!is_last) {
          EXPECT_EQ(table.fans[i][1], table.fans[i + 1][0]);
        } else if (v >= lattice.inner_count) {
          EXPECT_EQ(table.fans[i][1], table.fans[begin][0]) << "the fan is not closed";
        }
      }
    }
    EXPECT_EQ(listed, edges);
  }
}

TEST(SurfaceOperator, EqualsTheCotangentLaplacianOfItsTriangles) {
  for (const SkeletexModel& model : twin_models()) {
    const TwinSurface twin = twin_surface(model);
    const int count = static_cast<int>(twin.points.size());
    const SurfaceOperator surface = make_surface_operator(device(), twin.surface.neighbours, twin.surface.points);
    // Relative rounding of a cotangent grows with the thinness of its triangle, here to 1 / 1.2e-4.
    const double tolerance = 2e-4;
    EXPECT_LT(norm_of_difference(device().download(surface.mass), twin.matrices.mass),
              1e-5 * twin.matrices.mass.norm());
    EXPECT_LT(norm_of_difference(device().download(surface.stiffness), twin.matrices.laplace.diagonal()),
              tolerance * twin.matrices.laplace.diagonal().norm());
    for (const int components : {1, 3}) {
      const std::vector<float> x = random_values(static_cast<std::size_t>(components) * count, 5);
      const std::vector<float> q = device().download(
          apply_operator(device(), surface, 0.5f, 0.01f, everywhere(twin.surface), {components, device().upload(x)})
              .values);
      for (int c = 0; c < components; ++c) {
        Eigen::VectorXd value(count);
        for (int i = 0; i < count; ++i) value[i] = x[static_cast<std::size_t>(c) * count + i];
        const Eigen::VectorXd expected =
            0.5 * twin.matrices.mass.cwiseProduct(value) + 0.01 * (twin.matrices.laplace * value);
        EXPECT_LT(norm_of_difference({q.begin() + c * count, q.begin() + (c + 1) * count}, expected),
                  tolerance * expected.norm());
      }
    }
    std::vector<float> ones(count, 1.f);
    for (const float value : device().download(
             apply_operator(device(), surface, 0, 1, everywhere(twin.surface), {1, device().upload(ones)}).values))
      EXPECT_EQ(value, 0) << "constants have no Laplacian";
  }
}

TEST(SurfaceOperator, SolvesDiffusionAsADirectSolverDoes) {
  for (const SkeletexModel& model : twin_models()) {
    const TwinSurface twin = twin_surface(model);
    const int count = static_cast<int>(twin.points.size());
    const SurfaceOperator surface = make_surface_operator(device(), twin.surface.neighbours, twin.surface.points);
    std::vector<float> is_free(count, 1.f);
    for (int i = 0; i < count; i += 7) is_free[i] = 0;
    const std::vector<float> b = random_values(count, 6);
    const float time = 0.01f;
    const SolveResult solved =
        solve_diffusion(device(), surface, time, device().upload(is_free), {1, device().upload(b)}, 1e-6);
    EXPECT_LE(solved.report.residual, 1e-6);
    EXPECT_LT(solved.report.steps, 400);

    Eigen::SparseMatrix<double> matrix = static_cast<double>(time) * twin.matrices.laplace;
    for (int i = 0; i < count; ++i) matrix.coeffRef(i, i) += twin.matrices.mass[i];
    Eigen::VectorXd right(count);
    for (int column = 0; column < matrix.outerSize(); ++column)
      for (Eigen::SparseMatrix<double>::InnerIterator entry(matrix, column); entry; ++entry)
        if (is_free[entry.row()] == 0 || is_free[entry.col()] == 0)
          entry.valueRef() = entry.row() == entry.col() ? 1 : 0;
    for (int i = 0; i < count; ++i) right[i] = static_cast<double>(is_free[i] * b[i]);
    const Eigen::VectorXd expected = Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>(matrix).solve(right);
    EXPECT_LT(norm_of_difference(device().download(solved.x.values), expected), 1e-3 * expected.norm());
  }
}

TEST(SurfaceOperator, TakesHardlyMoreStepsAtFourTimesTheSize) {
  std::map<int, int> steps;
  for (const int size : {64, 256}) {
    const SkeletexModel model =
        SyntheticSurface(cross(5), 0.2).model(std::vector<std::pair<int, int>>(5, {size, size}));
    const ModelSurface surface = upload_surface(device(), model);
    const SurfaceOperator laplace = make_surface_operator(device(), surface.neighbours, surface.points);
    steps[size] = solve_diffusion(device(), laplace, 9e-4f, everywhere(surface),
                                  apply_operator(device(), laplace, 0, 1, everywhere(surface), surface.points))
                      .report.steps;
  }
  EXPECT_LT(steps[256], 2 * steps[64] + 4) << steps[64] << " steps at a quarter of the size";
}

TEST(CoarseLattice, ContinuesConstantsExactlyAndSitsAtItsPicks) {
  for (const SkeletexModel& model : twin_models()) {
    const Lattice lattice = number_lattice(model);
    const CoarseLattice coarse = coarsen(model, lattice, lattice_positions(device(), model));
    ASSERT_EQ(static_cast<int>(coarse.picks.size()), coarse.lattice.vertex_count);
    EXPECT_EQ(std::set<int>(coarse.picks.begin(), coarse.picks.end()).size(), coarse.picks.size());
    for (int v = 0; v < lattice.vertex_count; ++v) {
      float sum = 0;
      for (int i = 0; i < 4; ++i) {
        sum += coarse.shares[v][i];
        EXPECT_GE(coarse.shares[v][i], 0);
        EXPECT_LT(coarse.sources[v][i], coarse.lattice.vertex_count);
      }
      EXPECT_NEAR(sum, 1, 1e-6) << v;
    }
    for (int c = 0; c < coarse.lattice.vertex_count; ++c) {
      EXPECT_EQ(coarse.sources[coarse.picks[c]][0], c);
      EXPECT_EQ(coarse.shares[coarse.picks[c]][0], 1);
    }
  }
}

TEST(CoarseLattice, ContinuesASmoothFieldOverSeamsAndPoles) {
  // Bilinear interpolation over steps of two columns and rows: an error of about the second differences.
  const SkeletexModel model = synthetic(y_branch(), 96, 96, 0.25, 0);
  const Lattice lattice = number_lattice(model);
  const std::vector<Vec3> positions = lattice_positions(device(), model);
  const CoarseLattice coarse = coarsen(model, lattice, positions);
  double largest = 0;
  for (int v = 0; v < lattice.vertex_count; ++v) {
    Vec3 mixed = Vec3::Zero();
    for (int i = 0; i < 4; ++i)
      mixed += static_cast<double>(coarse.shares[v][i]) * coarse.positions[coarse.sources[v][i]];
    largest = std::max(largest, (mixed - positions[v]).norm());
  }
  EXPECT_LT(largest, 0.01 * model.diagonal);
}

TEST(SurfaceOperator, SumsAreaVectorsToTheVolume) {
  for (const SkeletexModel& model : twin_models()) {
    const TwinSurface twin = twin_surface(model);
    const std::vector<Vec3> vectors =
        download_vectors(device(), area_vectors(device(), twin.surface.neighbours, twin.surface.points));
    const std::vector<Vec3> expected = twin::area_vectors(twin.triangles, twin.points);
    Vec3 sum = Vec3::Zero();
    double size = 0;
    for (std::size_t i = 0; i < vectors.size(); ++i) {
      EXPECT_LT((vectors[i] - expected[i]).norm(), 1e-6);
      sum += vectors[i];
      size += vectors[i].norm();
    }
    EXPECT_LT(sum.norm(), 1e-6 * size) << "a closed surface has no area vector";
  }
}

TEST(Noise, EqualsItsTwinAndStaysWithinBounds) {
  std::vector<float> points = random_values(3 * 5000, 8);
  for (float& x : points) x *= 30;
  const auto heights = device().allocate<float>(5000);
  for (const unsigned seed : {0u, 77u}) {
    device().launch({"filter.cl", "noise_at_points"}, ClRange(5000), NoiseParameters{5000, 1, seed, 0.7f},
                    device().upload(points), heights);
    const std::vector<float> values = device().download(heights);
    double square = 0;
    for (int i = 0; i < 5000; ++i) {
      const Vec3 p(0.7f * points[i], 0.7f * points[5000 + i], 0.7f * points[10000 + i]);
      EXPECT_NEAR(values[i], twin::gradient_noise(p, seed), 3e-6);
      EXPECT_LT(std::abs(values[i]), 1.1);
      square += values[i] * values[i];
    }
    EXPECT_NEAR(std::sqrt(square / 5000), 0.27, 0.05);
  }
}

TEST(Curvature, OfASphereIsThatOfTheSphereOverSeamsCornersAndPoles) {
  // 512 x 512 texels altogether: one bone with two poles; three bones, two corners, three poles.
  const std::vector<std::tuple<Skeleton, int, int>> cases{{lone_bone(), 512, 512}, {y_branch(), 296, 296}};
  for (const auto& [skeleton, width, height] : cases) {
    const Vec3 centre = skeleton.bones.size() == 1
                            ? Vec3(0.5 * (skeleton.nodes[0].position + skeleton.nodes[1].position))
                            : skeleton.nodes[0].position;
    const double radius = 2;
    SkeletexModel model = placed(synthetic(skeleton, width, height, 0.25, 0),
                                 [&](const Vec3& p) { return Vec3(centre + radius * (p - centre).normalized()); });
    model.diagonal = 2 * radius * std::numbers::sqrt3;
    const ModelSurface surface = upload_surface(device(), model);
    const CurvatureResult result = mean_curvature(device(), model, surface);
    const double rms = relative_rms(surface, result.mean_curvature, [&](const Vec3&) { return 1 / radius; });
    RecordProperty("rms_of_" + std::to_string(skeleton.bones.size()) + "_bones", std::to_string(rms));
    EXPECT_LT(rms, 0.02) << skeleton.bones.size() << " bones";
    double largest = 0;
    const std::vector<Vec3> normals = vertex_normals(device(), surface);
    for (std::size_t i = 0; i < normals.size(); ++i)
      largest = std::max(largest, (normals[i] - (surface.positions[i] - centre) / radius).norm());
    EXPECT_LT(largest, 0.05);
  }
}

TEST(Curvature, OfATorusIsThatOfTheTorusOverSeams) {
  const double core = 2, tube = 0.5;
  const Skeleton skeleton = torus_shape(5, core, tube).skeleton;
  SkeletexModel model = placed(synthetic(skeleton, 229, 229, 0.5), [&](const Vec3& p) {
    const Vec3 middle = core * Vec3(p.x(), p.y(), 0).normalized();
    return Vec3(middle + tube * (p - middle).normalized());
  });
  model.diagonal = 2 * std::sqrt(2 * std::pow(core + tube, 2) + tube * tube);
  const ModelSurface surface = upload_surface(device(), model);
  const CurvatureResult result = mean_curvature(device(), model, surface);
  const double rms = relative_rms(surface, result.mean_curvature, [&](const Vec3& p) {
    const double from_axis = std::hypot(p.x(), p.y());
    return 0.5 * (1 / tube + (from_axis - core) / tube / from_axis);
  });
  RecordProperty("rms", std::to_string(rms));
  EXPECT_LT(rms, 0.02);
}

TEST(Smooth, TreatsABumpOnASeamAsItTreatsOneAwayFromSeams) {
  // A straight tube in two bones; the joint lies below the bump, or far from it.
  const double radius = 0.5, height = 0.05, width = 0.12;
  const auto bumpy = [&](double joint) {
    Skeleton skeleton;
    skeleton.nodes = {{"a", Vec3(0, 0, -1.5)}, {"b", Vec3(0, 0, joint)}, {"c", Vec3(0, 0, 1.5)}};
    skeleton.bones = {{"low", 0, 1, {}}, {"high", 1, 2, {}}};
    SkeletexModel model = placed(synthetic(skeleton, 200, 256, radius, 0), [&](const Vec3& p) {
      const Vec3 out = Vec3(p.x(), p.y(), 0).normalized(), top = Vec3(radius, 0, 0);
      return Vec3(p + height * std::exp(-(p - top).squaredNorm() / (2 * width * width)) * out);
    });
    model.origin = Vec3::Zero();
    model.diagonal = 4;
    return model;
  };
  SmoothOptions options;
  options.scale = 0.03;
  const SkeletexModel on_seam = bumpy(0), off_seam = bumpy(0.9);
  const TriangleMesh a = reconstruct_mesh(device(), smooth_model(device(), on_seam, options).model);
  const TriangleMesh b = reconstruct_mesh(device(), smooth_model(device(), off_seam, options).model);
  std::vector<Vec3> near_bump;
  double top = 0, opposite = 0;  // the tube has become thinner, too
  for (const Vec3& p : a.positions)
    if ((p - Vec3(radius, 0, 0)).norm() < 3 * width) {
      near_bump.push_back(p);
      top = std::max(top, p.x());
    } else if (std::abs(p.z()) < width) {
      opposite = std::max(opposite, -p.x());
    }
  ASSERT_GT(near_bump.size(), 1000u);
  EXPECT_LT(top - opposite, 0.6 * height) << "the bump was not smoothed";
  EXPECT_GT(top - opposite, 0.2 * height);
  const std::vector<float> distances = closest_distances(device(), b, near_bump);
  EXPECT_LT(*std::max_element(distances.begin(), distances.end()), 0.01 * height);
}

TEST(Smooth, TreatsABumpOfAnEncodedMeshAlikeOnASeamAndAwayFromSeams) {
  const double radius = 0.5, height = 0.05, width = 0.12;
  const auto tube = [](double joint) {
    Skeleton skeleton;
    skeleton.nodes = {{"a", Vec3(0, 0, -1.5)}, {"b", Vec3(0, 0, joint)}, {"c", Vec3(0, 0, 1.5)}};
    skeleton.bones = {{"low", 0, 1, {}}, {"high", 1, 2, {}}};
    return skeleton;
  };
  TriangleMesh mesh = thickened(tube(0), {radius, radius, radius}, 0.05, 0.03);
  for (Vec3& p : mesh.positions) {
    const Vec3 out = Vec3(p.x(), p.y(), 0).normalized(), top = Vec3(radius, 0, 0);
    p += height * std::exp(-(p - top).squaredNorm() / (2 * width * width)) * out;
  }
  EncodeOptions encoding;
  encoding.width = encoding.height = 384;
  SmoothOptions options;
  options.scale = 0.03;
  std::vector<TriangleMesh> smoothed;
  for (const double joint : {0.0, 0.9})
    smoothed.push_back(reconstruct_mesh(
        device(), smooth_model(device(), encode_model(device(), mesh, tube(joint), encoding).model, options).model));
  std::vector<Vec3> near_bump;
  for (const Vec3& p : smoothed[0].positions)
    if ((p - Vec3(radius, 0, 0)).norm() < 3 * width) near_bump.push_back(p);
  ASSERT_GT(near_bump.size(), 1000u);
  double sum = 0;
  for (const float distance : closest_distances(device(), smoothed[1], near_bump))
    sum += static_cast<double>(distance * distance);
  EXPECT_LT(std::sqrt(sum / static_cast<double>(near_bump.size())), 0.01 * height);
}

TEST(Smooth, InStepsShrinksASphereAsTheFlowDoes) {
  // A step of implicit Euler makes R of R / (1 + 2 t / R^2); in ever smaller steps that becomes R^2 - 4 t.
  const Skeleton skeleton = y_branch();
  const Vec3 centre = skeleton.nodes[0].position;
  SkeletexModel model = placed(synthetic(skeleton, 64, 64, 0.25, 0),
                               [&](const Vec3& p) { return Vec3(centre + (p - centre).normalized()); });
  model.diagonal = 2 * std::numbers::sqrt3;
  SmoothOptions options;
  options.scale = 0.06;
  const double time = std::pow(options.scale * model.diagonal, 2), flow = std::sqrt(1 - 4 * time);
  double gap = 1;
  for (const int iterations : {1, 2, 8}) {
    options.iterations = iterations;
    double expected = 1;
    for (int i = 0; i < iterations; ++i) expected /= 1 + 2 * time / iterations / (expected * expected);
    const FilterResult result = smooth_model(device(), model, options);
    const double radius = std::cbrt(result.report.volume_after / result.report.volume_before);
    EXPECT_NEAR(radius, expected, 2e-3) << iterations;
    EXPECT_LT(std::abs(radius - flow), gap) << iterations;
    gap = std::abs(radius - flow);
  }
  EXPECT_LT(gap, 0.01);
}

TEST(Smooth, BringsARippleDownAsTheHeatEquationSays) {
  // r = R (1 + e cos(k z)) on a long tube: implicit Euler divides the ripple by 1 + t (k^2 - 1 / R^2).
  const double radius = 0.5, k = 2 * std::numbers::pi / 0.6;
  Skeleton skeleton;
  skeleton.nodes = {{"a", Vec3(0, 0, -3)}, {"b", Vec3(0, 0, 0)}, {"c", Vec3(0, 0, 3)}};
  skeleton.bones = {{"low", 0, 1, {}}, {"high", 1, 2, {}}};
  SkeletexModel model = placed(synthetic(skeleton, 64, 512, radius, 0), [&](const Vec3& p) {
    const double ripple = 0.01 * std::cos(k * p.z());
    return Vec3(p.x() * (1 + ripple), p.y() * (1 + ripple), p.z());
  });
  model.diagonal = 6;
  SmoothOptions options;
  options.scale = 0.01;
  const double t = std::pow(options.scale * model.diagonal, 2);
  const std::vector<Vec3> before = lattice_positions(device(), model);
  const std::vector<Vec3> after = lattice_positions(device(), smooth_model(device(), model, options).model);
  Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();  // least squares: radius = a + b cos(k z)
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < before.size(); ++i) {
    if (std::abs(before[i].z()) > 1.5) continue;
    const Eigen::Vector2d basis(1, std::cos(k * before[i].z()));
    normal += basis * basis.transpose();
    right += std::hypot(after[i].x(), after[i].y()) * basis;
  }
  const double wave = normal.ldlt().solve(right)[1];
  EXPECT_NEAR(wave / (0.01 * radius), 1 / (1 + t * (k * k - 1 / (radius * radius))), 0.02);
}

TEST(Filters, GiveTheSameWhenBonesAreRenamedAndReordered) {
  const SkeletexModel model = SyntheticSurface(random_tree(8, 4), 0.2).model(random_sizes(8, 12, 40, 2));
  const SkeletexModel other = with_bones_reordered(model, random_permutation(8, 3));
  const double tolerance = 1e-6 * model.diagonal;
  expect_same_texels(smooth_model(device(), model).model, smooth_model(device(), other).model, tolerance);
  expect_same_texels(enhance_model(device(), model).model, enhance_model(device(), other).model, tolerance);
  expect_same_texels(add_noise(device(), model).model, add_noise(device(), other).model, tolerance);
}

TEST(Filters, KeepModelsClosedAtEverySize) {
  const std::vector<Skeleton> skeletons{lone_bone(), y_branch(),       cross(7),
                                        ring(5),     ring_with_arm(6), random_tree(20, 6)};
  for (const Skeleton& skeleton : skeletons) {
    const SyntheticSurface surface(skeleton, 0.2);
    for (const int side : {4, 9, 30}) {
      const SkeletexModel model = surface.model(std::vector<std::pair<int, int>>(skeleton.bones.size(), {side, side}));
      NoiseOptions noise;
      noise.amplitude = 0.02;
      for (const FilterResult& result :
           {smooth_model(device(), model), enhance_model(device(), model), add_noise(device(), model, noise)}) {
        const TriangleMesh mesh = reconstruct_mesh(device(), result.model);
        EXPECT_EQ(broken_rule(mesh, surface.genus()), "") << skeleton.bones.size() << " bones, side " << side;
        for (const Vec3& p : mesh.positions) ASSERT_TRUE(p.allFinite());
        EXPECT_GT(result.report.largest_move, 0);
      }
    }
  }
}

TEST(Filters, KeepARealModelClosedWithItsGenus) {
  const TestModel bear = load_standard_model("bear");
  EncodeOptions options;
  options.width = options.height = 128;
  options.method = Method::kSpd;
  const SkeletexModel model = encode_model(device(), bear.mesh, bear.skeleton, options).model;
  SmoothOptions smooth;
  smooth.scale = 0.02;
  smooth.keeps_volume = true;
  const FilterResult result = smooth_model(device(), model, smooth);
  const TriangleMesh mesh = reconstruct_mesh(device(), result.model);
  EXPECT_EQ(broken_rule(mesh, 0), "");
  // The mesh takes one diagonal of every quad, the filter both.
  EXPECT_NEAR(signed_volume(mesh) / signed_volume(reconstruct_mesh(device(), model)), 1, 1e-3);
  EXPECT_NEAR(result.report.volume_after / result.report.volume_before, 1, 1e-6);
  smooth.keeps_volume = false;
  EXPECT_LT(smooth_model(device(), model, smooth).report.volume_after, 0.99 * result.report.volume_before);
}

TEST(Filters, OfSnappedModelsTakeTheSolverNoLongerAndLeaveTheRestBitByBit) {
  const TestModel bear = load_standard_model("bear");
  const auto encoded = [&](bool has_snap) {
    EncodeOptions options;
    options.width = options.height = 192;
    options.has_snap = has_snap, options.has_fit = false;
    return encode_model(device(), bear.mesh, bear.skeleton, options).model;
  };
  const SkeletexModel snapped = encoded(true);
  const FilterResult whole = smooth_model(device(), snapped);
  EXPECT_LT(whole.report.solver.steps, 1.5 * smooth_model(device(), encoded(false)).report.solver.steps);
  EXPECT_EQ(whole.model.diagonals, DiagonalRule::kNearest);
  EXPECT_EQ(broken_rule(reconstruct_mesh(device(), whole.model), 0), "");

  const FilterRegion region{{snapped.skeleton.bones[1].name}, 0.02};
  const SkeletexModel part = smooth_model(device(), snapped, {}, region).model;
  EXPECT_EQ(part.diagonals, DiagonalRule::kSmooth);
  std::size_t changed = 0;
  for (std::size_t bone = 0; bone < snapped.patches.size(); ++bone) {
    const auto [x, y, width, height] = snapped.patches[bone].rectangle;
    for (int row = 0; row < height; ++row)
      for (int j = 0; j < width; ++j) {
        const std::size_t texel = static_cast<std::size_t>(y + row) * snapped.texture.width + x + j;
        const bool is_same = part.texture.out[texel] == snapped.texture.out[texel] &&
                             part.texture.along[texel] == snapped.texture.along[texel];
        EXPECT_TRUE(is_same || bone == 1) << bone << " " << row << " " << j;
        changed += !is_same;
      }
  }
  EXPECT_GT(changed, 100u);
}

TEST(Filters, OfNoEffectChangeNoBit) {
  const SkeletexModel model = synthetic(y_branch(), 24, 24);
  SmoothOptions smooth;
  smooth.scale = 0;
  EnhanceOptions enhance;
  enhance.gain = 0;
  NoiseOptions noise;
  noise.amplitude = 0;
  for (const SkeletexModel& same :
       {smooth_model(device(), model, smooth).model, enhance_model(device(), model, enhance).model,
        add_noise(device(), model, noise).model})
    expect_same_texels(same, model, 0);
}

TEST(Filters, LeaveOtherBonesBitByBitAndFadeOutTowardsThem) {
  const SkeletexModel model = synthetic(y_branch(), 48, 64);
  const FilterRegion region{{model.skeleton.bones[1].name}, 0.05};
  const Lattice lattice = number_lattice(model);
  const std::vector<float> weights = region_weights(device(), model, region);
  const std::vector<Vec3> positions = lattice_positions(device(), model);
  EXPECT_GT(*std::max_element(weights.begin(), weights.end()), 0.99f);
  for (const int bone : {0, 2})
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail})
      for (const int v : end_row(model, lattice, bone, end)) EXPECT_EQ(weights[v], 0);
  for (int v = lattice.first_sample[0]; v < lattice.vertex_count; ++v)
    EXPECT_EQ(weights[v], 0) << "all seams lead out of the region";
  const Neighbours table = find_neighbours(model, lattice, end_triangles(model, positions));
  for (std::size_t k = 0; k + 1 < table.fan_vertices.size(); ++k)
    for (int i = table.fan_vertices[k].begin; i < table.fan_vertices[k + 1].begin; ++i)
      EXPECT_LT(std::abs(weights[table.fan_vertices[k].vertex] - weights[table.fans[i][0]]), 0.25)
          << "the effect jumps";

  NoiseOptions noise;
  noise.amplitude = 0.02;
  const FilterResult result = add_noise(device(), model, noise, region);
  for (const int bone : {0, 2}) {
    const Rectangle& r = model.patches[bone].rectangle;
    for (int row = 0; row < r.height; ++row)
      for (int j = 0; j < r.width; ++j) {
        const std::size_t at = static_cast<std::size_t>(r.y + row) * model.texture.width + r.x + j;
        ASSERT_EQ(result.model.texture.along[at], model.texture.along[at]);
        ASSERT_EQ(result.model.texture.around[at], model.texture.around[at]);
        ASSERT_EQ(result.model.texture.out[at], model.texture.out[at]);
      }
  }
  for (std::size_t a = 0; a < model.arcs.size(); ++a)
    for (std::size_t i = 0; i < model.arcs[a].samples.size(); ++i)
      EXPECT_EQ(result.model.arcs[a].samples[i].distance, model.arcs[a].samples[i].distance);
  EXPECT_GT(result.report.largest_move, 0.005);
  EXPECT_EQ(broken_rule(reconstruct_mesh(device(), result.model), 0), "");
}

TEST(Filters, TakeAwayWithANegativeGainWhatSmoothingTakesAway) {
  const SkeletexModel model = synthetic(chain(3), 40, 48);
  EnhanceOptions enhance;
  enhance.gain = -1;
  expect_same_texels(enhance_model(device(), model, enhance).model, smooth_model(device(), model).model,
                     1e-6 * model.diagonal);
}

TEST(Filters, GiveTheSameBytesTwice) {
  const SkeletexModel model = synthetic(cross(5), 33, 27);
  expect_same_texels(smooth_model(device(), model).model, smooth_model(device(), model).model, 0);
}

TEST(Filters, RefuseWhatMakesNoSense) {
  const SkeletexModel model = synthetic(lone_bone(), 8, 8);
  SmoothOptions smooth;
  smooth.scale = -1;
  EXPECT_THROW(smooth_model(device(), model, smooth), InputError);
  smooth = {0.01, 0, false};
  EXPECT_THROW(smooth_model(device(), model, smooth), InputError);
  NoiseOptions noise;
  noise.wavelength = 0;
  EXPECT_THROW(add_noise(device(), model, noise), InputError);
  EnhanceOptions enhance;
  enhance.gain = std::nan("");
  EXPECT_THROW(enhance_model(device(), model, enhance), InputError);
  EXPECT_THROW(smooth_model(device(), model, {}, {{"no such bone"}, 0.1}), InputError);
}

}  // namespace skeletex
