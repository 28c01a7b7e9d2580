// SPDX-License-Identifier: MIT
// Inputs that once gave wrong answers, none, or false reasons.
#include <gtest/gtest.h>

#include <chrono>

#include "skeletex/analysis/manifold.h"
#include "skeletex/analysis/validate_input.h"
#include "skeletex/convert/encode_model.h"
#include "skeletex/io/mesh_file.h"
#include "skeletex/io/skeleton_file.h"
#include "skeletex/model/error.h"
#include "skeletex/model/memory.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/skeleton/check_skeleton.h"
#include "support/corrupted.h"
#include "support/scratch.h"
#include "support/shapes.h"

namespace skeletex {
namespace {

ClContext& device() {
  static ClContext context;
  return context;
}

double seconds_of(const std::function<void()>& run) {
  const auto begin = std::chrono::steady_clock::now();
  run();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

/// A chain along z with as many bones.
nlohmann::json chain_json(int bones) {
  nlohmann::json json;
  for (int i = 0; i <= bones; ++i) json["nodes"].push_back({{"position", {0, 0, i}}});
  for (int i = 0; i < bones; ++i) json["bones"].push_back({{"head", i}, {"tail", i + 1}});
  return json;
}

TEST(Faults, AMapWhoseWeightsRunOutOfDigitsKeepsItsLastGoodStep) {
  const TriangleMesh mesh = read_mesh(SKELETEX_SOURCE_DIR "/build/meshes/anchor.off").mesh;
  const Skeleton skeleton = read_skeleton(SKELETEX_SOURCE_DIR "/tests/faults/anchor_nan_side_ratio.skeleton.json");
  const UnitFrame frame = unit_frame(mesh);
  EncodeOptions options;
  options.width = options.height = 256;
  for (const int iterations : {2, 4}) {
    options.vsm.iterations = iterations;
    const EncodeResult result =
        encode_model(device(), in_unit_frame(mesh, frame), in_unit_frame(skeleton, frame), options);
    const ManifoldReport report = measure_manifold(reconstruct_mesh(device(), result.model));
    EXPECT_TRUE(report.is_closed_manifold());
    EXPECT_TRUE(report.non_finite_vertices.empty());
    EXPECT_EQ(report.genus, 4);
  }
}

TEST(Faults, SkeletonsThatAreTooLargeAreRefusedAtOnce) {
  const ScratchFolder folder;
  for (const int bones : {static_cast<int>(kMostBones) + 1, 100000}) {
    write_bytes(folder / "long.json", chain_json(bones).dump());
    const double seconds = seconds_of([&] {
      try {
        read_skeleton(folder / "long.json");
        FAIL() << bones;
      } catch (const IoError& error) {
        EXPECT_NE(std::string(error.what()).find("at most 2000 are taken"), std::string::npos) << error.what();
        EXPECT_NE(std::string(error.what()).find("long.json"), std::string::npos) << error.what();
      }
    });
    EXPECT_LT(seconds, 5) << bones;
  }
  // Built by a program, and nodes without bones.
  Skeleton skeleton = skeleton_from_json(chain_json(static_cast<int>(kMostBones)), "chain");
  EXPECT_NO_THROW(check_size(skeleton.nodes.size(), skeleton.bones.size()));
  skeleton.nodes.resize(100000);
  TriangleMesh mesh = capsule_shape().mesh;
  const double seconds = seconds_of([&] {
    const std::vector<Finding> findings = validate_before_segmentation(mesh, skeleton);
    ASSERT_EQ(findings.size(), 1u);
    EXPECT_EQ(findings[0].rule, "size");
  });
  EXPECT_LT(seconds, 5);
  EXPECT_THROW(encode_model(device(), mesh, skeleton), InputError);
}

TEST(Faults, AThousandBonesAreCheckedInSeconds) {
  // A tube with a ring of vertices per half bone.
  constexpr int kBones = 1000, kAround = 24, kRings = 2 * kBones;
  const Skeleton skeleton = skeleton_from_json(chain_json(kBones), "chain");
  TriangleMesh mesh = capsule_shape(kBones + 1, 0.4, kAround, kRings).mesh;
  for (Vec3& p : mesh.positions) p.z() += 0.5 * kBones;
  const double seconds = seconds_of([&] {
    const std::vector<Finding> findings = validate_input(device(), mesh, skeleton);
    EXPECT_TRUE(findings.empty()) << findings[0].message;
  });
  EXPECT_LT(seconds, 20);  // 3 s on one free core, more beside other tests
}

TEST(Faults, MemoryThatIsNotThereIsToldBeforeItIsTaken) {
  EXPECT_NO_THROW(require_memory(1e6, "little"));
  try {
    require_memory(1e15, "encoding the moon");
    FAIL() << "a petabyte";
  } catch (const InputError& error) {
    const std::string text = error.what();
    EXPECT_TRUE(text.starts_with("encoding the moon takes about 9.3e+05 GiB of memory")) << text;
    EXPECT_NE(text.find("leaves"), std::string::npos) << text;
  }
}

TEST(Faults, ControlCharactersArePrintedAsTheirNumbers) {
  EXPECT_EQ(printable("plain \xc3\xbc\n\tnext"), "plain \xc3\xbc\n\tnext");
  EXPECT_EQ(printable("\x1b[31mred\x07\x7f\r"), "\\x1b[31mred\\x07\\x7f\\x0d");
  EXPECT_EQ(printable("\xc2\x9b"
                      "31m"),
            "\\xc2\\x9b31m");
  EXPECT_EQ(printable("\xc2"), "\xc2");
}

}  // namespace
}  // namespace skeletex
