// SPDX-License-Identifier: MIT
#include "skeletex/encode/unfold.h"

namespace skeletex {
namespace {

constexpr int kRelaxingPasses = 8;

}  // namespace

UnfoldReport unfold_lattice(ClContext& context, const DeviceLayout& layout, const DeviceMaps& maps, const ClBuffer<int>& triangles,
                            const std::function<void(ClBuffer<int>& walkers)>& read, ReadingPositions& positions, TexelPoints& points) {
  auto can_move = context.allocate<int>(layout.size()), is_marked = context.allocate<int>(layout.size()), walkers = context.allocate<int>(layout.size());
  auto count = context.allocate<int>(1);
  const auto find = [&] {
    context.fill(count, 0);
    context.launch({"unfold.cl", "find_folds"}, layout.range(), layout.width, layout.height, maps.triangle_count, layout.texel_patches, layout.patches, triangles,
                   maps.corners, maps.x, maps.y, maps.z, points.x, points.y, points.z, can_move, is_marked, count);
    return context.download(count)[0];
  };
  const auto relax = [&](bool is_back) {
    context.fill(count, 0);
    context.launch({"unfold.cl", "relax_folds"}, layout.range(), layout.width, layout.height, static_cast<int>(is_back), layout.texel_patches, layout.patches,
                   triangles, points.x, points.y, points.z, is_marked, can_move, positions.x, positions.y, walkers, count);
    const int back = context.download(count)[0];
    read(walkers);
    return back;
  };

  context.fill(can_move, 1), context.fill(is_marked, 0);
  UnfoldReport report;
  report.folded_quads = report.left = find();
  for (int pass = 0; pass < kRelaxingPasses && report.left > 0; ++pass) {
    relax(false);
    report.left = find();
  }
  // A texel that goes back can fold a quad beside it. Texels only ever go back, so this ends.
  while (report.left > 0 && relax(true) > 0) report.left = find();
  return report;
}

}  // namespace skeletex
