// SPDX-License-Identifier: MIT
#include "skeletex/edit/regular_grid.h"

#include <utility>

#include "skeletex/reconstruct/displace.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/skeleton/separation_planes.h"

namespace skeletex {
namespace {

constexpr int kSteps = 6;

/// Points of all rows, and where they are in the lattice: cells from each texel's own place.
struct SlidingPoints {
  ClBuffer<float> offset_x, offset_y;
  DevicePlanes points;
};

}  // namespace

SkeletexModel regular_grid(ClContext& context, const SkeletexModel& model) {
  if (!model.sampling.is_snapped) return model;
  SkeletexModel result = model;
  result.diagonals = DiagonalRule::kNearest;
  result.sampling.is_snapped = result.sampling.is_fitted = false;
  const SeparationPlanes separation(model.skeleton);
  const FrameTables tables = in_bone_axes(frame_tables(model.skeleton, separation, model.patches, model.origin));
  DeviceLattice lattice = upload_lattice(context, tables, model.patches, model.texture, RowChoice::kAll);
  const std::size_t count = lattice.vertex_count;
  DevicePlanes own = allocate_planes(context, count);
  displace(context, lattice, own);

  std::vector<int> is_kept;
  for (const Patch& patch : model.patches) is_kept.push_back(is_height_field(patch.method));
  const auto kept = context.upload(is_kept);
  SlidingPoints now{context.allocate<float>(count), context.allocate<float>(count), own};
  context.fill(now.offset_x, 0.0f), context.fill(now.offset_y, 0.0f);
  SlidingPoints next{context.allocate<float>(count), context.allocate<float>(count), allocate_planes(context, count)};
  SlidingPoints spare{context.allocate<float>(count), context.allocate<float>(count), allocate_planes(context, count)};
  const ClRange range = row_range(context, lattice.rows.size);
  const int rows = static_cast<int>(lattice.rows.size);
  for (int step = 0; step < kSteps; ++step) {
    context.launch({"regular_grid.cl", "slide_evenly"}, range, rows, lattice.rows, lattice.tables.patches, kept,
                   static_cast<int>(count), own.values, now.offset_x, now.offset_y, now.points.values, next.offset_x,
                   next.offset_y, next.points.values);
    now = next;
    std::swap(next, spare);
  }
  // Texels that stay are not stored anew: they keep their bits.
  std::vector<LatticeRow> slid = lattice_rows(model.patches, RowChoice::kAll);
  std::erase_if(slid, [&](const LatticeRow& row) {
    return is_kept[row[0]] || row[1] == 0 || row[1] == model.patches[row[0]].rectangle.height - 1;
  });
  if (slid.empty()) return result;
  const auto slid_rows = context.upload(slid);
  const int slid_count = static_cast<int>(slid.size());
  if (model.sampling.is_prefiltered) {
    context.launch({"regular_grid.cl", "prefilter_rows"}, row_range(context, slid.size()), slid_count, slid_rows,
                   lattice.tables.patches, static_cast<int>(count), now.points.values, next.points.values);
    now = next;
  }
  enter_tangent_space(context, lattice.tables, slid_rows, model.texture.width, now.points, lattice.texels);
  download_texels(context, lattice.texels, result.texture);
  return result;
}

}  // namespace skeletex
