// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <map>

#include "skeletex/analysis/metro.h"
#include "skeletex/compact/byte_stream.h"
#include "skeletex/compact/compact_file.h"
#include "skeletex/compact/decode_model.h"
#include "skeletex/compact/encode/search_compact.h"
#include "skeletex/convert/encode_model.h"
#include "skeletex/io/check_model.h"
#include "skeletex/io/compact/compact_model_file.h"
#include "skeletex/io/model_file.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/layers/layer_values.h"
#include "skeletex/reconstruct/pose/pose_mesh.h"
#include "skeletex/reconstruct/pose/skin.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/skeleton/pose.h"
#include "support/corrupted.h"
#include "support/load_model.h"
#include "support/mesh_topology.h"
#include "support/scratch.h"
#include "support/synthetic_model.h"

namespace skeletex {
namespace {

ClContext& context() {
  static ClContext context;
  return context;
}

/// Every shape that a skeleton can have at a node: no neighbour, one, two, more, and cycles.
const std::map<std::string, Skeleton>& skeletons() {
  static const std::map<std::string, Skeleton> all{{"lone", lone_bone()},  {"chain", chain(3)},
                                                   {"branch", y_branch()}, {"cross", cross(5)},
                                                   {"ring", ring(5)},      {"ring with an arm", ring_with_arm(5)}};
  return all;
}

/// Numbers and colours that follow from the place, within their ranges.
float heat_at(const Vec3& point) { return static_cast<float>(100 + 30 * point.x() - 20 * point.y()); }
Colour colour_at(const Vec3& point) {
  const Vec3 c = (Vec3(0.5, 0.4, 0.3) + 0.2 * point).cwiseMax(0.1).cwiseMin(0.9);
  return {static_cast<float>(c[0]), static_cast<float>(c[1]), static_cast<float>(c[2]), 1};
}

SkeletexModel with_layers(SkeletexModel model) {
  const PreparedModel prepared(model);
  MeshAttributes attributes;
  attributes.numbers.push_back({"heat", {}});
  for (const Vec3& point : lattice_positions(context(), prepared)) {
    attributes.numbers[0].values.push_back(heat_at(point));
    attributes.colours.values.push_back(colour_at(point));
  }
  model.layers = layers_of_vertices(prepared, attributes);
  model.bone_weights = weight_planes(context(), prepared);
  return model;
}

constexpr const char* kWithLayers = "branch with layers";

const SkeletexModel& source_of(const std::string& name) {
  static std::map<std::string, SkeletexModel> models;
  const auto found = models.find(name);
  if (found != models.end()) return found->second;
  const bool has_layers = name == kWithLayers;
  const Skeleton& skeleton = skeletons().at(has_layers ? "branch" : name);
  const SyntheticSurface surface(skeleton, 0.2);
  SkeletexModel model = surface.model({skeleton.bones.size(), {96, 96}});
  if (has_layers) model = with_layers(std::move(model));
  return models.emplace(name, std::move(model)).first->second;
}

CompactResult pack(const std::string& name, double max_error, std::size_t max_bytes, int size, int layer_steps = 64) {
  CompactGoal goal;
  goal.layer_steps = layer_steps;
  if (max_error > 0) goal.max_error = max_error;
  if (max_bytes > 0) goal.max_bytes = max_bytes;
  goal.size = size;
  return search_compact(context(), source_of(name), nullptr, goal);
}
const CompactResult& packed(const std::string& name) {
  static std::map<std::string, CompactResult> results;
  const auto found = results.find(name);
  return found != results.end() ? found->second : results.emplace(name, pack(name, 3e-4, 0, 128)).first->second;
}

double mean_distance(const SkeletexModel& model, const SkeletexModel& other) {
  return symmetric_mean(
      measure_metro(context(), reconstruct_mesh(context(), model), reconstruct_mesh(context(), other)));
}

class Compact : public ::testing::TestWithParam<std::string> {};

TEST_P(Compact, ReachesTheWantedErrorWithASmallFile) {
  const CompactResult& result = packed(GetParam());
  const SkeletexModel decoded = decode_model(read_compact(result.bytes, "file"));
  EXPECT_LE(mean_distance(source_of(GetParam()), decoded), 3.2e-4);
  EXPECT_LE(result.max, 3e-2);
  const std::size_t per_bone = GetParam() == kWithLayers ? 4000 : 700;
  EXPECT_LT(result.bytes.size(), per_bone * source_of(GetParam()).skeleton.bones.size());
}

TEST_P(Compact, IsClosedAndOfTheGenusAtEverySizeAndInAPose) {
  const CompactModel compact = read_compact(packed(GetParam()).bytes, "file");
  for (const int octaves : {-2, -1, 0, 1}) {
    const SkeletexModel model = decode_model(compact, octaves);
    check_model(model, "model");
    EXPECT_EQ(broken_rule(reconstruct_mesh(context(), model), source_of(GetParam()).genus), "") << octaves;
    if (model.genus > 0) continue;  // random poses are those of trees
    const Skeleton posed = apply_pose(model.skeleton, make_random_pose(model.skeleton, 0.5, 3));
    EXPECT_EQ(broken_rule(reconstruct_mesh(context(), model, posed), 0), "") << octaves;
  }
}

TEST_P(Compact, ComesBackWithNamesAndTheSameIntegers) {
  const std::string& bytes = packed(GetParam()).bytes;
  const CompactModel compact = read_compact(bytes, "file");
  EXPECT_EQ(compact_bytes(compact), bytes);
  const Skeleton& skeleton = source_of(GetParam()).skeleton;
  for (std::size_t i = 0; i < skeleton.bones.size(); ++i)
    EXPECT_EQ(compact.skeleton.bones[i].name, skeleton.bones[i].name);
  const SkeletexModel once = decode_model(compact), again = decode_model(read_compact(bytes, "file"));
  EXPECT_EQ(once.texture.out, again.texture.out);
  for (std::size_t i = 0; i < skeleton.nodes.size(); ++i) {
    const Vec3 place = once.skeleton.frame.to_user(once.skeleton.nodes[i].position);
    EXPECT_LT((place - skeleton.frame.to_user(skeleton.nodes[i].position)).norm(),
              4e-6 * source_of(GetParam()).diagonal);
  }
}

/// Also of a patch with so few rows that its columns are doubled first.
TEST(CompactSizes, NeedNoUnusedSteps) {
  const Skeleton& skeleton = skeletons().at("chain");
  std::vector<std::pair<int, int>> sizes(skeleton.bones.size(), {96, 96});
  sizes[1] = {96, 5};
  const SkeletexModel source = SyntheticSurface(skeleton, 0.2).model(sizes);
  CompactGoal goal;
  goal.quality = 60;
  goal.size = 128;
  const CompactModel compact = read_compact(search_compact(context(), source, nullptr, goal).bytes, "file");
  for (const int octaves : {-8, -3, -2, -1, 0}) {
    CompactModel less = compact;
    less.bare_levels = std::max(compact.bare_levels, unused_steps(compact, octaves));
    less = read_compact(compact_bytes(less), "file");
    const SkeletexModel model = decode_model(compact, octaves), same = decode_model(less, octaves);
    EXPECT_EQ(model.texture.out, same.texture.out) << octaves;
    EXPECT_EQ(model.texture.along, same.texture.along) << octaves;
    EXPECT_LE(less.bare_levels, std::max(compact.bare_levels, -2 * octaves));
  }
}

/// What is read of a prefix grows nearer to the whole.
TEST_P(Compact, ReadsPrefixesAsCoarserModels) {
  const std::string& bytes = packed(GetParam()).bytes;
  const SkeletexModel whole = decode_model(read_compact(bytes, "file"));
  double last = 1;
  for (const double share : {0.7, 0.85, 1.0}) {
    const std::string prefix = bytes.substr(0, static_cast<std::size_t>(share * static_cast<double>(bytes.size())));
    const SkeletexModel model = decode_model(read_compact(prefix, "file", PrefixRule::kPrefix));
    EXPECT_EQ(broken_rule(reconstruct_mesh(context(), model), whole.genus), "") << share;
    const double off = mean_distance(whole, model);
    EXPECT_LE(off, last + 1e-9);
    last = off;
  }
  EXPECT_LT(last, 1e-10);
  try {
    read_compact(std::string_view(bytes).substr(0, 60), "file", PrefixRule::kPrefix);
    ADD_FAILURE() << "60 bytes are read";
  } catch (const IoError& error) {
    EXPECT_NE(std::string(error.what()).find("take more bytes"), std::string::npos) << error.what();
  }
}

/// Whatever is changed is refused; and where nothing is checked, it gives a sound model or is refused.
TEST_P(Compact, RefusesDamage) {
  const std::string& bytes = packed(GetParam()).bytes;
  for (std::size_t size = 0; size < bytes.size(); size += 1 + size / 8)
    EXPECT_THROW(read_compact(bytes.substr(0, size), "file"), IoError) << size;
  for_each_corruption(bytes, 300, 7, [&](const std::string& damaged) {
    if (damaged == bytes) return;
    EXPECT_THROW(read_compact(damaged, "file"), IoError);
    try {
      const SkeletexModel model = decode_model(read_compact(damaged, "file", PrefixRule::kPrefix), -3);
      check_model(model, "damaged");
    } catch (const Error&) {
    }
  });
}

/// The same for what stands behind the compression.
TEST_P(Compact, RefusesDamageBehindTheCompression) {
  const std::string& bytes = packed(GetParam()).bytes;
  ByteReader head(std::string_view(bytes).substr(13));
  const std::size_t size = head.count(1 << 30);
  const std::string payload = decompress(std::string_view(bytes).substr(bytes.size() - head.left()), size, false);
  for_each_corruption(payload, GetParam() == kWithLayers ? 50 : 300, 8, [&](const std::string& damaged) {
    ByteWriter body;
    body.count(damaged.size());
    try {
      const std::string file = bytes.substr(0, 13) + body.bytes() + compress(damaged);
      const SkeletexModel model = decode_model(read_compact(file, "file", PrefixRule::kPrefix), -3);
      check_model(model, "damaged");
    } catch (const Error&) {
    }
  });
}

INSTANTIATE_TEST_SUITE_P(Skeletons, Compact,
                         ::testing::Values("lone", "chain", "branch", "cross", "ring", "ring with an arm", kWithLayers),
                         [](const auto& test) {
                           std::string name = test.param;
                           std::replace(name.begin(), name.end(), ' ', '_');
                           return name;
                         });

/// Of values at the vertices, within a step of the range.
TEST(CompactSearch, NeverExceedsTheWantedError) {
  const TestModel eight = load_standard_model("eight");
  EncodeOptions options;
  options.width = options.height = 256;
  const SkeletexModel model = encode_model(context(), eight.mesh, eight.skeleton, options).model;
  for (const double wanted : {1e-3, 3e-4}) {
    CompactGoal goal;
    goal.max_error = wanted;
    goal.size = 256;
    const CompactResult result = search_compact(context(), model, nullptr, goal);
    EXPECT_LE(result.mean, wanted);
    EXPECT_GT(result.mean, 0.9 * wanted);
  }
}

TEST(CompactLayers, FollowTheSurface) {
  const SkeletexModel model = decode_model(read_compact(packed(kWithLayers).bytes, "file"));
  const PreparedModel prepared(model);
  const MeshAttributes attributes = vertex_attributes(prepared);
  ASSERT_EQ(attributes.numbers.size(), 1u);
  EXPECT_EQ(attributes.numbers[0].name, "heat");
  ASSERT_EQ(attributes.colours.values.size(), attributes.numbers[0].values.size());
  const UnitFrame& frame = model.skeleton.frame;
  const std::vector<Vec3> points = lattice_positions(context(), prepared);
  const auto [least, most] =
      std::minmax_element(attributes.numbers[0].values.begin(), attributes.numbers[0].values.end());
  const float step = (*most - *least) / 64;
  ASSERT_GT(step, 0.1);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3 point = frame.to_user(points[i]);
    EXPECT_NEAR(attributes.numbers[0].values[i], heat_at(point), 1.5 * step) << i;
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(attributes.colours.values[i][k], colour_at(point)[k], 0.05) << i;
  }
  const std::vector<std::vector<float>> weights = weight_planes(context(), prepared);
  ASSERT_EQ(model.bone_weights.size(), weights.size());
  const Rectangle& r = model.patches[0].rectangle;
  for (std::size_t bone = 0; bone < weights.size(); ++bone)
    for (int row = 1; row + 1 < r.height; ++row)
      for (int column = 0; column < r.width; ++column) {
        const std::size_t texel = static_cast<std::size_t>(r.y + row) * model.texture.width + r.x + column;
        EXPECT_NEAR(model.bone_weights[bone][texel], weights[bone][texel], 0.06);
      }
}

TEST(CompactLayers, AreLeftOutWhenAskedAndCountAsBytes) {
  const CompactResult without = pack(kWithLayers, 3e-4, 0, 128, 0);
  EXPECT_EQ(without.layer_bytes, 0u);
  EXPECT_EQ(without.bytes.size() + packed(kWithLayers).layer_bytes, packed(kWithLayers).bytes.size());
  EXPECT_GT(packed(kWithLayers).layer_bytes, 100u);
  const SkeletexModel model = decode_model(read_compact(without.bytes, "file"));
  EXPECT_TRUE(model.layers.empty());
  EXPECT_TRUE(model.bone_weights.empty());
  EXPECT_EQ(without.bytes, packed("branch").bytes);
  for (const std::size_t percent : {62, 67, 71, 80}) {
    const std::size_t wanted = packed(kWithLayers).bytes.size() * percent / 100;
    const CompactResult bounded = pack(kWithLayers, 0, wanted, 128, 16);
    EXPECT_LE(bounded.bytes.size(), wanted);
    EXPECT_GT(20 * bounded.bytes.size(), 17 * wanted);
    EXPECT_EQ(decode_model(read_compact(bounded.bytes, "file")).layers.size(), 2u);
  }
  EXPECT_THROW(pack(kWithLayers, 0, 700, 128, 64), InputError);
}

TEST(CompactSearch, KeepsToANumberOfBytesAndBreaksNoWish) {
  std::size_t last = 0;
  double last_mean = 1;
  for (const std::size_t wanted : {900u, 1500u, 3000u}) {
    const CompactResult result = pack("branch", 0, wanted, 128);
    EXPECT_LE(result.bytes.size(), wanted);
    EXPECT_GT(result.bytes.size(), last);
    EXPECT_LT(result.mean, last_mean);
    last = result.bytes.size();
    last_mean = result.mean;
  }
  EXPECT_THROW(pack("branch", 0, 100, 128), InputError);
  EXPECT_THROW(pack("branch", 1e-9, 0, 64), InputError);
}

TEST(CompactFile, IsReadWhereModelsAreReadByItsFirstBytes) {
  const ScratchFolder folder;
  const std::string& bytes = packed("branch").bytes;
  write_bytes(folder / "model.exr", bytes);
  const SkeletexModel model = read_model(folder / "model.exr"), same = decode_model(read_compact(bytes, "file"));
  EXPECT_EQ(model.texture.along, same.texture.along);
  EXPECT_EQ(read_model_levels(folder / "model.exr").size(), 1u);
  EXPECT_EQ(read_model_header(folder / "model.exr")["genus"], 0);
  EXPECT_THROW(read_model(folder / "model.exr", 1), IoError);
  const SkeletexModel larger = read_compact_model(folder / "model.exr", {.bytes = {}, .size = 200});
  EXPECT_GE(std::max(larger.texture.width, larger.texture.height), 200);
  EXPECT_LT(mean_distance(model, larger), 1e-3);
}

TEST(ByteStream, GivesBackWhatWasWritten) {
  ByteWriter out;
  const std::vector<std::int64_t> numbers{0,   1,    -1,  63,     64,      -64,
                                          127, -128, 200, 100000, -100000, std::int64_t{1} << 40};
  for (const std::int64_t number : numbers) out.number(number);
  for (int value = -70000; value < 70000; value += 37) out.residual(value);
  out.real(-1.0 / 3);
  out.text("name");
  const std::string packed_bytes = compress(out.bytes());
  const std::string bytes = decompress(packed_bytes, out.bytes().size(), false);
  ByteReader in(bytes);
  for (const std::int64_t number : numbers) EXPECT_EQ(in.number(std::int64_t{1} << 41), number);
  for (int value = -70000; value < 70000; value += 37) EXPECT_EQ(in.residual(), value);
  EXPECT_EQ(in.real(), -1.0 / 3);
  EXPECT_EQ(in.text(10), "name");
  EXPECT_TRUE(in.is_at_end());
  EXPECT_THROW(in.byte(), IoError);
}

}  // namespace
}  // namespace skeletex
