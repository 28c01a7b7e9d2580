// SPDX-License-Identifier: MIT
#include "skeletex/io/model_file.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>

#include "skeletex/io/check_model.h"
#include "skeletex/io/mesh_file.h"
#include "skeletex/io/model_json.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "support/corrupted.h"
#include "support/full_disk.h"
#include "support/scratch.h"
#include "support/synthetic_model.h"

namespace skeletex {
namespace {

constexpr std::uint64_t kSeed = 20260101;

/// Numbers with all their digits, and texels of every magnitude.
class Numbers {
 public:
  explicit Numbers(std::uint64_t seed) : random_(seed) {}
  double uniform() { return static_cast<double>(random_() >> 11) * 0x1p-53; }
  float texel() { return static_cast<float>((uniform() - 0.5) * std::exp2(static_cast<double>(random_() % 30) - 25)); }

 private:
  std::mt19937_64 random_;
};

void add_patch(SkeletexModel& model, Rectangle rectangle, SegmentTopology topology, PatchEnd head, PatchEnd tail,
               Numbers& numbers) {
  Patch patch{rectangle, model.patches.size() % 2 == 0 ? Method::kVsm : Method::kSpd, topology, {}};
  for (int row = 0; row < rectangle.height; ++row)
    patch.row_u.push_back(row == 0                      ? 0
                          : row == rectangle.height - 1 ? 1
                                                        : (row + 0.5 * numbers.uniform()) / (rectangle.height - 1));
  model.patches.push_back(std::move(patch));
  model.ends.push_back({std::move(head), std::move(tail)});
}

std::vector<SeamSample> samples(int count, Numbers& numbers) {
  std::vector<SeamSample> result;
  for (int i = 0; i < count; ++i) result.push_back({numbers.uniform(), std::abs(static_cast<double>(numbers.texel()))});
  return result;
}

void fill(SkeletexModel& model, int width, int height, Numbers& numbers) {
  model.origin = {numbers.uniform(), -numbers.uniform(), 1e-300};
  model.diagonal = 1 + numbers.uniform();
  model.texture.width = width;
  model.texture.height = height;
  for (std::vector<float>* plane : {&model.texture.along, &model.texture.around, &model.texture.out}) {
    for (int i = 0; i < width * height; ++i) plane->push_back(numbers.texel());
    (*plane)[0] = -0.0f;
    (*plane)[1] = std::numeric_limits<float>::denorm_min();
  }
  model.sampling = {.is_prefiltered = true, .is_snapped = false, .is_fitted = true};
  model.encoder_settings = R"({"method":"vsm","size":[512,512]})";
}

/// A stem that ends and two bones that begin at one node (three arcs between two corners), and a fourth bone that goes
/// on from one of them (a closed arc).
SkeletexModel branch_model(int width = 40, int height = 20) {
  Numbers numbers(kSeed);
  SkeletexModel model;
  model.skeleton = {{{"stem", Vec3(0, -2, 0)},
                     {"fork \"\xc3\xbc\"", Vec3::Zero()},
                     {"left", Vec3(-1.0 / 3, 1, 0)},
                     {"right", Vec3(1, 1.1, 0)},
                     {"tip", Vec3(2, 2, 0.1)}},
                    {{"stem", 0, 1, Vec3(1, 0.1, numbers.uniform())},
                     {"left", 1, 2, Vec3(0, 0, 1)},
                     {"right", 1, 3, Vec3(0, 0, 1)},
                     {"tip", 3, 4, Vec3(0, 0, -1)}}};
  model.corners = {{1, {0, 1, 2}, samples(1, numbers)[0]}, {1, {0, 1, 2}, samples(1, numbers)[0]}};
  model.arcs = {{1, {1, 2}, {0, 1}, samples(5, numbers)},
                {1, {0, 2}, {0, 1}, samples(1, numbers)},
                {1, {0, 1}, {1, 0}, samples(7, numbers)},
                {3, {2, 3}, {-1, -1}, samples(9, numbers)}};
  add_patch(model, {0, 0, width / 2, height / 2}, SegmentTopology::kDisk, {}, {{{1, false}, {2, false}}}, numbers);
  add_patch(model, {width / 2, 0, width - width / 2, height / 2}, SegmentTopology::kDisk, {{{0, false}, {2, false}}},
            {}, numbers);
  add_patch(model, {0, height / 2, width / 2, height - height / 2}, SegmentTopology::kAnnulus,
            {{{0, true}, {1, false}}}, {{{3, false}}}, numbers);
  add_patch(model, {width / 2, height / 2, width - width / 2, height - height / 2}, SegmentTopology::kDisk,
            {{{3, false}}}, {}, numbers);
  fill(model, width, height, numbers);
  return model;
}

SkeletexModel lone_bone_model() {
  Numbers numbers(kSeed + 1);
  SkeletexModel model;
  model.diagonals = DiagonalRule::kSmooth;
  model.skeleton = {{{"a", Vec3::Zero()}, {"b", Vec3(0, 0, 1)}}, {{"bone", 0, 1, Vec3(1, 0, 0)}}};
  add_patch(model, {0, 0, 8, 5}, SegmentTopology::kSphere, {}, {}, numbers);
  fill(model, 8, 5, numbers);
  return model;
}

bool same_bits(const std::vector<float>& a, const std::vector<float>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}
void expect_same(double a, double b) { EXPECT_EQ(std::bit_cast<std::uint64_t>(a), std::bit_cast<std::uint64_t>(b)); }
void expect_same(const Vec3& a, const Vec3& b) {
  for (int i = 0; i < 3; ++i) expect_same(a[i], b[i]);
}
void expect_same(const SeamSample& a, const SeamSample& b) {
  expect_same(a.turn, b.turn);
  expect_same(a.distance, b.distance);
}

std::array<bool, 3> flags_of(const TexelSampling& sampling) {
  return {sampling.is_prefiltered, sampling.is_snapped, sampling.is_fitted};
}

void expect_same(const SkeletexModel& a, const SkeletexModel& b) {
  ASSERT_EQ(a.skeleton.nodes.size(), b.skeleton.nodes.size());
  ASSERT_EQ(a.skeleton.bones.size(), b.skeleton.bones.size());
  for (std::size_t i = 0; i < a.skeleton.nodes.size(); ++i) {
    EXPECT_EQ(a.skeleton.nodes[i].name, b.skeleton.nodes[i].name);
    expect_same(a.skeleton.nodes[i].position, b.skeleton.nodes[i].position);
  }
  for (std::size_t i = 0; i < a.skeleton.bones.size(); ++i) {
    EXPECT_EQ(a.skeleton.bones[i].name, b.skeleton.bones[i].name);
    EXPECT_EQ(a.skeleton.bones[i].head, b.skeleton.bones[i].head);
    EXPECT_EQ(a.skeleton.bones[i].tail, b.skeleton.bones[i].tail);
    expect_same(a.skeleton.bones[i].s.value(), b.skeleton.bones[i].s.value());
  }
  expect_same(a.origin, b.origin);
  expect_same(a.diagonal, b.diagonal);
  EXPECT_EQ(a.genus, b.genus);
  EXPECT_EQ(a.diagonals, b.diagonals);
  EXPECT_EQ(flags_of(a.sampling), flags_of(b.sampling));
  EXPECT_EQ(a.encoder_settings, b.encoder_settings);
  ASSERT_EQ(a.patches.size(), b.patches.size());
  for (std::size_t i = 0; i < a.patches.size(); ++i) {
    const Rectangle &p = a.patches[i].rectangle, &q = b.patches[i].rectangle;
    EXPECT_EQ((std::array{p.x, p.y, p.width, p.height}), (std::array{q.x, q.y, q.width, q.height}));
    EXPECT_EQ(a.patches[i].method, b.patches[i].method);
    EXPECT_EQ(a.patches[i].topology, b.patches[i].topology);
    EXPECT_EQ(a.patches[i].row_u, b.patches[i].row_u);
    for (const int end : {0, 1}) {
      ASSERT_EQ(a.ends[i][end].arcs.size(), b.ends[i][end].arcs.size());
      for (std::size_t k = 0; k < a.ends[i][end].arcs.size(); ++k) {
        EXPECT_EQ(a.ends[i][end].arcs[k].arc, b.ends[i][end].arcs[k].arc);
        EXPECT_EQ(a.ends[i][end].arcs[k].is_reversed, b.ends[i][end].arcs[k].is_reversed);
      }
    }
  }
  ASSERT_EQ(a.arcs.size(), b.arcs.size());
  for (std::size_t i = 0; i < a.arcs.size(); ++i) {
    EXPECT_EQ(a.arcs[i].node, b.arcs[i].node);
    EXPECT_EQ(a.arcs[i].bones, b.arcs[i].bones);
    EXPECT_EQ(a.arcs[i].corners, b.arcs[i].corners);
    ASSERT_EQ(a.arcs[i].samples.size(), b.arcs[i].samples.size());
    for (std::size_t k = 0; k < a.arcs[i].samples.size(); ++k) expect_same(a.arcs[i].samples[k], b.arcs[i].samples[k]);
  }
  ASSERT_EQ(a.corners.size(), b.corners.size());
  for (std::size_t i = 0; i < a.corners.size(); ++i) {
    EXPECT_EQ(a.corners[i].node, b.corners[i].node);
    EXPECT_EQ(a.corners[i].bones, b.corners[i].bones);
    expect_same(a.corners[i].sample, b.corners[i].sample);
  }
  EXPECT_EQ(a.texture.width, b.texture.width);
  EXPECT_EQ(a.texture.height, b.texture.height);
}

std::string error_of(const std::function<void()>& run) {
  try {
    run();
  } catch (const IoError& error) {
    return error.what();
  }
  return "no error";
}

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

TEST(ModelFile, GivesEveryNumberBackBitByBit) {
  const ScratchFolder folder;
  for (const SkeletexModel& model : {branch_model(), lone_bone_model()})
    for (const ExrCompression compression : {ExrCompression::kNone, ExrCompression::kZip, ExrCompression::kPiz}) {
      write_model(folder / "m.skx.exr", model, {TexelFormat::kFloat, compression});
      const SkeletexModel read = read_model(folder / "m.skx.exr");
      expect_same(model, read);
      EXPECT_TRUE(same_bits(model.texture.along, read.texture.along));
      EXPECT_TRUE(same_bits(model.texture.around, read.texture.around));
      EXPECT_TRUE(same_bits(model.texture.out, read.texture.out));
      EXPECT_EQ(folder.file_count(), 1);
    }
}

TEST(ModelFile, HalfTexelsAreTheNearestHalvesAndAllElseStaysExact) {
  const ScratchFolder folder;
  const SkeletexModel model = branch_model();
  write_model(folder / "m.skx.exr", model, {TexelFormat::kHalf, ExrCompression::kPiz});
  const SkeletexModel read = read_model(folder / "m.skx.exr");
  expect_same(model, read);
  for (std::size_t i = 0; i < model.texture.out.size(); ++i) {
    // Half precision: 11 significant bits, 2^-24 between the smallest numbers.
    const float x = model.texture.out[i];
    EXPECT_LE(std::abs(read.texture.out[i] - x), std::max(std::abs(x) * 0x1p-11f, 0x1p-25f));
  }
  SkeletexModel large = model;
  large.diagonal = 1e6;
  large.texture.out[3] = 1e6f;
  EXPECT_TRUE(contains(error_of([&] {
                         write_model(folder / "large.skx.exr", large, {TexelFormat::kHalf, ExrCompression::kZip});
                       }),
                       "half"));
  EXPECT_EQ(folder.file_count(), 1);
}

TEST(ModelFile, WeightsOfBonesAreLayersOfTheirOwn) {
  SkeletexModel model = branch_model();
  model.skeleton.bones[3].name = "left hand: tip";  // not what names of layers hold
  const std::size_t texels = model.texture.along.size();
  for (std::size_t bone = 0; bone < model.skeleton.bones.size(); ++bone) {
    std::vector<float>& plane = model.bone_weights.emplace_back(texels);
    for (std::size_t i = 0; i < texels; ++i) plane[i] = static_cast<float>((i * (bone + 3)) % 17) / 16;
  }
  EXPECT_EQ(weight_channels(model.skeleton),
            (std::vector<std::string>{"weights.stem", "weights.left", "weights.right", "weights.left_hand__tip"}));
  const ScratchFolder scratch;
  const auto path = scratch / "weights.skx.exr";
  write_model(path, model);
  const SkeletexModel back = read_model(path);
  ASSERT_EQ(back.bone_weights.size(), model.bone_weights.size());
  for (std::size_t bone = 0; bone < model.bone_weights.size(); ++bone)
    EXPECT_TRUE(same_bits(back.bone_weights[bone], model.bone_weights[bone])) << bone;
  expect_same(back, model);

  model.bone_weights[1][5] = -0.1f;
  try {
    write_model(scratch / "bad.skx.exr", model);
    FAIL() << "a weight below 0 was written";
  } catch (const IoError& error) {
    EXPECT_NE(std::string(error.what()).find("weights.left at column 5, row 0"), std::string::npos) << error.what();
  }
  EXPECT_FALSE(std::filesystem::exists(scratch / "bad.skx.exr"));
}

TEST(ModelFile, LayersComeBackUnderTheirNames) {
  SkeletexModel model = branch_model();
  const std::size_t texels = model.texture.along.size();
  const auto plane = [texels](int seed) {
    std::vector<float> values(texels);
    for (std::size_t i = 0; i < texels; ++i) values[i] = static_cast<float>((i * (seed + 3)) % 17) / 16 - 0.5f;
    return values;
  };
  model.layers = {{"normal", LayerKind::kNormal, {plane(0), plane(1)}},
                  {"colour", LayerKind::kColour, {plane(2), plane(3), plane(4)}},
                  {"heat of today", LayerKind::kNumber, {plane(5)}},
                  {"heat:of today", LayerKind::kNumber, {plane(6)}}};
  for (float& x : model.layers[2].planes[0]) x = 1 / (x + 3);  // no half floats
  using Names = std::vector<std::vector<std::string>>;
  EXPECT_EQ(
      layer_channels(model.layers),
      (Names{
          {"normal.R", "normal.G"}, {"colour.R", "colour.G", "colour.B"}, {"heat_of_today.Y"}, {"heat_of_today_3.Y"}}));
  model.stance = Stance{Vec3::UnitZ(), -Vec3::UnitY()};
  const ScratchFolder scratch;
  write_model(scratch / "m.skx.exr", model);
  const SkeletexModel back = read_model(scratch / "m.skx.exr");
  expect_same(back, model);
  ASSERT_TRUE(back.stance.has_value());
  EXPECT_EQ(back.stance->up, model.stance->up);
  EXPECT_EQ(back.stance->front, model.stance->front);
  ASSERT_EQ(back.layers.size(), model.layers.size());
  for (std::size_t i = 0; i < back.layers.size(); ++i) {
    EXPECT_EQ(back.layers[i].name, model.layers[i].name);
    EXPECT_EQ(back.layers[i].kind, model.layers[i].kind);
    EXPECT_EQ(back.layers[i].planes, model.layers[i].planes);
  }
  SkeletexModel bad = model;
  bad.layers[0].planes[1][7] = 1.5f;  // no normal
  EXPECT_THROW(write_model(scratch / "bad.skx.exr", bad), IoError);
  bad = model;
  bad.layers[1].name = "normal";
  EXPECT_THROW(write_model(scratch / "bad.skx.exr", bad), IoError);
  bad = model;
  bad.layers.push_back({"paint", LayerKind::kColour, {plane(2), plane(3), plane(4)}});  // a second layer of colours
  EXPECT_THROW(write_model(scratch / "bad.skx.exr", bad), IoError);
  EXPECT_FALSE(std::filesystem::exists(scratch / "bad.skx.exr"));
}

TEST(ModelFile, TheSameModelGivesTheSameBytes) {
  const ScratchFolder folder;
  const SkeletexModel model = branch_model(200, 100);
  for (const ExrCompression compression : {ExrCompression::kNone, ExrCompression::kZip, ExrCompression::kPiz}) {
    write_model(folder / "a.skx.exr", model, {TexelFormat::kFloat, compression});
    const SkeletexModel read = read_model(folder / "a.skx.exr");
    write_model(folder / "b.skx.exr", read, {TexelFormat::kFloat, compression});
    EXPECT_EQ(read_bytes(folder / "a.skx.exr"), read_bytes(folder / "b.skx.exr"));
  }
}

TEST(ModelFile, IsCompressedWhereThatPays) {
  const ScratchFolder folder;
  std::mt19937 random(1);
  std::uniform_int_distribution<std::uint32_t> bits;
  for (const bool is_noise : {false, true}) {
    SCOPED_TRACE(is_noise);
    SkeletexModel model = branch_model(200, 200);
    for (std::vector<float>* plane : {&model.texture.along, &model.texture.around, &model.texture.out})
      for (float& x : *plane) x = is_noise ? std::bit_cast<float>(0x3f000000u | (bits(random) >> 9)) : 1.0f;
    const auto size_with = [&](ExrCompression compression) {
      write_model(folder / "m.skx.exr", model, {TexelFormat::kFloat, compression});
      EXPECT_TRUE(same_bits(model.texture.out, read_model(folder / "m.skx.exr").texture.out));
      return std::filesystem::file_size(folder / "m.skx.exr");
    };
    const auto zip = size_with(ExrCompression::kZip), none = size_with(ExrCompression::kNone);
    EXPECT_LE(zip, none);
    EXPECT_EQ(size_with(ExrCompression::kAuto), is_noise ? none : zip);
  }
}

TEST(ModelFile, TheHeaderAloneHoldsEverythingButTexels) {
  const ScratchFolder folder;
  const SkeletexModel model = branch_model();
  write_model(folder / "m.skx.exr", model);
  const nlohmann::json header = read_model_header(folder / "m.skx.exr");
  EXPECT_EQ(header["format"], "skeletex");
  EXPECT_EQ(header["version"], kModelFileVersion);
  EXPECT_EQ(header["patches"].size(), 4u);
  EXPECT_EQ(header["encoder"]["method"], "vsm");
  expect_same(model, model_from_json(header, "header"));
}

/// Files before "sampling" have it in the encoder's record.
TEST(ModelFile, OlderHeadersTellTheSamplingInTheEncodersRecord) {
  nlohmann::json header = model_to_json(branch_model(), "header");
  header.erase("sampling");
  const auto sampling_of = [&](const char* record) {
    header["encoder"] = nlohmann::json::parse(record);
    return flags_of(model_from_json(header, "header").sampling);
  };
  EXPECT_EQ(sampling_of(R"({"prefilter": true, "snap": true, "fit": false})"), (std::array{true, true, false}));
  EXPECT_EQ(sampling_of(R"({"prefilter": true, "fit": true})"), (std::array{true, false, true}));
  EXPECT_EQ(sampling_of(R"({"prefilter": null, "snap": 1, "fit": "true"})"), (std::array{false, false, false}));
  EXPECT_EQ(sampling_of("{}"), (std::array{false, false, false}));
  header.erase("encoder");
  EXPECT_EQ(flags_of(model_from_json(header, "header").sampling), (std::array{false, false, false}));
}

TEST(ModelFile, NothingDependsOnTheEncodersRecordWhereTheSamplingIsTold) {
  nlohmann::json header = model_to_json(branch_model(), "header");
  header["encoder"] = {{"prefilter", nullptr}, {"snap", true}};
  EXPECT_EQ(flags_of(model_from_json(header, "header").sampling), flags_of(branch_model().sampling));
  header["sampling"]["snapped"] = "no";
  EXPECT_TRUE(contains(error_of([&] { model_from_json(header, "m.skx.exr"); }), "\"sampling\", \"snapped\""));
}

TEST(ModelFile, RefusesModelsWhosePartsDoNotFitTogether) {
  const ScratchFolder folder;
  using Break = std::function<void(SkeletexModel&)>;
  const std::vector<std::pair<const char*, Break>> breaks{
      {"patches[1]", [](SkeletexModel& m) { m.patches[1].rectangle.x -= 1; }},
      {"patches[3]", [](SkeletexModel& m) { m.patches[3].rectangle.width += 1; }},
      {"patches[3]", [](SkeletexModel& m) { m.patches[3].rectangle.x = 2147483647; }},
      {"patches[0]", [](SkeletexModel& m) { m.patches[0].rectangle.height = 1; }},
      {"row_u", [](SkeletexModel& m) { m.patches[2].row_u.pop_back(); }},
      {"row_u", [](SkeletexModel& m) { std::swap(m.patches[2].row_u[3], m.patches[2].row_u[4]); }},
      {"row_u", [](SkeletexModel& m) { m.patches[2].row_u[3] = std::nan(""); }},
      {"row_u", [](SkeletexModel& m) { m.patches[2].row_u.back() = 0.99; }},
      {"topology", [](SkeletexModel& m) { m.patches[2].topology = SegmentTopology::kDisk; }},
      {"patches", [](SkeletexModel& m) { m.patches.pop_back(); }},
      {"skeleton", [](SkeletexModel& m) { m.skeleton.bones[1].tail = 7; }},
      {"skeleton", [](SkeletexModel& m) { m.skeleton.bones[1].s = std::nullopt; }},
      {"parallel", [](SkeletexModel& m) { m.skeleton.bones[0].s = Vec3(0, 1, 0); }},
      {"millionth", [](SkeletexModel& m) { m.skeleton.nodes[0].position = Vec3::Zero(); }},
      {"diagonal", [](SkeletexModel& m) { m.diagonal = 0; }},
      {"genus", [](SkeletexModel& m) { m.genus = -1; }},
      {"origin", [](SkeletexModel& m) { m.origin[1] = std::numeric_limits<double>::infinity(); }},
      {"ends.head", [](SkeletexModel& m) { m.ends[2][0].arcs[0].arc = 4; }},
      {"ends.head", [](SkeletexModel& m) { m.ends[2][0].arcs[0].arc = -1; }},
      {"ends.head", [](SkeletexModel& m) { m.ends[2][0].arcs[0].is_reversed = false; }},
      {"ends.head",
       [](SkeletexModel& m) {
         m.ends[0][0].arcs.push_back({3, false});
       }},
      {"ends.tail", [](SkeletexModel& m) { m.ends[2][1].arcs.clear(); }},
      {"arcs[0]", [](SkeletexModel& m) { m.arcs[0].bones[1] = 3; }},
      {"arcs[0]", [](SkeletexModel& m) { m.arcs[0].corners[1] = 2; }},
      {"arcs[1]", [](SkeletexModel& m) { m.arcs[1].samples.clear(); }},
      {"arcs[3]", [](SkeletexModel& m) { m.arcs[3].samples.resize(2); }},
      {"arcs[2]", [](SkeletexModel& m) { m.arcs[2].samples[3].turn = 1; }},
      {"arcs[2]", [](SkeletexModel& m) { m.arcs[2].samples[3].distance = -1; }},
      {"begin where", [](SkeletexModel& m) { std::swap(m.arcs[1].corners[0], m.arcs[1].corners[1]); }},
      {"arcs[4]", [](SkeletexModel& m) { m.arcs.push_back(m.arcs[3]); }},
      {"corners[1]", [](SkeletexModel& m) { m.corners[1].bones[2] = 1; }},
      {"corners[0]", [](SkeletexModel& m) { m.corners[0].sample.turn = std::nan(""); }},
      {"channel G", [](SkeletexModel& m) { m.texture.around[47] = std::nanf(""); }},
      {"channel B", [](SkeletexModel& m) { m.texture.out.pop_back(); }},
      {"encoder", [](SkeletexModel& m) { m.encoder_settings = "[1]"; }},
      {"encoder", [](SkeletexModel& m) { m.encoder_settings = "{"; }},
      {"UTF-8", [](SkeletexModel& m) { m.skeleton.nodes[0].name = "\xff"; }},
  };
  for (const auto& [expected, damage] : breaks) {
    SkeletexModel model = branch_model();
    damage(model);
    const std::string message = error_of([&] { write_model(folder / "m.skx.exr", model); });
    EXPECT_TRUE(contains(message, expected)) << expected << ": " << message;
    EXPECT_EQ(folder.file_count(), 0) << expected;
  }
}

/// What a user, a script or a bad byte may make of a header. Each is refused, or gives a mesh of finite numbers.
TEST(ModelFile, EditedHeadersAreRefusedOrGiveFiniteMeshes) {
  const SkeletexModel model = SyntheticSurface(y_branch(), 0.25).model({{24, 11}, {24, 11}, {24, 11}});
  const nlohmann::json header = model_to_json(model, "header");
  const auto at = [](const char* pointer) { return nlohmann::json::json_pointer(pointer); };
  const nlohmann::json first_head = header.at(at("/skeleton/nodes/0/position")),
                       other = header.at(at("/skeleton/nodes/2/position"));
  const std::vector<std::pair<std::string, nlohmann::json>> edits{
      {"/skeleton/nodes/0/position", other},  // a bone folded back on its neighbour, of the same length
      {"/skeleton/nodes/0/position",
       {0.3 * other[0].get<double>(), 0.3 * other[1].get<double>(), 0.3 * other[2].get<double>()}},  // and shorter
      {"/skeleton/nodes/0/position/0", 1e30},
      {"/skeleton/nodes/0/position/1", -1e30},
      {"/skeleton/nodes/0/position/2", 1e300},
      {"/skeleton/nodes/0/position/2", nullptr},
      {"/skeleton/nodes/1/position", first_head},
      {"/skeleton/nodes/2/position/0", 1e5},
      {"/skeleton/bones/0/tail", 0},
      {"/skeleton/bones/0/s", {0, 0, 0}},
      {"/skeleton/bones/0/s/0", 1e300},
      {"/skeleton/bones/1/s/1", 1e-300},
      {"/origin/0", 1e300},
      {"/origin/1", 1e30},
      {"/origin/2", "x"},
      {"/diagonal", 0},
      {"/diagonal", -1},
      {"/diagonal", 1e300},
      {"/diagonal", 1e-300},
      {"/arcs/0/samples/1", 1e39},
      {"/arcs/0/samples/1", -1},
      {"/arcs/0/samples/0", 1e300},
      {"/arcs/1/samples/3", 1e300},
      {"/corners/0/sample/1", 1e39},
      {"/corners/1/sample/0", -0.5},
      {"/patches/0/row_u/3", 1e300},
      {"/genus", -1}};
  ClContext device;
  int refused = 0;
  for (const auto& [place, value] : edits) {
    nlohmann::json edited = header;
    edited.at(at(place.c_str())) = value;
    SCOPED_TRACE(place + " = " + value.dump());
    try {
      SkeletexModel read = model_from_json(edited, "file.skx.exr");
      read.texture = model.texture;
      for (const Vec3& p : reconstruct_mesh(device, read).positions) ASSERT_TRUE(p.allFinite());
    } catch (const Error& error) {
      ++refused;
      EXPECT_NE(std::string(error.what()).find("file.skx.exr"), std::string::npos) << error.what();
    }
  }
  EXPECT_GE(refused, 23);
}

TEST(ModelFile, MeshesWithoutFiniteNumbersAreNotWritten) {
  const ScratchFolder folder;
  for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity()})
    for (const char* name : {"a.ply", "a.obj"}) {
      const TriangleMesh mesh{{{0, 0, 0}, {1, bad, 0}, {0, 1, 0}}, {{0, 1, 2}}};
      try {
        write_mesh(folder / name, mesh);
        FAIL() << "written: " << bad;
      } catch (const IoError& error) {
        EXPECT_NE(std::string(error.what()).find("y of vertex 1"), std::string::npos) << error.what();
      }
    }
  EXPECT_EQ(folder.file_count(), 0);
}

TEST(ModelFile, SaysWhatIsWrongWithForeignTruncatedAndNewerFiles) {
  const ScratchFolder folder;
  const auto path = folder / "m.skx.exr";
  const auto message_for = [&](const std::string& bytes) {
    write_bytes(path, bytes);
    return error_of([&] { read_model(path); });
  };
  write_model(path, branch_model());
  const std::string good = read_bytes(path);
  for (std::size_t size = 8; size < good.size(); size += 37) {
    const std::string message = message_for(good.substr(0, size));
    EXPECT_TRUE(contains(message, "ends early")) << size << ": " << message;
  }
  EXPECT_TRUE(contains(message_for(""), "not an OpenEXR file"));
  EXPECT_TRUE(contains(message_for("OFF\n3 1 0\n"), "not an OpenEXR file"));
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string bytes = good;
    const std::size_t at = bytes.find(from);
    EXPECT_NE(at, std::string::npos);
    return bytes.replace(at, from.size(), to);
  };
  EXPECT_TRUE(contains(message_for(with("\"version\":2", "\"version\":3")), "newer"));
  EXPECT_TRUE(contains(message_for(with(std::string("skeletex\0string", 15), std::string("skeletix\0string", 15))),
                       "not a model"));
  EXPECT_TRUE(contains(message_for(with("\"width\":40", "\"width\":41")), "resized"));
  std::string window(16, '\0');
  const int corner[2] = {39, 19};
  std::memcpy(window.data() + 8, corner, 8);
  std::string absurd = window;
  const int far[2] = {2000000000, 2000000000};
  std::memcpy(absurd.data() + 8, far, 8);
  EXPECT_TRUE(contains(message_for(with(window, absurd)), "2000000001 x 2000000001"));
  EXPECT_TRUE(contains(error_of([&] { read_model(folder / "none.skx.exr"); }), "cannot open"));
  EXPECT_TRUE(contains(error_of([&] { read_model(folder.path()); }), "folder"));
}

TEST(ModelFile, NoFlippedByteIsReadAsSomethingElse) {
  const ScratchFolder folder;
  const auto path = folder / "m.skx.exr";
  SkeletexModel model = branch_model();
  model.bone_weights.assign(model.skeleton.bones.size(), std::vector<float>(model.texture.along.size(), 0.25f));
  for (const ExrCompression compression : {ExrCompression::kNone, ExrCompression::kZip, ExrCompression::kPiz})
    for (const TexelFormat format : {TexelFormat::kFloat, TexelFormat::kHalf}) {
      write_model(path, model, {format, compression});
      const SkeletexModel good = read_model(path);
      const std::string bytes = read_bytes(path);
      std::mt19937_64 random(kSeed);
      for (int i = 0; i < 400; ++i) {
        std::string damaged = bytes;
        damaged[random() % bytes.size()] ^= static_cast<char>(1 << (random() % 8));
        write_bytes(path, damaged);
        try {
          expect_same(read_model(path), good);  // bytes without a meaning, such as in the display window
        } catch (const IoError& error) {
          EXPECT_NE(std::string(error.what()).find("m.skx.exr"), std::string::npos) << error.what();
        }
      }
    }
}

TEST(ModelFile, EditedFilesAreRefusedUnlessTheyAreMeant) {
  const ScratchFolder folder;
  const auto path = folder / "m.skx.exr";
  const SkeletexModel model = branch_model();
  write_model(path, model, {TexelFormat::kFloat, ExrCompression::kNone});
  std::string bytes = read_bytes(path);
  bytes[bytes.size() - 2] ^= 1;  // of the last texel
  write_bytes(path, bytes);
  EXPECT_TRUE(contains(error_of([&] { read_model(path); }), "--edited"));
  EXPECT_TRUE(contains(error_of([&] { read_model_header(path); }), "checksum"));
  const SkeletexModel edited = read_model(path, 0, ChecksumRule::kIgnore);
  write_model(path, edited);
  expect_same(read_model(path), edited);
}

TEST(ModelFile, OlderFilesWithoutAChecksumAreRead) {
  const ScratchFolder folder;
  const auto path = folder / "m.skx.exr";
  write_model(path, branch_model());
  std::string bytes = read_bytes(path);
  const std::string key = "\"checksum\":\"", version = "\"version\":2";
  const std::size_t at = bytes.find(key);
  ASSERT_NE(at, std::string::npos);
  bytes.replace(at, key.size(), "\"cheskcum\":\"");
  write_bytes(path, bytes);
  EXPECT_TRUE(contains(error_of([&] { read_model(path); }), "no checksum"));
  bytes.replace(bytes.find(version), version.size(), "\"version\":1");
  write_bytes(path, bytes);
  expect_same(read_model(path), branch_model());
}

TEST(ModelFile, TheGenusOfTheHeaderIsThatOfTheSurface) {
  SkeletexModel model = branch_model();
  EXPECT_NO_THROW(check_model(model, "model"));
  model.genus += 1;
  EXPECT_TRUE(contains(error_of([&] { check_model(model, "model"); }), "genus"));
}

TEST(ModelFile, TruncatedFilesAreRefusedByTheHeadersReaderToo) {
  const ScratchFolder folder;
  const auto path = folder / "m.skx.exr";
  write_model(path, branch_model());
  const std::string good = read_bytes(path);
  for (std::size_t size = 0; size < good.size(); size += 53) {
    write_bytes(path, good.substr(0, size));
    EXPECT_TRUE(contains(error_of([&] { read_model_header(path); }), "m.skx.exr")) << size;
  }
}

TEST(ModelFile, ReadsOrRefusesDamagedFilesButNeverCrashes) {
  const ScratchFolder folder;
  const auto path = folder / "m.skx.exr";
  int accepted = 0, refused = 0;
  for (const ExrCompression compression : {ExrCompression::kNone, ExrCompression::kZip, ExrCompression::kPiz}) {
    write_model(path, branch_model(), {TexelFormat::kFloat, compression});
    // Also with the JSON short, so that the damage hits the rest of the header more often.
    for (const std::string& good : {read_bytes(path), [&] {
                                      write_model(path, lone_bone_model(), {TexelFormat::kHalf, compression});
                                      return read_bytes(path);
                                    }()})
      for_each_corruption(good, 1000, kSeed, [&](const std::string& bytes) {
        write_bytes(path, bytes);
        try {
          check_model(read_model(path), "read");
          ++accepted;
        } catch (const IoError&) {
          ++refused;
        }
      });
  }
  EXPECT_GT(refused, accepted);
}

TEST(ModelFile, DamagedJsonIsReadOrRefusedButNeverCrashes) {
  const std::string good = model_to_json(branch_model(), "good").dump();
  int refused = 0;
  for_each_corruption(good, 3000, kSeed, [&](const std::string& bytes) {
    try {
      const nlohmann::json json = nlohmann::json::parse(bytes, nullptr, false);
      if (!json.is_discarded()) model_from_json(json, "damaged");
    } catch (const IoError&) {
      ++refused;
    }
  });
  EXPECT_GT(refused, 100);
  // Every value in turn replaced by one of another kind.
  const nlohmann::json flat = nlohmann::json::parse(good).flatten();
  for (const nlohmann::json& value : {nlohmann::json(), nlohmann::json("x"), nlohmann::json(-1), nlohmann::json(1e300),
                                      nlohmann::json(18446744073709551615u), nlohmann::json(true)})
    for (const auto& [key, old] : flat.items()) {
      if (key.starts_with("/conventions") || key.starts_with("/encoder")) continue;
      nlohmann::json json = nlohmann::json::parse(good);
      json[nlohmann::json::json_pointer(key)] = value;
      try {
        check_model(model_from_json(json, "damaged"), "read");
      } catch (const IoError&) {
      }
    }
}

TEST(ModelFile, LeavesNothingBehindOnAFullDiskOrWithoutAFolder) {
  const ScratchFolder folder;
  const SkeletexModel model = branch_model(200, 100);
  write_model(folder / "m.skx.exr", model);
  const std::string good = read_bytes(folder / "m.skx.exr");
  for (const std::size_t space :
       {std::size_t{0}, std::size_t{100}, std::size_t{5000}, good.size() / 2, good.size() - 1}) {
    const FullDisk disk(space);
    EXPECT_TRUE(contains(error_of([&] { write_model(folder / "m.skx.exr", model); }), "cannot write")) << space;
    EXPECT_TRUE(contains(error_of([&] { write_model(folder / "new.skx.exr", model); }), "cannot write")) << space;
  }
  EXPECT_EQ(folder.file_count(), 1);
  EXPECT_EQ(read_bytes(folder / "m.skx.exr"), good);
  EXPECT_TRUE(contains(error_of([&] { write_model(folder / "none/m.skx.exr", model); }), "does not exist"));
  EXPECT_TRUE(contains(error_of([&] { write_model(folder / "m.skx.exr/m.skx.exr", model); }), "does not exist"));
}

}  // namespace
}  // namespace skeletex
