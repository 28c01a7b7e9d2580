// SPDX-License-Identifier: MIT
#include "skeletex/edit/transfer/transfer.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <map>
#include <random>

#include "skeletex/analysis/folds.h"
#include "skeletex/analysis/manifold.h"
#include "skeletex/convert/encode_model.h"
#include "skeletex/convert/resample/resample.h"
#include "skeletex/edit/transfer/mirror.h"
#include "skeletex/edit/transfer/place_part.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "support/creases.h"
#include "support/load_model.h"
#include "support/transfer_twin.h"

namespace skeletex {
namespace {

ClContext& device() {
  static ClContext context;
  return context;
}

const SkeletexModel& standard(const std::string& name) {
  static std::map<std::string, SkeletexModel> models;
  const auto [it, is_new] = models.try_emplace(name);
  if (is_new) {
    const TestModel source = load_standard_model(name);
    EncodeOptions options;
    options.width = options.height = 96;
    options.has_snap = options.has_fit = false;
    it->second = encode_model(device(), source.mesh, source.skeleton, options).model;
  }
  return it->second;
}

int bone_of(const SkeletexModel& model, const std::string& name) {
  for (std::size_t i = 0; i < model.skeleton.bones.size(); ++i)
    if (model.skeleton.bones[i].name == name) return static_cast<int>(i);
  return -1;
}

bool is_near_tail(const SkeletexModel& model, int bone) { return model.ends[bone][0].arcs.empty(); }

void expect_valid(const SkeletexModel& model, int genus) {
  const ManifoldReport report = measure_manifold(reconstruct_mesh(device(), model));
  EXPECT_TRUE(report.is_closed_manifold());
  EXPECT_EQ(report.genus, genus);
  EXPECT_TRUE(report.non_finite_vertices.empty());
}

void expect_same_outside(const SkeletexModel& a, const SkeletexModel& b, const std::vector<std::string>& names) {
  for (std::size_t bone = 0; bone < a.patches.size(); ++bone) {
    if (std::find(names.begin(), names.end(), a.skeleton.bones[bone].name) != names.end()) continue;
    const auto [x, y, width, height] = a.patches[bone].rectangle;
    EXPECT_EQ(a.patches[bone].row_u, b.patches[bone].row_u);
    for (int row = y; row < y + height; ++row)
      for (int column = x; column < x + width; ++column) {
        const std::size_t at = static_cast<std::size_t>(row) * a.texture.width + column;
        ASSERT_TRUE(a.texture.along[at] == b.texture.along[at] && a.texture.around[at] == b.texture.around[at] &&
                    a.texture.out[at] == b.texture.out[at]);
      }
  }
}

void expect_same_seams(const SkeletexModel& a, const SkeletexModel& b) {
  for (std::size_t i = 0; i < a.arcs.size(); ++i)
    for (std::size_t k = 0; k < a.arcs[i].samples.size(); ++k) {
      ASSERT_EQ(a.arcs[i].samples[k].turn, b.arcs[i].samples[k].turn);
      ASSERT_EQ(a.arcs[i].samples[k].distance, b.arcs[i].samples[k].distance);
    }
  for (std::size_t i = 0; i < a.corners.size(); ++i)
    ASSERT_EQ(a.corners[i].sample.distance, b.corners[i].sample.distance);
}

}  // namespace

TEST(Transfer, LeavesEverythingElseBitByBit) {
  const SkeletexModel &source = standard("triceratops"), &target = standard("bunny00");
  for (const TransferBlend blend : {TransferBlend::kCosine, TransferBlend::kLinear, TransferBlend::kNone}) {
    TransferOptions options;
    options.blend = blend;
    const SkeletexModel result =
        transfer(device(), source, target, {{"left_horn", "left_ear"}, {"right_horn", "right_ear"}}, options);
    expect_same_outside(target, result, {"left_ear", "right_ear"});
    expect_same_seams(target, result);
    EXPECT_NE(result.texture.out, target.texture.out);
    expect_valid(result, 0);
  }
}

TEST(Transfer, OfAModelToItselfChangesNothing) {
  const std::vector<std::tuple<std::string, std::string, bool>> cases{
      {"bear", "left_leg", false},     {"bear", "left_ear", false},  {"bear", "neck", false},
      {"bear", "left_shoulder", true}, {"man", "right_thigh", true}, {"armadillo", "tail", true},
      {"man", "chest", false}};
  for (const auto& [name, bone, has_limbs] : cases)
    for (const TransferBlend blend : {TransferBlend::kCosine, TransferBlend::kNone}) {
      const SkeletexModel& model = standard(name);
      TransferOptions options;
      options.has_limbs = has_limbs;
      options.blend = blend;
      const SkeletexModel result = transfer(device(), model, model, {{bone, bone}}, options);
      const std::vector<Vec3> before = lattice_positions(device(), model), after = lattice_positions(device(), result);
      double worst = 0;
      for (std::size_t v = 0; v < before.size(); ++v) worst = std::max(worst, (after[v] - before[v]).norm());
      // Texels go to places and back in single precision, and seams inside of limbs are read between samples.
      EXPECT_LT(worst, (has_limbs ? 2e-3 : 2e-6) * model.diagonal) << name << " " << bone;
    }
}

TEST(Transfer, WithNoneIsTheSourceScaled) {
  // A model twice as large gives the model; a factor widens it about the bone and leaves places along the bone.
  const SkeletexModel& bear = standard("bear");
  SkeletexModel large = bear;
  for (Node& node : large.skeleton.nodes) node.position *= 2;
  large.origin *= 2;
  large.diagonal *= 2;
  for (std::vector<float>* plane : {&large.texture.along, &large.texture.around, &large.texture.out})
    for (float& texel : *plane) texel *= 2;
  for (SeamArc& arc : large.arcs)
    for (SeamSample& sample : arc.samples) sample.distance *= 2;
  for (SeamCorner& corner : large.corners) corner.sample.distance *= 2;
  const int bone = bone_of(bear, "left_ear");
  const auto [x, y, width, height] = bear.patches[bone].rectangle;
  const Vec3 head = end_position(bear.skeleton, bone, BoneEnd::kHead),
             axis = direction_from(bear.skeleton, {bone, BoneEnd::kHead});
  const Lattice lattice = number_lattice(bear);
  const std::vector<Vec3> before = lattice_positions(device(), bear);
  for (const double factor : {0.0, 1.0, 1.7}) {
    TransferOptions options;
    options.blend = TransferBlend::kNone;
    options.scale = factor > 0 ? TransferScale::kFactor : TransferScale::kAuto;
    options.factor = factor / 2;
    const std::vector<Vec3> after =
        lattice_positions(device(), transfer(device(), large, bear, {{"left_ear", "left_ear"}}, options));
    double worst = 0;
    for (int i = 0; i < width * (height - 2); ++i) {
      const int v = lattice.first_inner[bone] + i;
      const Vec3 offset = before[v] - head, along = axis * axis.dot(offset);
      worst = std::max(worst, (after[v] - (head + along + (factor > 0 ? factor : 1) * (offset - along))).norm());
    }
    EXPECT_LT(worst, 4e-6 * bear.diagonal) << factor;
  }
}

TEST(Transfer, DoesNotDependOnWhereTheSourceLiesAndFaces) {
  const SkeletexModel &source = standard("triceratops"), &target = standard("bunny00");
  SkeletexModel turned = source;
  const Eigen::Quaterniond turn = Eigen::Quaterniond(0.3, -0.7, 0.4, 0.2).normalized();
  const std::vector<BoneBasis> bases = bone_bases(source.skeleton);
  for (std::size_t b = 0; b < bases.size(); ++b) turned.skeleton.bones[b].s = turn * bases[b].s;
  for (Node& node : turned.skeleton.nodes) node.position = turn * node.position + Vec3(1, 2, 3);
  turned.origin = turn * turned.origin + Vec3(1, 2, 3);
  const std::vector<Vec3> a =
      lattice_positions(device(), transfer(device(), source, target, {{"left_horn", "left_ear"}}));
  const std::vector<Vec3> b =
      lattice_positions(device(), transfer(device(), turned, target, {{"left_horn", "left_ear"}}));
  double worst = 0;
  for (std::size_t v = 0; v < a.size(); ++v) worst = std::max(worst, (a[v] - b[v]).norm());
  EXPECT_LT(worst, 1e-5 * target.diagonal);
}

TEST(Transfer, MeetsTheSeamWithCosineAndJumpsThereWithNone) {
  const std::vector<std::array<std::string, 4>> cases{{"triceratops", "left_horn", "bunny00", "left_ear"},
                                                      {"bear_bis", "left_ear", "bear", "left_ear"},
                                                      {"homer", "left_forearm", "man", "left_forearm"}};
  for (const auto& [from, source_bone, to, target_bone] : cases) {
    const SkeletexModel &source = standard(from), &target = standard(to);
    const Lattice lattice = number_lattice(target);
    const std::vector<Vec3> before = lattice_positions(device(), target);
    const int bone = bone_of(target, target_bone), width = target.patches[bone].rectangle.width;
    const int row = is_near_tail(target, bone) ? target.patches[bone].rectangle.height - 3 : 0;
    double edge = 0;
    // How far the points next to the seam lie from where the target's own surface goes on: mean and worst.
    const auto moved = [&](TransferBlend blend, double keep) {
      TransferOptions options;
      options.blend = blend;
      options.keep = keep;
      options.skip = keep;
      const std::vector<Vec3> after =
          lattice_positions(device(), transfer(device(), source, target, {{source_bone, target_bone}}, options));
      double sum = 0, worst = 0;
      edge = 0;
      for (int j = 0; j < width; ++j) {
        const int v = lattice.first_inner[bone] + row * width + j, next = row == 0 ? v + width : v - width;
        const int neighbour = lattice.first_inner[bone] + row * width + (j + 1) % width;
        sum += (after[v] - before[v]).norm() / width;
        worst = std::max(worst, (after[v] - before[v]).norm());
        edge += ((before[next] - before[v]).norm() + (before[neighbour] - before[v]).norm()) / (2 * width);
      }
      return std::array{sum, worst};
    };
    EXPECT_LT(moved(TransferBlend::kCosine, -1)[1], edge) << to;  // from root to root
    const double seam = moved(TransferBlend::kCosine, 0)[0];      // from seam to seam
    EXPECT_LT(seam, edge) << to;
    EXPECT_GT(moved(TransferBlend::kNone, 0)[0], 2 * seam) << to;
  }
}

TEST(Transfer, FoldsNoMoreThanItsTwoModelsDo) {
  const auto folded = [](const SkeletexModel& model) {
    return measure_folds(reconstruct_mesh(device(), model)).folded_edges;
  };
  const auto check = [&](const std::string& from, const std::string& to,
                         const std::vector<std::pair<std::string, std::string>>& bones, bool has_limbs) {
    TransferOptions options;
    options.has_limbs = has_limbs;
    const SkeletexModel result = transfer(device(), standard(from), standard(to), bones, options);
    expect_valid(result, 0);
    EXPECT_LE(folded(result), folded(standard(from)) + folded(standard(to)) + 4) << from << " " << to;
  };
  check("triceratops", "bunny00", {{"left_horn", "left_ear"}, {"right_horn", "right_ear"}}, false);
  check("bear_bis", "bear", {{"left_ear", "left_ear"}, {"right_ear", "right_ear"}}, false);
  check("bear", "bear_bis", {{"left_ear", "left_ear"}, {"right_ear", "right_ear"}}, false);
  check("man", "armadillo", {{"left_upper_arm", "left_upper_arm"}}, true);
  check("man", "homer", {{"chest", "chest"}}, false);
  check("homer", "man", {{"left_forearm", "left_forearm"}}, false);
}

TEST(Transfer, OfLimbsTakesTheWholeLimbAndKeepsTheRest) {
  const SkeletexModel &source = standard("man"), &target = standard("armadillo");
  TransferOptions options;
  options.has_limbs = true;
  const SkeletexModel result = transfer(device(), source, target, {{"left_upper_arm", "left_upper_arm"}}, options);
  const std::vector<std::string> limb{"left_upper_arm", "left_forearm", "left_hand"};
  expect_same_outside(target, result, limb);
  expect_valid(result, 0);
  for (const std::string& name : limb) {
    const Rectangle r = target.patches[bone_of(target, name)].rectangle;
    const std::size_t texel = static_cast<std::size_t>(r.y + r.height / 2) * target.texture.width + r.x;
    EXPECT_NE(result.texture.out[texel + r.width / 2], target.texture.out[texel + r.width / 2]) << name;
  }
  // Seams of other bones than the limb's stay; inner ones are the source's.
  for (std::size_t a = 0; a < target.arcs.size(); ++a) {
    const auto is_in = [&](int bone) {
      return std::find(limb.begin(), limb.end(), target.skeleton.bones[bone].name) != limb.end();
    };
    const bool is_inner = is_in(target.arcs[a].bones[0]) && is_in(target.arcs[a].bones[1]);
    EXPECT_EQ(result.arcs[a].samples[0].distance == target.arcs[a].samples[0].distance, !is_inner);
  }
}

TEST(Transfer, PutsTheMirrorImageOfALimbOnTheOtherSide) {
  const SkeletexModel& bear = standard("bear");
  TransferOptions options;
  options.has_limbs = true;
  const SkeletexModel result =
      transfer(device(), mirrored(bear), bear, {{"left_upper_arm", "right_upper_arm"}}, options);
  expect_same_outside(bear, result, {"right_upper_arm", "right_forearm"});
  expect_valid(result, 0);
  // There and back again: the right arm's mirror image is the left one, but for where they were cut.
  const SkeletexModel image = mirrored(bear);
  TransferOptions hard = options;
  hard.blend = TransferBlend::kNone;
  const SkeletexModel same = transfer(device(), image, image, {{"left_upper_arm", "left_upper_arm"}}, hard);
  const std::vector<Vec3> a = lattice_positions(device(), same), b = lattice_positions(device(), image);
  double worst = 0;
  for (std::size_t v = 0; v < a.size(); ++v) worst = std::max(worst, (a[v] - b[v]).norm());
  EXPECT_LT(worst, 2e-3 * bear.diagonal);
}

TEST(Transfer, JoinsALimbWithoutARootAsSmoothlyAsTheModelsAre) {
  const SkeletexModel &bear = standard("bear"), &bis = standard("bear_bis");
  struct Case {
    const SkeletexModel source, &target;
    const char *from, *to, *below;
    TransferScale scale;
  };
  for (const Case& c :
       {Case{mirrored(bear), bear, "left_upper_arm", "right_upper_arm", "right_forearm", TransferScale::kGirth},
        Case{bis, bear, "left_upper_arm", "left_upper_arm", "left_forearm", TransferScale::kAuto}}) {
    TransferOptions options;
    options.has_limbs = true;
    options.scale = c.scale;
    const std::vector<std::pair<std::string, std::string>> bones{{c.from, c.to}};
    const auto is_of_limb = [&](const SeamArc& arc) {
      return std::any_of(arc.bones.begin(), arc.bones.end(), [&](int bone) {
        return bone == bone_of(c.target, c.to) || bone == bone_of(c.target, c.below);
      });
    };
    const SkeletexModel smooth = transfer(device(), c.source, c.target, bones, options);
    options.is_smooth = false;
    const double creased = mean_crease(device(), transfer(device(), c.source, c.target, bones, options), is_of_limb);
    const double joined = mean_crease(device(), smooth, is_of_limb), own = mean_crease(device(), c.target, is_of_limb);
    RecordProperty(c.to, std::to_string(own) + " " + std::to_string(creased) + " " + std::to_string(joined));
    EXPECT_LT(joined - own, 0.5 * (creased - own))
        << c.to << ": own " << own << ", creased " << creased << ", joined " << joined;
    expect_same_outside(c.target, smooth, {c.to, c.below});
    expect_valid(smooth, 0);
  }
}

TEST(Transfer, WorksFrom32To1024) {
  for (const int size : {32, 1024}) {
    const SkeletexModel source = resample_model(device(), standard("triceratops"), size),
                        target = resample_model(device(), standard("bunny00"), size);
    const SkeletexModel result = transfer(device(), source, target, {{"left_horn", "left_ear"}});
    expect_same_outside(target, result, {"left_ear"});
    EXPECT_NE(result.texture.out, target.texture.out);
    if (size == 32) expect_valid(result, 0);
    for (const float texel : result.texture.out) ASSERT_TRUE(std::isfinite(texel));
  }
}

TEST(Transfer, SmallAndLargeSourcesGiveTheSameShape) {
  const SkeletexModel &source = standard("bear_bis"), &target = standard("bear");
  const SkeletexModel fine = resample_model(device(), source, 2 * source.texture.width);
  const std::vector<Vec3> a =
      lattice_positions(device(), transfer(device(), source, target, {{"left_ear", "left_ear"}}));
  const std::vector<Vec3> b = lattice_positions(device(), transfer(device(), fine, target, {{"left_ear", "left_ear"}}));
  double sum = 0;
  for (std::size_t v = 0; v < a.size(); ++v) sum += (a[v] - b[v]).squaredNorm() / static_cast<double>(a.size());
  EXPECT_LT(std::sqrt(sum), 5e-3 * target.diagonal);
}

TEST(Transfer, RefusesWhatDoesNotFit) {
  const SkeletexModel& bear = standard("bear");
  EXPECT_THROW(transfer(device(), bear, bear, {}), InputError);
  EXPECT_THROW(transfer(device(), bear, bear, {{"nope", "left_leg"}}), InputError);
  EXPECT_THROW(transfer(device(), bear, bear, {{"left_hip", "left_leg"}}), InputError);
  EXPECT_THROW(transfer(device(), bear, bear, {{"left_leg", "right_leg"}, {"left_forearm", "right_leg"}}), InputError);
  TransferOptions options;
  options.scale = TransferScale::kFactor;
  options.factor = 0;
  EXPECT_THROW(transfer(device(), bear, bear, {{"left_leg", "right_leg"}}, options), InputError);
  options = {};
  options.keep = 0.95;
  EXPECT_THROW(transfer(device(), bear, bear, {{"left_leg", "right_leg"}}, options), InputError);
  options = {};
  options.has_limbs = true;
  const SkeletexModel& eight = standard("eight");
  EXPECT_THROW(
      transfer(device(), eight, eight, {{eight.skeleton.bones[0].name, eight.skeleton.bones[0].name}}, options),
      InputError);
}

TEST(PlacePart, KernelAndTwinAgreeOnRandomTables) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> unit(-1, 1);
  const std::vector<std::pair<int, int>> sizes{{4, 4}, {33, 7}, {129, 40}, {65, 65}};
  std::vector<float> in[3], target[3];
  for (int i = 0; i < 9000; ++i)
    for (int c = 0; c < 3; ++c) in[c].push_back(unit(random)), target[c].push_back(unit(random));
  TransferTables tables;
  for (std::size_t p = 0; p < sizes.size(); ++p) {
    const auto [width, height] = sizes[p];
    const int source_width = 4 + static_cast<int>(random() % 50), source_height = 4 + static_cast<int>(random() % 60);
    tables.patches.push_back({static_cast<int>(random() % 1000), source_width, source_height,
                              static_cast<int>(tables.columns.size()), p % 2 ? 1.0f : -1.0f, 1.5f, unit(random),
                              unit(random), unit(random), unit(random), unit(random), 0.4f * static_cast<float>(height),
                              p == 0 ? 0.0f : 0.3f * static_cast<float>(height), static_cast<int>(p / 2),
                              p == 2 ? 17 : -1});
    for (int j = 0; j < width; ++j)
      tables.columns.push_back({3 * static_cast<float>(source_width) * unit(random),
                                3 * static_cast<float>(source_width) * unit(random), unit(random), unit(random),
                                10 * unit(random), 1 + unit(random), 3 * unit(random),
                                static_cast<float>(height) + 3 * unit(random)});
    for (int row = 0; row < height; ++row) {
      tables.rows.push_back({static_cast<int>(p), row, width, static_cast<int>(tables.point_count), 0,
                             0.5f + 0.5f * unit(random), 1 + unit(random)});
      tables.point_count += width;
    }
  }
  for (std::size_t i = 0; i < tables.correction_size(); ++i) tables.corrections.push_back(0.1f * unit(random));
  const DevicePlanes source_planes = upload_planes(device(), in[0], in[1], in[2]);
  const DevicePlanes target_planes = upload_planes(device(), target[0], target[1], target[2]);
  const auto out = download_planes(device(), place_part(device(), tables, source_planes, target_planes));
  const auto read_out = download_planes(device(), read_source(device(), tables, source_planes));
  for (std::size_t k = 0; k < tables.rows.size(); ++k) {
    const TransferRow& row = tables.rows[k];
    const int p = row.patch, vertex = row.vertex;
    for (int j = 0; j < sizes[p].first; ++j) {
      const std::size_t column = static_cast<std::size_t>(tables.patches[p].column_begin + j);
      const Vec3 expected = twin::place(
          tables.patches[p], row, tables.columns[column], j, [&](int i) { return Vec3(in[0][i], in[1][i], in[2][i]); },
          [&](int i) { return Vec3(target[0][i], target[1][i], target[2][i]); },
          [&](int end, int band, bool is_slope, int axis) {
            return tables.correction(end == 0 ? BoneEnd::kHead : BoneEnd::kTail, band, is_slope, axis, column);
          });
      // Columns of up to 160 are exact to 2e-5 in single precision and points differ by up to 2 from column to column,
      // rows of up to 140 alike; both enter up to some ten times (scale, lean, corrections times rows).
      double at = 0;
      const Vec3 place = twin::read(
          tables.patches[p], row, tables.columns[column], [&](int i) { return Vec3(in[0][i], in[1][i], in[2][i]); },
          at);
      for (int c = 0; c < 3; ++c) {
        ASSERT_NEAR(out[c][vertex + j], expected[c], 2e-3) << p << " " << row.row << " " << j;
        ASSERT_NEAR(read_out[c][vertex + j], place[c], 2e-4) << p << " " << row.row << " " << j;
      }
    }
  }
}

TEST(PlacePart, BandsOfWavesSumToTheirRowAndTheFirstHasTheLongest) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (const int count : {4, 7, 64, 301}) {
    std::vector<double> values(count);
    for (double& value : values) value = unit(random);
    const auto bands = wave_bands(values);
    for (int i = 0; i < count; ++i) {
      double sum = 0;
      for (const auto& band : bands) sum += band[i];
      EXPECT_NEAR(sum, values[i], 1e-12 * count);
    }
  }
  std::vector<double> wave(90);
  for (int i = 0; i < 90; ++i) wave[i] = 3 + std::cos(2 * std::numbers::pi * 2 * i / 90);
  const auto bands = wave_bands(wave);
  for (int i = 0; i < 90; ++i) EXPECT_NEAR(bands[0][i], wave[i], 1e-12);
}

TEST(Folds, AreCountedWhereASheetLiesBackOnItself) {
  TriangleMesh sheet;
  sheet.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}};
  sheet.triangles = {{0, 1, 2}, {2, 1, 3}};
  EXPECT_EQ(measure_folds(sheet).edges, 1);
  EXPECT_EQ(measure_folds(sheet).folded_edges, 0);
  sheet.positions[3] = {0.1, 0.1, 0.1};
  EXPECT_EQ(measure_folds(sheet).folded_edges, 1);
}

TEST(Mirror, IsTheMirrorImageAndItsOwnInverse) {
  for (const char* name : {"bear", "eight"}) {
    const SkeletexModel& model = standard(name);
    const SkeletexModel image = mirrored(model), twice = mirrored(image);
    expect_valid(image, model.genus);
    EXPECT_EQ(twice.texture.around, model.texture.around);
    const Lattice lattice = number_lattice(model);
    const std::vector<Vec3> here = lattice_positions(device(), model), there = lattice_positions(device(), image);
    double worst = 0;
    for (std::size_t bone = 0; bone < model.patches.size(); ++bone) {
      const auto [x, y, width, height] = model.patches[bone].rectangle;
      for (int row = 0; row + 2 < height; ++row)
        for (int j = 0; j < width; ++j) {
          const int first = lattice.first_inner[bone] + row * width;
          const Vec3 p = there[first + (width - j) % width];
          worst = std::max(worst, (here[first + j] - Vec3(-p.x(), p.y(), p.z())).norm());
        }
    }
    EXPECT_LT(worst, 1e-6 * model.diagonal) << name;
  }
}

}  // namespace skeletex
