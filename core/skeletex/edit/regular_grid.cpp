// SPDX-License-Identifier: MIT
#include "skeletex/edit/regular_grid.h"

#include <utility>

#include "regular_grid_structs.h"
#include "skeletex/convert/layers/read_layers.h"
#include "skeletex/reconstruct/displace.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/skeleton/separation_planes.h"

namespace skeletex {
namespace {

constexpr int kSteps = 6;

/// Points of all rows, and their places in the lattice: offsets from each texel's own place, in cells.
struct SlidingPoints {
  ClBuffer<float> offsets;  ///< along the columns of all points, then along the rows
  DevicePlanes points;
};

/// Points after some steps towards the means of their neighbours.
SlidingPoints slide(ClContext& context, const DeviceLattice& lattice, const std::vector<int>& is_kept) {
  const std::size_t count = lattice.vertex_count;
  DevicePlanes own = allocate_planes(context, count);
  displace(context, lattice, own);
  const auto kept = context.upload(is_kept);
  SlidingPoints now{context.allocate<float>(2 * count), own};
  context.fill(now.offsets, 0.0f);
  SlidingPoints next{context.allocate<float>(2 * count), allocate_planes(context, count)};
  SlidingPoints spare{context.allocate<float>(2 * count), allocate_planes(context, count)};
  const SlideParameters parameters{static_cast<int>(lattice.rows.size), static_cast<int>(count)};
  for (int step = 0; step < kSteps; ++step) {
    context.launch({"regular_grid.cl", "slide_points"}, row_range(context, lattice.rows.size), parameters, lattice.rows,
                   lattice.tables.patches, kept, own.values, now.offsets, now.points.values, next.offsets,
                   next.points.values);
    now = next;
    std::swap(next, spare);
  }
  return now;
}

}  // namespace

SkeletexModel regular_grid(ClContext& context, const SkeletexModel& model) {
  if (!model.sampling.is_snapped) return model;
  SkeletexModel result = model;
  result.diagonals = DiagonalRule::kNearest;
  result.sampling.is_snapped = result.sampling.is_fitted = false;
  const SeparationPlanes separation(model.skeleton);
  const FrameTables tables = in_bone_axes(frame_tables(model.skeleton, separation, model.patches, model.origin));
  DeviceLattice lattice = upload_lattice(context, tables, model.patches, model.texture, RowChoice::kAll);
  std::vector<int> is_kept;
  for (const Patch& patch : model.patches) is_kept.push_back(is_height_field(patch.method));
  DevicePlanes points = slide(context, lattice, is_kept).points;
  // Only texels that move are stored, so that the others keep their bits.
  std::vector<LatticeRow> slid = lattice_rows(model.patches, RowChoice::kAll);
  std::erase_if(slid, [&](const LatticeRow& row) {
    return is_kept[row[0]] || row[1] == 0 || row[1] == model.patches[row[0]].rectangle.height - 1;
  });
  if (slid.empty()) return result;
  const auto slid_rows = context.upload(slid);
  if (model.sampling.is_prefiltered) {
    DevicePlanes filtered = allocate_planes(context, lattice.vertex_count);
    context.launch({"regular_grid.cl", "prefilter_rows"}, row_range(context, slid.size()),
                   SlideParameters{static_cast<int>(slid.size()), static_cast<int>(lattice.vertex_count)}, slid_rows,
                   lattice.tables.patches, points.values, filtered.values);
    points = filtered;
  }
  enter_tangent_space(context, lattice.tables, slid_rows, model.texture.width, points, lattice.texels);
  download_texels(context, lattice.texels, result.texture);
  result.layers = read_layers_of(context, model, result);
  return result;
}

}  // namespace skeletex
