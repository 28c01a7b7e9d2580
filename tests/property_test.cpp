// SPDX-License-Identifier: MIT
// What holds of every closed body with a skeleton inside, tried on random ones. RapidCheck makes a failure small and
// prints the numbers of its body; RC_PARAMS="seed=N max_success=N" tries others than ctest does.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <numbers>
#include <random>

#include "skeletex/analysis/metro.h"
#include "skeletex/convert/encode_model.h"
#include "skeletex/model/frame.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "support/mesh_topology.h"
#include "support/random_skeleton.h"
#include "support/shapes.h"

namespace skeletex {
namespace {

/// How far texels may lie apart, in diagonals, that differ by rounding alone. Most differ by 1e-8, those of a bone now
/// and then by 3e-5, a hundredth of the way to the next texel.
constexpr double kRounding = 1e-4;

ClContext& device() {
  static ClContext context;
  return context;
}

/// \param side  how many bones a ring has; below 3: a tree
Skeleton random_skeleton(int bones, int side, std::mt19937& random) {
  if (side < 3) return test::star_skeleton(test::spread_directions(bones, 1.2, random), random);
  Skeleton ring;
  for (int i = 0; i < side; ++i) {
    const double angle = 2 * std::numbers::pi * i / side;
    ring.nodes.push_back(
        {"n" + std::to_string(i), 2 * Vec3(std::cos(angle), std::sin(angle), 0) +
                                      test::random_between(random, 0, 0.2) * test::random_direction(random)});
    ring.bones.push_back({"b" + std::to_string(i), i, (i + 1) % side, {}});
  }
  for (int i = 0; i < bones; ++i) {  // arms
    const int node = static_cast<int>(ring.nodes.size());
    ring.nodes.push_back({"arm" + std::to_string(i), 1.6 * ring.nodes[i % side].position + Vec3(0, 0, 0.4)});
    ring.bones.push_back({"arm" + std::to_string(i), node, i % side, {}});
    if (i + 1 == side) break;
  }
  return ring;
}

struct Body {
  Shape shape;
  int genus = 0;
  int size = 0;            ///< of the texture
  std::uint64_t seed = 0;  ///< of what is done to the body
};

/// A star of tubes, or a ring of them with arms, each of its own thickness.
Body any_body() {
  const int bones = *rc::gen::inRange(1, 6).as("bones or arms"), side = *rc::gen::inRange(2, 6).as("ring");
  const int seed = *rc::gen::inRange(0, 1 << 20).as("seed");
  Body body;
  body.size = *rc::gen::inRange(32, 65).as("texels");
  body.seed = static_cast<std::uint64_t>(seed);
  std::mt19937 random(static_cast<unsigned>(seed));
  body.shape.skeleton = random_skeleton(bones, side, random);
  std::vector<double> radii;
  for (std::size_t i = 0; i < body.shape.skeleton.nodes.size(); ++i)
    radii.push_back(test::random_between(random, 0.15, 0.25));
  body.shape.mesh = thickened(body.shape.skeleton, radii, 0.1, 0.11);
  body.genus = side < 3 ? 0 : 1;
  RC_PRE(broken_rule(body.shape.mesh, body.genus).empty());  // arms may touch each other
  const std::vector<BoneBasis> bases = bone_bases(body.shape.skeleton);
  for (std::size_t i = 0; i < bases.size(); ++i) body.shape.skeleton.bones[i].s = bases[i].s;
  return body;
}

EncodeResult encoded(const Body& body, const Shape& shape) {
  EncodeOptions options;
  options.width = options.height = body.size;
  options.has_snap = options.has_fit = false;
  return encode_model(device(), shape.mesh, shape.skeleton, options);
}

/// The largest difference of two models' texels, in diagonals of the first; infinite when patches differ in size. Where
/// the atlas puts them may differ: of arrangements that are equally good, rounding decides.
/// \param scale  how much larger the second one is
double texel_difference(const SkeletexModel& a, const SkeletexModel& b, double scale) {
  double worst = 0;
  for (std::size_t bone = 0; bone < a.patches.size(); ++bone) {
    const Rectangle &r = a.patches[bone].rectangle, &q = b.patches[bone].rectangle;
    if (r.width != q.width || r.height != q.height) return std::numeric_limits<double>::infinity();
    for (int y = 0; y < r.height; ++y)
      for (int x = 0; x < r.width; ++x)
        for (const auto plane : {&DisplacementTexture::along, &DisplacementTexture::around, &DisplacementTexture::out})
          worst = std::max(worst, std::abs((a.texture.*plane)[(r.y + y) * a.texture.width + r.x + x] -
                                           (b.texture.*plane)[(q.y + y) * b.texture.width + q.x + x] / scale));
  }
  return worst / a.diagonal;
}

/// The points that the texels of a patch's last row at an end stand for.
std::vector<Vec3> end_row(const SkeletexModel& model, const SeparationPlanes& separation, int bone, BoneEnd end) {
  const auto& [left, top, width, height] = model.patches[bone].rectangle;
  std::vector<Vec3> points;
  for (int x = 0; x < width; ++x) {
    const std::size_t at =
        static_cast<std::size_t>(end == BoneEnd::kHead ? top : top + height - 1) * model.texture.width + left + x;
    points.push_back(decode_texel(
        tangent_frame(model.skeleton, separation, bone, end == BoneEnd::kHead ? 0 : 1, static_cast<double>(x) / width),
        Vec3(model.texture.along[at], model.texture.around[at], model.texture.out[at]),
        end_position(model.skeleton, bone, BoneEnd::kHead), end_position(model.skeleton, bone, BoneEnd::kTail)));
  }
  return points;
}

}  // namespace

RC_GTEST_PROP(AnyBody, ComesBackClosedAndOfItsGenusFromMapsWithoutFlips, ()) {
  const Body body = any_body();
  const EncodeResult result = encoded(body, body.shape);
  for (const BoneReport& bone : result.report.bones) RC_ASSERT(bone.flipped_triangles == 0);
  const TriangleMesh mesh = reconstruct_mesh(device(), result.model);
  RC_ASSERT(broken_rule(mesh, body.genus) == "");
  RC_ASSERT(signed_volume(mesh) > 0);
}

// The seam is where the surface is as far from the one bone as from the other, so this is the same curve for both.
RC_GTEST_PROP(AnyBody, HasTheTexelsOfBothSidesOfASeamOnIt, ()) {
  const Body body = any_body();
  const SkeletexModel model = encoded(body, body.shape).model;
  const SeparationPlanes separation(model.skeleton);
  for (int bone = 0; bone < static_cast<int>(model.patches.size()); ++bone)
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) {
      if (separation.is_free(bone, end)) continue;
      const std::vector<Vec3> row = end_row(model, separation, bone, end);
      const int node = end_node(model.skeleton, bone, end);
      for (std::size_t x = 0; x < row.size(); ++x) {
        const int other = separation.neighbour(bone, end, static_cast<double>(x) / static_cast<double>(row.size()));
        const BoneEnd other_end =
            end_node(model.skeleton, other, BoneEnd::kHead) == node ? BoneEnd::kHead : BoneEnd::kTail;
        const double gap =
            separation.half_line_distance(bone, end, row[x]) - separation.half_line_distance(other, other_end, row[x]);
        RC_ASSERT(std::abs(gap) < 1e-6 * model.diagonal);
      }
      for (const float distance : closest_distances(device(), body.shape.mesh, row))
        RC_ASSERT(static_cast<double>(distance) < 1e-6 * model.diagonal);
    }
}

RC_GTEST_PROP(AnyBody, HasTheSameTexelsWhereverItStandsAndHoweverLarge, ()) {
  const Body body = any_body();
  const Similarity map = random_similarity(body.seed);
  RC_ASSERT(texel_difference(encoded(body, body.shape).model, encoded(body, transformed(body.shape, map)).model,
                             map.scale) < kRounding);
}

RC_GTEST_PROP(AnyBody, HasTheSameTexelsInWhateverOrderItsTrianglesCome, ()) {
  const Body body = any_body();
  Shape other = body.shape;
  other.mesh = with_triangles_renumbered(
      with_vertices_renumbered(other.mesh,
                               random_permutation(static_cast<int>(other.mesh.positions.size()), body.seed)),
      random_permutation(static_cast<int>(other.mesh.triangles.size()), body.seed + 1));
  RC_ASSERT(texel_difference(encoded(body, body.shape).model, encoded(body, other).model, 1) < kRounding);
}

}  // namespace skeletex
