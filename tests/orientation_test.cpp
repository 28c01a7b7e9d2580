// SPDX-License-Identifier: MIT
#include "skeletex/edit/morph/orientation.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <numbers>
#include <random>

#include "skeletex/analysis/manifold.h"
#include "skeletex/convert/encode_model.h"
#include "skeletex/edit/morph/morph.h"
#include "skeletex/edit/morph/surface_map.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "support/creases.h"
#include "support/load_model.h"
#include "support/orientation_twin.h"

namespace skeletex {
namespace {

ClContext& device() {
  static ClContext context;
  return context;
}

const SkeletexModel& standard(const std::string& name, int size) {
  static std::map<std::pair<std::string, int>, SkeletexModel> models;
  const auto [it, is_new] = models.try_emplace({name, size});
  if (is_new) {
    const TestModel source = load_standard_model(name);
    EncodeOptions options;
    options.width = options.height = size;
    it->second = encode_model(device(), source.mesh, source.skeleton, options).model;
  }
  return it->second;
}

Morph morph_of(const std::string& a, const std::string& b, int size, bool is_smooth) {
  const SkeletexModel &first = standard(a, size), &second = standard(b, size);
  return Morph(device(), {first, second}, std::vector{find_correspondence(first.skeleton, second.skeleton)},
               {.layout = 0, .size = 0, .is_smooth = is_smooth});
}

/// An in-between model with its creases, and where its vertices lie on its sources.
struct InBetween {
  SkeletexModel model;
  std::vector<std::vector<Vec3>> sources;
};
InBetween in_between(const std::string& a, const std::string& b, int size, double t) {
  const Morph morph = morph_of(a, b, size, false);
  InBetween result{morph.at(std::vector{1 - t, t}), {}};
  for (const int m : {0, 1})
    result.sources.push_back(map_surface(device(), result.model, morph.models()[m], morph.correspondence(0, m)));
  return result;
}

TEST(Orientation, EqualsItsTwinOnAMorphAndOnNoise) {
  for (const double noise : {0.0, 0.02}) {
    InBetween given = in_between("bear", "bear_bis", 64, 0.4);
    std::mt19937 random(7);
    std::normal_distribution<double> normal;
    for (std::vector<Vec3>& source : given.sources)
      for (Vec3& p : source) p += noise * given.model.diagonal * Vec3(normal(random), normal(random), normal(random));
    const ModelSurface surface = upload_surface(device(), given.model);
    const SurfaceOperator laplace = make_surface_operator(device(), surface.neighbours, surface.points);
    const std::vector<double> weights{0.6, 0.4};
    std::vector<OrientationSource> sources;
    for (const int m : {0, 1})
      sources.push_back(whole_source(device(), given.model, surface, laplace, given.sources[m], weights[m]));
    const OrientationPull pull =
        pull_orientations(device(), surface, laplace, sources, shares_without_tips(given.model, surface.lattice), 0.1);

    const std::vector<Vec3> points = download_vectors(device(), surface.points);
    const std::vector<Triangle> ends = end_triangles(given.model, surface.positions);
    const twin::SurfaceMatrices matrices =
        twin::surface_matrices(twin::surface_triangles(given.model, surface.lattice, ends), points);
    const twin::OrientationPull expected =
        twin::pull_orientations(given.model, surface.lattice, points, ends, matrices, given.sources, weights, 0.1);

    const std::vector<float> rotations = device().download(pull.rotations.values);
    const std::vector<Vec3> normals = download_vectors(device(), pull.normals), b = download_vectors(device(), pull.b);
    const std::size_t count = points.size();
    // A vertex whose sources are (nearly) upside down may take either side of the rule that leaves such out.
    std::size_t other_rotations = 0, other_normals = 0, other_b = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const Eigen::Vector4d q(rotations[count + i], rotations[2 * count + i], rotations[3 * count + i], rotations[i]);
      other_rotations += !((q - expected.rotations[i].coeffs()).norm() < 1e-3);
      other_normals += !((normals[i] - expected.normals[i]).norm() < 1e-3);
      // Sums of weights times edges, whose weights and edges are exact to 1e-6 of what they are, and rotations to 1e-3.
      double size = 0;
      for (Eigen::SparseMatrix<double>::InnerIterator entry(matrices.laplace, static_cast<int>(i)); entry; ++entry)
        size += std::abs(entry.value()) * (points[entry.row()] - points[i]).norm();
      other_b += !((b[i] - expected.b[i]).norm() < 2e-3 * 0.01 * size);
    }
    EXPECT_LT(other_rotations, count / 1000) << "noise " << noise;
    EXPECT_LT(other_normals, count / 1000) << "noise " << noise;
    EXPECT_LT(other_b, count / 200) << "noise " << noise;
  }
}

TEST(Orientation, OfMovedCopiesMovesNothing) {
  const SkeletexModel& model = standard("bear", 64);
  const std::vector<Vec3> positions = lattice_positions(device(), model);
  std::vector<std::vector<Vec3>> sources(2, positions);
  const Eigen::Quaterniond rotation(Eigen::AngleAxisd(2.5, Vec3(1, 2, -1).normalized()));
  for (Vec3& p : sources[1]) p = rotation * p + Vec3(0.3, -2, 1);
  const MovedModel moved = blend_orientations(device(), model, sources, std::vector{0.5, 0.5});
  EXPECT_LT(moved.report.largest_move, 1e-5);
}

TEST(Orientation, AtAWeightOfOneEveryTexelStaysBitByBit) {
  const InBetween given = in_between("bear", "bear_bis", 64, 0.4);
  const SkeletexModel same = blend_orientations(device(), given.model, given.sources, std::vector{0.0, 1.0}).model;
  EXPECT_EQ(same.texture.along, given.model.texture.along);
  EXPECT_EQ(same.texture.around, given.model.texture.around);
  EXPECT_EQ(same.texture.out, given.model.texture.out);
}

TEST(Orientation, TakesMostOfTheCreasesOffSeamsThatAreSmoothInBothModels) {
  for (const auto& [a, b] : {std::pair("bear", "bear_bis"), std::pair("bull", "camel")}) {
    const std::vector<double> half{0.5, 0.5};
    const double creased = mean_crease(device(), morph_of(a, b, 128, false).at(half)),
                 smooth = mean_crease(device(), morph_of(a, b, 128, true).at(half));
    const double own = 0.5 * (mean_crease(device(), standard(a, 128)) + mean_crease(device(), standard(b, 128)));
    EXPECT_LT(smooth - own, 0.6 * (creased - own))
        << a << ": own " << own << ", creased " << creased << ", smooth " << smooth;
    RecordProperty(a, std::to_string(own) + " " + std::to_string(creased) + " " + std::to_string(smooth));
    const ManifoldReport report = measure_manifold(reconstruct_mesh(device(), morph_of(a, b, 128, true).at(half)));
    EXPECT_TRUE(report.is_closed_manifold()) << a;
  }
}

TEST(Orientation, HardlyMovesASurfaceNextToASource) {
  const InBetween given = in_between("bear", "bear_bis", 64, 0.02);
  EXPECT_LT(blend_orientations(device(), given.model, given.sources, std::vector{0.98, 0.02}).report.largest_move,
            2e-3);
}

}  // namespace
}  // namespace skeletex
