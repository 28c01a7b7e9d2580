// SPDX-License-Identifier: MIT
#include "skeletex/edit/morph/morph.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <map>
#include <random>

#include "skeletex/analysis/manifold.h"
#include "skeletex/analysis/metro.h"
#include "skeletex/convert/encode_model.h"
#include "skeletex/edit/morph/blend.h"
#include "skeletex/edit/morph/seam_network.h"
#include "skeletex/edit/morph/surface_map.h"
#include "skeletex/edit/regular_grid.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "support/blend_twin.h"
#include "support/load_model.h"
#include "support/random_skeleton.h"
#include "support/seam_gap.h"

namespace skeletex {
namespace {

ClContext& device() {
  static ClContext context;
  return context;
}

SkeletexModel encoded(const TriangleMesh& mesh, const Skeleton& skeleton, std::optional<Method> method, int size,
                      bool has_snap = false) {
  EncodeOptions options;
  options.width = options.height = size;
  options.has_snap = has_snap, options.has_fit = false;
  options.method = method;
  return encode_model(device(), mesh, skeleton, options).model;
}

const SkeletexModel& standard(const std::string& name, std::optional<Method> method = Method::kVsm, int size = 96) {
  static std::map<std::tuple<std::string, std::optional<Method>, int>, SkeletexModel> models;
  const auto [it, is_new] = models.try_emplace({name, method, size});
  if (is_new) {
    const TestModel source = load_standard_model(name);
    it->second = encoded(source.mesh, source.skeleton, method, size);
  }
  return it->second;
}

/// The same surface elsewhere: its texels stay as they are.
SkeletexModel moved(SkeletexModel model, const Eigen::Quaterniond& rotation, const Vec3& shift) {
  const std::vector<BoneBasis> bases = bone_bases(model.skeleton);
  for (std::size_t i = 0; i < bases.size(); ++i) model.skeleton.bones[i].s = rotation * bases[i].s;
  for (Node& node : model.skeleton.nodes) node.position = rotation * node.position + shift;
  model.origin = rotation * model.origin + shift;
  return model;
}

Morph morph_of(const SkeletexModel& a, const SkeletexModel& b, const MorphOptions& options = {}) {
  return Morph(device(), {a, b}, std::vector<Correspondence>{find_correspondence(a.skeleton, b.skeleton)}, options);
}

SkeletexModel at(const Morph& morph, double t) { return morph.at(std::vector<double>{1 - t, t}); }

void expect_valid(const SkeletexModel& model, int genus, const std::string& what) {
  const ManifoldReport report = measure_manifold(reconstruct_mesh(device(), model));
  EXPECT_TRUE(report.is_closed_manifold()) << what;
  EXPECT_EQ(report.components, 1) << what;
  EXPECT_EQ(report.genus, genus) << what;
  EXPECT_TRUE(report.non_finite_vertices.empty()) << what;
}

double largest_difference(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  if (a.size() != b.size()) return 1e300;
  double worst = 0;
  for (std::size_t i = 0; i < a.size(); ++i) worst = std::max(worst, (a[i] - b[i]).norm());
  return worst;
}

double mean_distance(const TriangleMesh& a, const TriangleMesh& b) {
  MetroOptions options;
  options.samples = 20000;
  return measure_metro(device(), a, b, options).forward.mean;
}

/// How far the vertices of one mesh lie from the other surface, at most, in diagonals. (Triangles at seams depend on
/// where arcs begin.)
double largest_distance(const TriangleMesh& from, const TriangleMesh& to) {
  const std::vector<float> distances = closest_distances(device(), to, from.positions);
  return *std::max_element(distances.begin(), distances.end()) / bounding_box(to).diagonal();
}

struct Pair {
  const char *a, *b;
  std::optional<Method> method;
};
const Pair kPairs[] = {{"man", "homer", Method::kVsm},
                       {"bear", "bear_bis", Method::kVsm},
                       {"bear", "bear_bis", Method::kSpd},
                       {"bull", "camel", Method::kVsm},
                       {"cow", "bull_16", Method::kVsm}};

/// Bit by bit, and to rounding where the model is snapped.
void expect_same_texels(const SkeletexModel& result, const SkeletexModel& model, const std::string& what) {
  for (const auto plane : {&DisplacementTexture::along, &DisplacementTexture::around, &DisplacementTexture::out}) {
    const std::vector<float>&made = result.texture.*plane, &own = model.texture.*plane;
    if (!model.sampling.is_snapped) {
      EXPECT_EQ(made, own) << what;
      continue;
    }
    ASSERT_EQ(made.size(), own.size()) << what;
    float largest = 0;
    for (std::size_t i = 0; i < made.size(); ++i) largest = std::max(largest, std::abs(made[i] - own[i]));
    EXPECT_LT(static_cast<double>(largest), 1e-6 * model.diagonal) << what;
  }
}

}  // namespace

TEST(Morph, EndsAtTheModelsThemselvesTexelByTexel) {
  for (const Pair& pair : kPairs) {
    const SkeletexModel &a = standard(pair.a, pair.method), &b = standard(pair.b, pair.method);
    const Morph morph = morph_of(a, b);
    for (const int end : {0, 1}) {
      const SkeletexModel result = at(morph, end);
      const SkeletexModel& model = end == 0 ? a : b;
      expect_same_texels(result, model, pair.a);
      EXPECT_EQ(result.diagonals, model.diagonals);
      for (std::size_t i = 0; i < model.patches.size(); ++i)
        EXPECT_LT(std::abs(result.patches[i].row_u[1] - model.patches[i].row_u[1]), 1e-15);
      EXPECT_LT(largest_distance(reconstruct_mesh(device(), result), reconstruct_mesh(device(), model)), 1e-6)
          << pair.a << " " << end;
    }
  }
}

TEST(Morph, EndsAtTheOtherModelsTexelsInTheFirstOnesLayoutWhereLayoutsAgree) {
  const SkeletexModel& a = standard("bear");
  SkeletexModel b = moved(a, Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Vec3::UnitY())), Vec3(1, 2, 3));
  for (float& w : b.texture.out) w *= 1.25f;
  const SkeletexModel result = at(morph_of(a, b, {.layout = 0}), 1);
  expect_same_texels(result, b, "bear");
}

TEST(Morph, EndsAtTheOtherSurfaceInTheFirstOnesLayout) {
  const SkeletexModel &a = standard("man"), &b = standard("homer");
  const SkeletexModel result = at(morph_of(a, b, {.layout = 0}), 1);
  EXPECT_EQ(result.patches[0].rectangle.width, a.patches[0].rectangle.width);
  EXPECT_LT(mean_distance(reconstruct_mesh(device(), b), reconstruct_mesh(device(), result)), 2e-3);
}

TEST(Morph, OfSnappedModelsNearsTheirOwnTexelsSteadily) {
  const TestModel bull = load_standard_model("bull"), camel = load_standard_model("camel");
  const SkeletexModel a = encoded(bull.mesh, bull.skeleton, Method::kVsm, 160, true),
                      b = encoded(camel.mesh, camel.skeleton, Method::kVsm, 128, true);
  ASSERT_TRUE(a.sampling.is_snapped && b.sampling.is_snapped);
  const Morph morph = morph_of(a, b);
  const TriangleMesh own = reconstruct_mesh(device(), a);
  double last = largest_distance(own, reconstruct_mesh(device(), at(morph, 0)));
  EXPECT_LT(last, 1e-6);
  for (const double t : {1e-4, 1e-3, 1e-2, 1e-1}) {
    const double mean = mean_distance(own, reconstruct_mesh(device(), at(morph, t)));
    EXPECT_GT(mean, last) << t;
    EXPECT_LT(mean, 1.5 * t) << t;
    last = mean;
  }
}

TEST(Morph, ArrivesSteadilyAtItsEnds) {
  for (const Pair& pair : {kPairs[0], kPairs[3]}) {
    const SkeletexModel &a = standard(pair.a, pair.method), &b = standard(pair.b, pair.method);
    const Morph morph = morph_of(a, b);
    EXPECT_LT(mean_distance(reconstruct_mesh(device(), a), reconstruct_mesh(device(), at(morph, 1e-4))), 3e-4)
        << pair.a;
    EXPECT_LT(mean_distance(reconstruct_mesh(device(), b), reconstruct_mesh(device(), at(morph, 1 - 1e-4))), 3e-4)
        << pair.b;
  }
}

TEST(Morph, OfAModelAndItsMovedCopyIsTheModelOnTheWay) {
  const SkeletexModel& a = standard("bear");
  const Vec3 axis = Vec3(1, 2, -1).normalized();
  const Vec3 shift = a.diagonal * Vec3(0.4, -1, 0.3);
  const Morph morph = morph_of(a, moved(a, Eigen::Quaterniond(Eigen::AngleAxisd(2.2, axis)), shift));
  const SkeletexModel half = at(morph, 0.5);
  // Rotations about the nodes' centroid, halfway.
  Vec3 centre = Vec3::Zero(), far_centre = Vec3::Zero();
  for (const Node& node : a.skeleton.nodes) centre += node.position / static_cast<double>(a.skeleton.nodes.size());
  far_centre = Eigen::AngleAxisd(2.2, axis) * centre + shift;
  const Skeleton expected = moved(a, Eigen::Quaterniond(Eigen::AngleAxisd(1.1, axis)),
                                  0.5 * (centre + far_centre) - Eigen::AngleAxisd(1.1, axis) * centre)
                                .skeleton;
  for (std::size_t n = 0; n < expected.nodes.size(); ++n)
    EXPECT_LT((half.skeleton.nodes[n].position - expected.nodes[n].position).norm(), 1e-9 * a.diagonal);
  TriangleMesh turned = reconstruct_mesh(device(), a);
  for (Vec3& p : turned.positions) p = 0.5 * (centre + far_centre) + Eigen::AngleAxisd(1.1, axis) * (p - centre);
  EXPECT_LT(largest_distance(reconstruct_mesh(device(), half), turned), 1e-6);
}

TEST(Morph, DoesNotCareAboutNamesOrderAndDirectionsOfBones) {
  const TestModel source = load_standard_model("man");
  Skeleton other = source.skeleton;
  std::mt19937 random(5);
  for (Bone& bone : other.bones) {
    bone.name = "_" + bone.name;
    bone.s.reset();
    if (random() % 2) std::swap(bone.head, bone.tail);
  }
  std::shuffle(other.bones.begin(), other.bones.end(), random);
  const SkeletexModel a = standard("man"), b = encoded(source.mesh, other, Method::kVsm, 96);
  const TriangleMesh mesh = reconstruct_mesh(device(), at(morph_of(a, b), 0.4));
  EXPECT_LT(mean_distance(source.mesh, mesh), 2 * mean_distance(source.mesh, reconstruct_mesh(device(), a)));
  const Distortion distortion = measure_distortion(
      reconstruct_mesh(device(), a), map_surface(device(), a, b, find_correspondence(a.skeleton, b.skeleton)));
  EXPECT_LT(distortion.dirichlet_median, 1.25);
}

TEST(Morph, IsTheSameFromEitherSide) {
  for (const Pair& pair : kPairs) {
    const SkeletexModel &a = standard(pair.a, pair.method), &b = standard(pair.b, pair.method);
    const Morph there = morph_of(a, b), back = morph_of(b, a);
    for (const double t : {0.2, 0.7}) {
      EXPECT_LT(largest_distance(reconstruct_mesh(device(), at(there, t)), reconstruct_mesh(device(), at(back, 1 - t))),
                1e-6)
          << pair.a << " " << t;
    }
  }
}

TEST(Morph, IsClosedAtEveryTime) {
  for (const Pair& pair : kPairs) {
    const Morph morph = morph_of(standard(pair.a, pair.method), standard(pair.b, pair.method));
    for (const double t : {0.0, 0.1, 0.25, 0.5, 0.6, 0.9, 1.0})
      expect_valid(at(morph, t), 0, std::string(pair.a) + " " + std::to_string(t));
  }
}

TEST(Morph, RowsEndOnTheSeamsAsThoseOfTheModelsDo) {
  // A model's own rows miss its seams by what both leave out between their points.
  for (const Pair& pair : kPairs) {
    const SkeletexModel &a = standard(pair.a, pair.method, 256), &b = standard(pair.b, pair.method, 256);
    const Morph morph = morph_of(a, b);
    const auto widest = [&](const SkeletexModel& model) {
      const std::vector<test::SeamGap> gaps = test::seam_gaps(device(), model);
      return *std::max_element(gaps.begin(), gaps.end(),
                               [](const auto& p, const auto& q) { return p.at_columns < q.at_columns; });
    };
    const double own =
        std::max(widest(regular_grid(device(), a)).at_columns, widest(regular_grid(device(), b)).at_columns);
    double widest_gap = 0;
    for (const double t : {0.25, 0.5, 0.75}) {
      const test::SeamGap gap = widest(at(morph, t));
      widest_gap = std::max(widest_gap, gap.at_columns);
      EXPECT_LT(gap.at_columns, own + 1.5e-3) << pair.a << " " << t << " bone " << a.skeleton.bones[gap.bone].name;
      EXPECT_LT(gap.row_to_seam, 0.01) << pair.a << " " << t;
    }
    RecordProperty(std::string(pair.a) + (pair.method == Method::kSpd ? "_spd" : "_vsm"),
                   std::to_string(widest_gap) + " between, " + std::to_string(own) + " of the models");
  }
}

TEST(Morph, IsSymmetricHalfWay) {
  for (const Pair& pair : kPairs) {
    const SkeletexModel &a = standard(pair.a, pair.method), &b = standard(pair.b, pair.method);
    const TriangleMesh there = reconstruct_mesh(device(), at(morph_of(a, b, {.layout = 0}), 0.5));
    const TriangleMesh back = reconstruct_mesh(device(), at(morph_of(b, a, {.layout = 1}), 0.5));
    EXPECT_LT(largest_distance(there, back), 1e-6) << pair.a;
    const TriangleMesh in_the_other_layout = reconstruct_mesh(device(), at(morph_of(a, b, {.layout = 1}), 0.5));
    EXPECT_LT(mean_distance(there, in_the_other_layout), 2e-3) << pair.a;
  }
}

TEST(Morph, IsClosedFromTheSmallestSizesToLargeOnes) {
  const SkeletexModel &a = standard("bear"), &b = standard("bear_bis");
  for (const int size : {32, 64, 512})
    expect_valid(at(morph_of(a, b, {.layout = {}, .size = size}), 0.5), 0, std::to_string(size));
  expect_valid(at(morph_of(a, b, {.layout = {}, .size = 1024, .is_smooth = false}), 0.5), 0, "1024");
}

TEST(Morph, OfSeveralModelsIsClosedWhateverTheWeights) {
  const SkeletexModel &a = standard("man"), &b = standard("homer"), &c = standard("man", Method::kSpd);
  const Morph morph(
      device(), {a, b, c},
      std::vector{find_correspondence(a.skeleton, b.skeleton), find_correspondence(a.skeleton, c.skeleton)});
  std::mt19937 random(4);
  std::uniform_real_distribution<double> unit(0, 1);
  for (int round = 0; round < 5; ++round) {
    std::vector<double> weights{unit(random), unit(random), unit(random)};
    const double sum = weights[0] + weights[1] + weights[2];
    for (double& weight : weights) weight /= sum;
    expect_valid(morph.at(weights), 0, std::to_string(round));
  }
}

TEST(Morph, KeepsTheGenusOfCyclicSkeletons) {
  for (const char* name : {"eight", "knot1"}) {
    const SkeletexModel& a = standard(name);
    SkeletexModel b = moved(a, Eigen::Quaterniond(Eigen::AngleAxisd(0.4, Vec3::UnitX())), Vec3::Zero());
    std::mt19937 random(3);
    for (Node& node : b.skeleton.nodes) node.position += 0.02 * b.diagonal * test::random_direction(random);
    const Morph morph(device(), {a, b}, std::vector<Correspondence>{find_correspondence(a.skeleton, b.skeleton)});
    for (const double t : {0.3, 0.5}) expect_valid(at(morph, t), a.genus, name);
  }
}

TEST(Morph, MixesSizesMethodsAndThreeModels) {
  const SkeletexModel &a = standard("bear", Method::kVsm), &b = standard("bear_bis", Method::kSpd),
                      &c = standard("bear", Method::kVsm, 48);
  const std::vector<Correspondence> from_first{find_correspondence(a.skeleton, b.skeleton),
                                               find_correspondence(a.skeleton, c.skeleton)};
  const Morph morph(device(), {a, b, c}, from_first);
  const SkeletexModel mean = morph.at(std::vector<double>{0.3, 0.45, 0.25});
  EXPECT_EQ(mean.texture.width, 96);
  expect_valid(mean, 0, "three");
  // Two of the three are one surface: their weights add up.
  const SkeletexModel two = at(morph_of(a, b, {.layout = 1}), 0.45);
  EXPECT_LT(mean_distance(reconstruct_mesh(device(), two), reconstruct_mesh(device(), mean)), 1e-3);
  expect_valid(at(morph_of(a, b, {.layout = {}, .size = 40}), 0.5), 0, "small");
}

TEST(Morph, RefusesWeightsThatMakeNoMean) {
  const Morph morph = morph_of(standard("bear"), standard("bear_bis"));
  for (const std::vector<double>& weights : {std::vector<double>{1}, {0.5, 0.4}, {1.5, -0.5}, {0.5, std::nan("")}})
    EXPECT_THROW(morph.at(weights), InputError);
  EXPECT_THROW(morph_of(standard("bear"), standard("bear_bis"), {.layout = 2}), InputError);
}

TEST(Morph, MapOfAModelToItsCopyIsAnIsometryAndScalingDoesNotCount) {
  const SkeletexModel& a = standard("bear");
  const TriangleMesh mesh = reconstruct_mesh(device(), a);
  const SkeletexModel b = moved(a, Eigen::Quaterniond(Eigen::AngleAxisd(1, Vec3::UnitZ())), Vec3(1, 0, 0));
  std::vector<Vec3> mapped = map_surface(device(), a, b, find_correspondence(a.skeleton, b.skeleton));
  EXPECT_LT(largest_difference(mapped, reconstruct_mesh(device(), b).positions), 1e-5 * a.diagonal);
  for (Vec3& p : mapped) p *= 3;
  const Distortion distortion = measure_distortion(mesh, mapped);
  EXPECT_NEAR(distortion.area, 1, 1e-3);
  EXPECT_NEAR(distortion.angle, 1, 1e-3);
  EXPECT_NEAR(distortion.dirichlet, 1, 1e-3);
  EXPECT_EQ(distortion.collapsed, 0);
}

TEST(Morph, DistortionOfAStretchIsThatOfItsSingularValues) {
  TriangleMesh plane;
  plane.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  plane.triangles = {{0, 1, 2}, {0, 2, 3}};
  std::vector<Vec3> stretched = plane.positions;
  for (Vec3& p : stretched) p = Vec3(3 * p.x(), p.y() / 2, 7);
  const Distortion d = measure_distortion(plane, stretched);
  const double s1 = 3 / std::sqrt(1.5), s2 = 0.5 / std::sqrt(1.5);  // at equal area
  EXPECT_NEAR(d.area, 1, 1e-12);
  EXPECT_NEAR(d.angle, (s1 / s2 + s2 / s1) / 2, 1e-12);
  EXPECT_NEAR(d.dirichlet, (s1 * s1 + s2 * s2 + 1 / (s1 * s1) + 1 / (s2 * s2)) / 4, 1e-12);
}

TEST(SeamNetwork, HasTheSeamsOfEncodedModels) {
  for (const char* name : {"bear", "man", "camel", "eight"}) {
    const SkeletexModel& model = standard(name);
    const SeparationPlanes separation(model.skeleton);
    const SeamNetwork network = seam_network(model.skeleton, separation);
    EXPECT_EQ(network.arcs.size(), model.arcs.size()) << name;
    EXPECT_EQ(network.corners.size(), model.corners.size()) << name;
    SkeletexModel drawn = model;
    drawn.arcs = network.arcs;
    drawn.corners = network.corners;
    drawn.ends = network.ends;
    for (SeamArc& arc : drawn.arcs)
      for (int i = 0; i < 3; ++i) arc.samples.push_back({i / 3.0, 1});
    EXPECT_NO_THROW(number_lattice(drawn)) << name;
  }
}

TEST(SeamNetwork, ClosesAroundRandomAndCocircularDirections) {
  std::mt19937 random(1);
  for (int count = 3; count <= 8; ++count)
    for (int round = 0; round < 20; ++round) {
      std::vector<Vec3> directions = test::spread_directions(count, 0.3, random);
      if (round == 0)
        for (int i = 0; i < count; ++i)
          directions[i] = Vec3(std::cos(6.283185307179586 * i / count), std::sin(6.283185307179586 * i / count), 0);
      const Skeleton skeleton = test::star_skeleton(directions, random);
      const SeparationPlanes separation(skeleton);
      const SeamNetwork network = seam_network(skeleton, separation);
      EXPECT_EQ(network.corners.size(), 2u * count - 4);
      EXPECT_EQ(network.arcs.size(), 3u * count - 6);
      for (std::size_t c = 0; c < network.corners.size(); ++c)
        for (const int bone : network.corners[c].bones) {
          const BoneEnd end = skeleton.bones[bone].head == 0 ? BoneEnd::kHead : BoneEnd::kTail;
          const double turn = separation.turn_of(bone, network.directions[c]);
          const Vec3 on_separation_plane =
              (separation.radial(bone, turn) + separation.slope(bone, end, turn) * separation.bases()[bone].o)
                  .normalized();
          EXPECT_LT((on_separation_plane - network.directions[c]).norm(), 1e-4) << count << " " << round;
        }
    }
}

TEST(Blend, KernelAndTwinAgreeOnRandomPlacesAndUglyWidths) {
  std::mt19937 random(9);
  std::uniform_real_distribution<float> unit(-1, 1);
  Skeleton skeleton;
  std::vector<Patch> patches;
  skeleton.nodes.push_back({"n", Vec3::Zero()});
  int y = 0;
  for (const auto& [width, height] : {std::pair{4, 4}, {33, 7}, {257, 5}, {64, 64}}) {
    const int bone = static_cast<int>(patches.size());
    skeleton.nodes.push_back({"n", Vec3(bone + 1, 0.3 * (bone % 2), 0)});
    skeleton.bones.push_back({"b", bone, bone + 1, {}});
    Patch patch;
    patch.rectangle = {bone, y, width, height};
    for (int r = 0; r < height; ++r) patch.row_u.push_back(static_cast<double>(r) / (height - 1));
    y += height;
    patches.push_back(patch);
  }
  const int texture_width = 270;
  std::vector<float> in[3];
  for (auto& plane : in)
    for (int i = 0; i < 5000; ++i) plane.push_back(unit(random));
  BlendTables tables;
  tables.source_count = 3;
  const std::vector<LatticeRow> rows = lattice_rows(patches, RowChoice::kAll);
  for (int s = 0; s < 3; ++s) {
    for (const Patch& patch : patches) {
      BlendSource source{static_cast<int>(random() % 1000),
                         50,
                         4 + static_cast<int>(random() % 40),
                         4 + static_cast<int>(random() % 60),
                         static_cast<int>(tables.columns.size()),
                         -1,
                         random() % 2 ? 1.0f : -1.0f};
      if (random() % 3 > 0) {
        source.slope_begin = static_cast<int>(tables.slopes.size() / 2);
        for (int k = 0; k < 2 * source.width; ++k) tables.slopes.push_back(2 * unit(random));
      }
      tables.sources.push_back(source);
      for (int j = 0; j < patch.rectangle.width; ++j) {
        const auto place = [&] {
          return j % 3 == 0 ? static_cast<float>(random() % 90) - 45
                            : 3.0f * static_cast<float>(source.width) * unit(random);
        };
        const float head = place(), even_head = place(), tail = place(), even_tail = place();
        tables.columns.push_back(
            {head, even_head, tail, even_tail, unit(random), unit(random), unit(random), unit(random)});
      }
    }
    for (const LatticeRow& row : rows) {
      const int height = tables.sources[s * patches.size() + row[0]].height;
      tables.source_rows.push_back(
          {random() % 4 == 0 ? static_cast<float>(height - 1) : static_cast<float>(height - 1) * std::abs(unit(random)),
           unit(random)});
    }
  }
  FrameTables frames = frame_tables(skeleton, SeparationPlanes(skeleton), patches, Vec3::Zero());
  for (ColumnRecord& column : frames.columns)
    column.slope_head = 2 * unit(random), column.slope_tail = 2 * unit(random);
  const DevicePlanes texels = upload_planes(device(), in[0], in[1], in[2]);
  DevicePlanes blended = allocate_planes(device(), static_cast<std::size_t>(texture_width) * y);
  blend_texels(device(), tables, rows, frames, texture_width, texels, blended);
  const auto out = download_planes(device(), blended);
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const auto [bone, row, vertex, quad] = rows[k];
    const Rectangle& rectangle = patches[bone].rectangle;
    const double axial = frames.rows[frames.patches[bone].row_begin + row].axial;
    for (int j = 0; j < rectangle.width; ++j) {
      std::vector<twin::BlendRead> reads;
      for (int s = 0; s < 3; ++s) {
        const BlendSource& source = tables.sources[s * patches.size() + bone];
        const BlendColumn& column = tables.columns[source.column_begin + j];
        const ColumnRecord& slopes = frames.columns[frames.patches[bone].column_begin + j];
        const auto smooth = [](double x) { return x * x * (3 - 2 * x); };
        const double eased = smooth(axial), near_head = smooth(std::max(0.0, 1 - axial / 0.3)),
                     near_tail = smooth(std::max(0.0, 1 - (1 - axial) / 0.3));
        const auto mix = [&](double head, double even_head, double tail, double even_tail) {
          return (1 - eased) * (near_head * head + (1 - near_head) * even_head) +
                 eased * (near_tail * tail + (1 - near_tail) * even_tail);
        };
        reads.push_back({source, tables.source_rows[s * rows.size() + k],
                         mix(column.head, column.even_head, column.tail, column.even_tail),
                         (1 - axial) * slopes.slope_head + axial * slopes.slope_tail,
                         mix(column.head_rise, column.even_head_rise, column.tail_rise, column.even_tail_rise), axial});
      }
      const Vec3 expected = twin::blend(reads, tables.slopes, in[0], in[1], in[2]);
      const std::size_t texel = static_cast<std::size_t>(rectangle.y + row) * texture_width + rectangle.x + j;
      // Columns of up to 150 are exact to 1e-5 in single precision, texels differ by up to 2 from column to column.
      for (int c = 0; c < 3; ++c)
        ASSERT_NEAR(out[c][texel], expected[c], 3 * 3 * 1e-4) << bone << " " << row << " " << j;
    }
  }
}

}  // namespace skeletex
