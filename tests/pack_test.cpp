// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>

#include "skeletex/convert/layout/pack_atlas.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

/// Shares over two orders of magnitude, side ratios from long limbs to flat trunks.
std::vector<PatchRequest> random_requests(int count, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::vector<PatchRequest> requests(count);
  for (PatchRequest& request : requests) request = {std::exp(normal(random)), std::exp(0.7 * normal(random) + 0.3)};
  return requests;
}

double texels(const Rectangle& r) { return static_cast<double>(r.width) * r.height; }

/// No two rectangles overlap, none leaves the texture, none is below 4 x 4; with the areas adding up, nothing is blank.
void expect_tiling(const AtlasLayout& layout, int width, int height) {
  double area = 0;
  for (std::size_t i = 0; i < layout.rectangles.size(); ++i) {
    const Rectangle& a = layout.rectangles[i];
    area += texels(a);
    EXPECT_GE(a.width, 4);
    EXPECT_GE(a.height, 4);
    EXPECT_TRUE(a.x >= 0 && a.y >= 0 && a.x + a.width <= width && a.y + a.height <= height);
    for (std::size_t j = 0; j < i; ++j) {
      const Rectangle& b = layout.rectangles[j];
      EXPECT_TRUE(a.x + a.width <= b.x || b.x + b.width <= a.x || a.y + a.height <= b.y || b.y + b.height <= a.y)
          << i << " and " << j;
    }
  }
  EXPECT_EQ(area, static_cast<double>(width) * height);
  EXPECT_NEAR(layout.used_fraction, area / (static_cast<double>(width) * height), 1e-15);
}

}  // namespace

TEST(Pack, FillsEveryTextureWithoutGapOrOverlap) {
  for (const auto& [width, height] :
       {std::pair{64, 64}, {100, 100}, {128, 512}, {1000, 64}, {777, 513}, {4096, 4096}, {4096, 256}})
    for (const int count : {1, 2, 3, 4, 7, 15, 23, 40, 60}) {
      SCOPED_TRACE(std::to_string(count) + " patches, " + std::to_string(width) + " x " + std::to_string(height));
      const AtlasLayout layout = pack_atlas(random_requests(count, 7u * count), width, height);
      ASSERT_EQ(layout.rectangles.size(), static_cast<std::size_t>(count));
      expect_tiling(layout, width, height);
      EXPECT_GE(layout.used_fraction, 0.95);
    }
}

TEST(Pack, PaintsEveryTexelOfASmallTextureOnce) {
  for (const int count : {1, 5, 23, 60}) {
    const AtlasLayout layout = pack_atlas(random_requests(count, 3u * count), 64, 96);
    std::vector<int> painted(64 * 96, 0);
    for (const Rectangle& r : layout.rectangles)
      for (int y = r.y; y < r.y + r.height; ++y)
        for (int x = r.x; x < r.x + r.width; ++x) ++painted[y * 64 + x];
    EXPECT_EQ(std::count(painted.begin(), painted.end(), 1), 64 * 96) << count;
  }
}

TEST(Pack, HoldsAsManyPatchesAsSmallestRectanglesFit) {
  expect_tiling(pack_atlas(random_requests(40, 1), 32, 32), 32, 32);
  expect_tiling(pack_atlas(random_requests(64, 2), 32, 32), 32, 32);
  expect_tiling(pack_atlas(random_requests(49, 3), 31, 31), 31, 31);
  expect_tiling(pack_atlas(random_requests(60, 4), 4, 240), 4, 240);
  expect_tiling(pack_atlas(random_requests(1, 5), 4, 4), 4, 4);
}

TEST(Pack, GivesEveryPatchItsShareOfTheTexels) {
  for (const int count : {4, 15, 40}) {
    const auto requests = random_requests(count, 11u * count);
    double sum = 0;
    for (const PatchRequest& request : requests) sum += request.share;
    const AtlasLayout layout = pack_atlas(requests, 1024, 1024);
    for (int i = 0; i < count; ++i) {
      // Each cut is rounded to a texel and the tree is rarely deeper than a dozen levels.
      const double wanted = requests[i].share / sum * 1024 * 1024;
      EXPECT_NEAR(texels(layout.rectangles[i]) / wanted, 1, 12 / std::sqrt(wanted)) << count << " patches, patch " << i;
    }
  }
}

TEST(Pack, GivesTinyPatchesTheSmallestRectangleAndTheRestItsProportions) {
  std::vector<PatchRequest> requests(8, {1e-9, 1});
  requests.push_back({2, 1});
  requests.push_back({1, 1});
  const AtlasLayout layout = pack_atlas(requests, 256, 256);
  expect_tiling(layout, 256, 256);
  for (int i = 0; i < 8; ++i) EXPECT_LE(texels(layout.rectangles[i]), 64);
  EXPECT_NEAR(texels(layout.rectangles[8]) / texels(layout.rectangles[9]), 2, 0.1);
}

TEST(Pack, MatchesWantedSideRatios) {
  // Mean of |log(got / wanted)| weighted by share. Unit squares would be off by 0.56 in the mean for these requests.
  for (const int count : {15, 40}) {
    double mismatch = 0;
    const int layouts = 6;
    for (int seed = 0; seed < layouts; ++seed) {
      const auto requests = random_requests(count, 100u + seed);
      double sum = 0;
      for (const PatchRequest& request : requests) sum += request.share;
      const AtlasLayout layout = pack_atlas(requests, 512, 512);
      for (int i = 0; i < count; ++i) {
        const Rectangle& r = layout.rectangles[i];
        mismatch += requests[i].share / sum *
                    std::abs(std::log(static_cast<double>(r.width) / r.height / requests[i].columns_per_row));
      }
    }
    EXPECT_LT(mismatch / layouts, 0.25) << count;
  }
}

TEST(Pack, FindsALayoutThatMatchesExactly) {
  // A square cut in two by 3 : 1, the slice cut again into halves.
  const std::vector<PatchRequest> requests{{6, 0.75}, {1, 0.5}, {1, 0.5}};
  const AtlasLayout layout = pack_atlas(requests, 256, 256);
  EXPECT_EQ(layout.rectangles[0].width, 192);
  EXPECT_EQ(layout.rectangles[0].height, 256);
  for (int i = 1; i < 3; ++i) {
    EXPECT_EQ(layout.rectangles[i].width, 64);
    EXPECT_EQ(layout.rectangles[i].height, 128);
  }
}

TEST(Pack, GivesTheSameLayoutForTheSameDemands) {
  const auto requests = random_requests(25, 5);
  const AtlasLayout a = pack_atlas(requests, 512, 512), b = pack_atlas(requests, 512, 512);
  for (std::size_t i = 0; i < requests.size(); ++i) {
    EXPECT_EQ(a.rectangles[i].x, b.rectangles[i].x);
    EXPECT_EQ(a.rectangles[i].y, b.rectangles[i].y);
    EXPECT_EQ(a.rectangles[i].width, b.rectangles[i].width);
    EXPECT_EQ(a.rectangles[i].height, b.rectangles[i].height);
  }
}

TEST(Pack, DoesNotDependOnTheUnitOfTheShares) {
  auto requests = random_requests(25, 5);
  const AtlasLayout a = pack_atlas(requests, 512, 512);
  for (PatchRequest& request : requests) request.share *= 1024;
  const AtlasLayout b = pack_atlas(requests, 512, 512);
  for (std::size_t i = 0; i < requests.size(); ++i) EXPECT_EQ(a.rectangles[i].x, b.rectangles[i].x);
}

TEST(Pack, RefusesATextureThatIsTooSmallAndNamesOneThatIsNot) {
  const auto message = [](int count, int width, int height) -> std::string {
    try {
      pack_atlas(random_requests(count, 1), width, height);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_NE(message(40, 24, 24).find("use 28 x 28"), std::string::npos) << message(40, 24, 24);
  EXPECT_NE(message(60, 16, 4).find("use 61 x 16"), std::string::npos) << message(60, 16, 4);
  EXPECT_NE(message(60, 4, 16).find("use 16 x 61"), std::string::npos) << message(60, 4, 16);
  EXPECT_NE(message(1, 0, 0).find("use 4 x 4"), std::string::npos) << message(1, 0, 0);
  EXPECT_EQ(message(40, 28, 28), "");
  EXPECT_EQ(message(60, 61, 16), "");
}

TEST(Pack, RefusesDemandsThatAreNoPositiveNumbers) {
  const double nan = std::nan("");
  for (const PatchRequest bad : {PatchRequest{0, 1}, {-1, 1}, {1, 0}, {nan, 1}, {1, nan}, {INFINITY, 1}})
    EXPECT_THROW(pack_atlas(std::vector<PatchRequest>{{1, 1}, bad}, 64, 64), InputError);
  EXPECT_THROW(pack_atlas({}, 64, 64), InputError);
}

}  // namespace skeletex
