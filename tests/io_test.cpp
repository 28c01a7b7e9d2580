// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "skeletex/io/mesh_file.h"
#include "support/load_model.h"

namespace skeletex {
namespace {

TEST(StandardModels, EveryConfigNamesAMeshAndASkeletonThatCanBeRead) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(SKELETEX_SOURCE_DIR "/configs/models")) {
    const std::string name = entry.path().stem().string();
    SCOPED_TRACE(name);
    const TestModel model = load_standard_model(name);
    EXPECT_EQ(model.name, name);
    EXPECT_FALSE(model.mesh.triangles.empty());
    EXPECT_FALSE(model.skeleton.bones.empty());
    // Closed: twice as many edges as half of the triangles' sides; for a closed surface V - E + F is even.
    const long euler = static_cast<long>(model.mesh.positions.size()) - static_cast<long>(model.mesh.triangles.size()) / 2;
    EXPECT_EQ(euler % 2, 0);
    EXPECT_GT(signed_volume(model.mesh), 0);
    ++count;
  }
  EXPECT_EQ(count, 23);
}

}  // namespace
}  // namespace skeletex
