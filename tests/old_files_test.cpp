// SPDX-License-Identifier: MIT
// Models that versions 0.1 and 0.2 wrote, of a surface in closed form: tests/old_files.
#include <gtest/gtest.h>

#include <cmath>

#include "skeletex/io/model_file.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "support/mesh_topology.h"
#include "support/synthetic_model.h"

namespace skeletex {
namespace {

ClContext& device() {
  static ClContext context;
  return context;
}

SkeletexModel read_old(const std::string& name, int level = 0) {
  return read_model(SKELETEX_SOURCE_DIR "/tests/old_files/" + name + ".exr", level);
}

/// The model that the files hold, sampled anew.
const SkeletexModel& model_today() {
  static const SkeletexModel model = SyntheticSurface(y_branch(), 0.2).model({{12, 8}, {16, 10}, {12, 8}});
  return model;
}

class OldFiles : public ::testing::TestWithParam<const char*> {};

TEST_P(OldFiles, GiveTheSurfaceThatWasWritten) {
  const SkeletexModel model = read_old(GetParam());
  const double within = std::string(GetParam()).ends_with("half") ? 1e-3 : 1e-6;
  const std::vector<Vec3> places = lattice_positions(device(), model),
                          wanted = lattice_positions(device(), model_today());
  ASSERT_EQ(places.size(), wanted.size());
  for (std::size_t i = 0; i < places.size(); ++i) EXPECT_LT((places[i] - wanted[i]).norm(), within) << i;
  EXPECT_EQ(broken_rule(reconstruct_mesh(device(), model), 0), "");
}

INSTANTIATE_TEST_SUITE_P(Versions, OldFiles,
                         ::testing::Values("version_0.1_float", "version_0.1_half", "version_0.2_float",
                                           "version_0.2_half", "version_0.2_levels"),
                         [](const auto& version) {
                           std::string name = version.param;
                           for (char& c : name)
                             if (c == '.') c = '_';
                           return name;
                         });

TEST(OldLevels, KeepTheirWeightsAndTheirSizes) {
  const std::string path = SKELETEX_SOURCE_DIR "/tests/old_files/version_0.2_levels.exr";
  ASSERT_EQ(read_model_levels(path).size(), 2u);
  const SkeletexModel fine = read_old("version_0.2_levels"), coarse = read_old("version_0.2_levels", 1);
  ASSERT_EQ(fine.bone_weights.size(), 3u);
  for (std::size_t bone = 0; bone < 3; ++bone)
    for (std::size_t i = 0; i < fine.bone_weights[bone].size(); ++i)
      EXPECT_EQ(fine.bone_weights[bone][i], static_cast<float>((i * (bone + 1)) % 5) / 4);
  EXPECT_TRUE(coarse.bone_weights.empty());
  EXPECT_EQ(broken_rule(reconstruct_mesh(device(), coarse), 0), "");
}

}  // namespace
}  // namespace skeletex
