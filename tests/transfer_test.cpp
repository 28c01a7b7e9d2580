// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <map>

#include "skeletex/edit/mirror.h"
#include "skeletex/edit/transfer.h"
#include "skeletex/encode/encode_model.h"
#include "skeletex/measure/manifold.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "support/load_model.h"

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
    it->second = encode_model(device(), source.mesh, source.skeleton, options).model;
  }
  return it->second;
}

int bone_of(const SkeletexModel& model, const std::string& name) {
  for (std::size_t i = 0; i < model.skeleton.bones.size(); ++i)
    if (model.skeleton.bones[i].name == name) return static_cast<int>(i);
  return -1;
}

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
        ASSERT_TRUE(a.texture.along[at] == b.texture.along[at] && a.texture.around[at] == b.texture.around[at] && a.texture.out[at] == b.texture.out[at]);
      }
  }
}

void expect_same_seams(const SkeletexModel& a, const SkeletexModel& b) {
  for (std::size_t i = 0; i < a.arcs.size(); ++i)
    for (std::size_t k = 0; k < a.arcs[i].samples.size(); ++k) {
      ASSERT_EQ(a.arcs[i].samples[k].turn, b.arcs[i].samples[k].turn);
      ASSERT_EQ(a.arcs[i].samples[k].distance, b.arcs[i].samples[k].distance);
    }
  for (std::size_t i = 0; i < a.corners.size(); ++i) ASSERT_EQ(a.corners[i].sample.distance, b.corners[i].sample.distance);
}

}  // namespace

TEST(Transfer, LeavesEverythingElseBitByBit) {
  const SkeletexModel &source = standard("triceratops"), &target = standard("bunny00");
  for (const TransferBlend blend : {TransferBlend::kCosine, TransferBlend::kLinear, TransferBlend::kNone}) {
    TransferOptions options;
    options.blend = blend;
    const SkeletexModel result = transfer(device(), source, target, {{"left_horn", "left_ear"}, {"right_horn", "right_ear"}}, options);
    expect_same_outside(target, result, {"left_ear", "right_ear"});
    expect_same_seams(target, result);
    EXPECT_NE(result.texture.out, target.texture.out);
    expect_valid(result, 0);
  }
}

TEST(Transfer, OfAModelToItselfChangesNothing) {
  const std::vector<std::tuple<std::string, std::string, bool>> cases{
      {"bear", "left_leg", false}, {"bear", "left_ear", false}, {"bear", "neck", false}, {"bear", "left_shoulder", true}, {"man", "right_thigh", true},
      {"armadillo", "tail", true}, {"man", "chest", false}};
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

TEST(Transfer, RefusesWhatDoesNotFit) {
  const SkeletexModel& bear = standard("bear");
  EXPECT_THROW(transfer(device(), bear, bear, {}), InputError);
  EXPECT_THROW(transfer(device(), bear, bear, {{"nope", "left_leg"}}), InputError);
  EXPECT_THROW(transfer(device(), bear, bear, {{"left_hip", "left_leg"}}), InputError);
  EXPECT_THROW(transfer(device(), bear, bear, {{"left_leg", "right_leg"}, {"left_forearm", "right_leg"}}), InputError);
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
