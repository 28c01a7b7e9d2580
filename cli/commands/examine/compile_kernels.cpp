// SPDX-License-Identifier: MIT
#include "compile_kernels.h"

#include <cmath>
#include <numbers>

#include "skeletex/analysis/metro.h"
#include "skeletex/convert/encode_model.h"
#include "skeletex/convert/resample/resample.h"
#include "skeletex/edit/filter/filter.h"
#include "skeletex/edit/live.h"
#include "skeletex/edit/morph/morph.h"
#include "skeletex/edit/transfer/transfer.h"
#include "skeletex/reconstruct/pose/pose_mesh.h"
#include "skeletex/reconstruct/pose/skin.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/skeleton/correspondence.h"

namespace skeletex::cli {
namespace {

/// A column with waves about and along it, and three bones in its axis.
struct Column {
  TriangleMesh mesh;
  Skeleton skeleton;
};

Column make_column(int waves) {
  constexpr int kSides = 12, kRings = 31;
  Column column;
  for (int ring = 0; ring < kRings; ++ring)
    for (int side = 0; side < kSides; ++side) {
      const double angle = 2 * std::numbers::pi * side / kSides,
                   radius = 0.4 + 0.1 * std::sin(1.3 * ring + waves * angle);
      column.mesh.positions.push_back({radius * std::cos(angle), radius * std::sin(angle), 0.1 * ring});
    }
  const int bottom = kRings * kSides, top = bottom + 1;
  column.mesh.positions.push_back({0, 0, -0.1});
  column.mesh.positions.push_back({0, 0, 0.1 * kRings});
  for (int side = 0; side < kSides; ++side) {
    const int next = (side + 1) % kSides, last = (kRings - 1) * kSides;
    column.mesh.triangles.push_back({bottom, next, side});
    column.mesh.triangles.push_back({top, last + side, last + next});
    for (int ring = 0; ring + 1 < kRings; ++ring) {
      const int a = ring * kSides + side, b = ring * kSides + next;
      column.mesh.triangles.push_back({a, b, b + kSides});
      column.mesh.triangles.push_back({a, b + kSides, a + kSides});
    }
  }
  for (int node = 0; node < 4; ++node) column.skeleton.nodes.push_back({"", Vec3(0, 0, 0.2 + 0.9 * node)});
  for (int bone = 0; bone < 3; ++bone)
    column.skeleton.bones.push_back({std::string(1, static_cast<char>('a' + bone)), bone, bone + 1, std::nullopt});
  return column;
}

/// The kernels of `encode`. PoCL compiles a kernel for few work-items and again for many; what it has for many it takes
/// for few as well, within a process.
SkeletexModel encode_all_ways(ClContext& context, const Column& column) {
  constexpr int kSmall = 64, kLarge = 512;
  EncodeOptions options;
  SkeletexModel model;
  for (const int size : {kSmall, kLarge})
    for (const Method method : {Method::kSpd, Method::kVsm}) {
      options.width = options.height = size;
      options.method = method;
      options.has_half_texels = false;
      SkeletexModel made = encode_model(context, column.mesh, column.skeleton, options).model;
      if (size == kSmall) model = std::move(made);
      options.has_half_texels = true;
      encode_model(context, column.mesh, column.skeleton, options);
    }
  return model;
}

/// The column bent at its second node.
Skeleton bent(Skeleton skeleton) {
  skeleton.nodes[2].position += Vec3(0.3, 0, 0);
  skeleton.nodes[3].position += Vec3(0.9, 0, -0.2);
  return skeleton;
}

}  // namespace

void compile_kernels(ClContext& context, ClContext& metro_context, ProgressBar& bar) {
  const Column column = make_column(1);
  bar.show("encode", 0);
  const SkeletexModel model = encode_all_ways(context, column);
  bar.show("reconstruct", 0.5);
  reconstruct_mesh(context, resample_model(context, model, 48));
  for (const Deformation deformation : {Deformation::kSmooth, Deformation::kCoordinates, Deformation::kPaper})
    for (const DistanceRule distance : {DistanceRule::kFromBone, DistanceRule::kFromFoot})
      reconstruct_mesh(context, model, bent(model.skeleton), {deformation, distance});
  weight_planes(context, model);
  bar.show("metro", 0.6);
  measure_metro(metro_context, column.mesh, column.mesh);
  bar.show("morph", 0.7);
  const Column other = make_column(2);
  EncodeOptions options;
  options.width = options.height = model.texture.width;
  const SkeletexModel other_model = encode_model(context, other.mesh, other.skeleton, options).model;
  const Correspondence same = find_correspondence(model.skeleton, model.skeleton);
  Morph(context, {model, other_model}, std::vector{same}).at(std::vector{0.5, 0.5});
  bar.show("transfer", 0.8);
  const SkeletexModel changed = transfer(context, other_model, model, {{"c", "c"}}, {.keep = 0});
  LiveBlend(context, model, changed).at(0.5);
  bar.show("filter", 0.9);
  smooth_model(context, model, {.keeps_volume = true}, {.bones = {"b"}});
  add_noise(context, model);
}

}  // namespace skeletex::cli
