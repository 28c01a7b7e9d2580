// SPDX-License-Identifier: MIT
#include "skeletex/skeletonize/accept.h"

#include <fmt/format.h>

#include <algorithm>

#include "skeletex/analysis/metro.h"
#include "skeletex/convert/segment/segment_mesh.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/skeletonize/coarse_mesh.h"

namespace skeletex {
namespace {

constexpr int kTrialSize = 128;
constexpr long kTrialSamples = 40'000;
/// Above so many triangles, maps take most of the time; trials use so many vertices instead.
constexpr std::size_t kMostTriangles = 350'000;
constexpr int kTrialVertices = 75'000;
constexpr int kMovesPerBone = 8;  // before a bone is contracted
constexpr int kMoves = 30;        // in all, of meshes up to 30 000 triangles

}  // namespace

void give_numbers(Skeleton& skeleton) {
  for (std::size_t n = 0; n < skeleton.nodes.size(); ++n) skeleton.nodes[n].name = fmt::format("node_{}", n);
  for (std::size_t b = 0; b < skeleton.bones.size(); ++b) skeleton.bones[b].name = fmt::format("bone_{}", b);
}

Acceptance::Acceptance(ClContext& context, const Surface& surface)
    : context_(context), surface_(surface), cut_(cut_mesh_of(surface.mesh)) {
  if (surface.mesh.triangles.size() <= kMostTriangles) return;
  coarse_.emplace().mesh = make_coarse_mesh(surface.mesh, kTrialVertices);
  coarse_->tree = build_triangle_tree(coarse_->mesh);
}

std::string Acceptance::segment(Repair& repair, const std::function<std::string(const Repair&)>& stop) const {
  // Large meshes take long to cut: fewer moves there, and contraction sooner.
  const int moves = std::clamp(
      static_cast<int>(kMoves * 30'000 / std::max<std::size_t>(surface_.mesh.triangles.size(), 1)), 6, kMoves);
  std::string refusal = "its separation planes cross inside the body, wherever its nodes go";
  int moved = 0, moved_for_this = 0;
  for (;;) {
    if (!repair.run()) return refusal;
    Skeleton skeleton = repair.skeleton();
    give_numbers(skeleton);
    NodeIndex node;
    BoneIndex bone;
    try {
      segment_mesh(context_, cut_, skeleton);
      return {};
    } catch (const TopologyError& error) {
      refusal = error.what();
      node = error.node();
      bone = error.bone();
    }
    if (node >= 0 && moved < moves && moved_for_this < kMovesPerBone) {
      ++moved;
      ++moved_for_this;
      repair.shake(node);
      continue;
    }
    moved_for_this = 0;
    if (!repair.contract(std::max<int>(bone, 0))) return refusal;
    if (stop)
      if (std::string reason = stop(repair); !reason.empty()) return reason;
  }
}

bool Acceptance::is_accepted(const Skeleton& skeleton) const {
  Skeleton named = skeleton;
  give_numbers(named);
  try {
    segment_mesh(context_, cut_, named);
    return true;
  } catch (const TopologyError&) {
    return false;
  }
}

Acceptance::Trial Acceptance::encode(const Skeleton& skeleton) const {
  if (coarse_)
    if (Trial trial = encode_mesh(coarse_->mesh, coarse_->tree, skeleton); trial.refusal.empty()) return trial;
  return encode_mesh(surface_.mesh, surface_.tree, skeleton);
}

Acceptance::Trial Acceptance::encode_mesh(const TriangleMesh& mesh, const TriangleTree& tree,
                                          const Skeleton& skeleton) const {
  try {
    Skeleton named = skeleton;
    give_numbers(named);
    EncodeOptions options;
    options.width = options.height = kTrialSize;
    options.tree = &tree;
    options.layers.has_normals = false;
    EncodeResult result = encode_model(context_, mesh, named, options);
    result.model.skeleton.frame = {};  // that of surface_.mesh
    const TriangleMesh reconstruction = reconstruct_mesh(context_, result.model);
    return {SymmetricMetro(context_, mesh, kTrialSamples).measure(reconstruction).mean, {}};
  } catch (const DeviceError&) {
    throw;
  } catch (const Error& error) {
    return {0, error.what()};
  }
}

}  // namespace skeletex
