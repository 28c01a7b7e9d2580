// SPDX-License-Identifier: MIT
#include "skeletex/edit/transfer/transfer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "skeletex/analysis/folds.h"
#include "skeletex/edit/transfer/join_surface.h"
#include "skeletex/edit/transfer/placement.h"
#include "skeletex/edit/transfer/transfer_layers.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/skeleton/find_bone.h"

namespace skeletex {
namespace {

constexpr double kRootShare = 0.05;  // of a patch's rows that the target keeps where its limb has a root there
constexpr double kMostFolds = 2, kMoreFolds = 2e-3;  // times those without the join, and share of the part's points

using Pairs = std::vector<std::unique_ptr<PartPair>>;

void check_options(const TransferOptions& options) {
  if (!std::isfinite(options.width) || !(options.width_in_texels >= 0))
    throw InputError("the width of a blend is 0 or more");
  if (options.scale == TransferScale::kFactor && !(options.factor > 0)) throw InputError("a scale is above 0");
  if (options.keep > 0.9 || options.skip > 0.9)
    throw InputError("the shares of rows that are kept and skipped are 0.9 at most");
}

int bone_by_name(const Skeleton& skeleton, const std::string& name, const char* which) {
  if (const std::optional<int> bone = find_bone(skeleton, name)) return *bone;
  throw InputError(fmt::format("the {} has no bone \"{}\"", which, name));
}

Pairs pair_parts(const TransferInput& input, const std::vector<std::pair<std::string, std::string>>& bones) {
  const auto part_of = [&](const SkeletexModel& model, BoneIndex bone) {
    return extract_part(model, input.options.has_limbs ? limb_of(model, bone) : std::vector<BoneIndex>{bone});
  };
  Pairs pairs;
  for (const auto& [from, to] : bones) {
    const BoneIndex source_bone = bone_by_name(input.source.skeleton, from, "source"),
                    target_bone = bone_by_name(input.target.skeleton, to, "target");
    pairs.push_back(std::make_unique<PartPair>(input.source, input.target, part_of(input.source, source_bone),
                                               part_of(input.target, target_bone), input.options));
    find_cuts(input, *pairs.back());
  }
  return pairs;
}

TransferredPart report_of(const PartPair& pair) {
  const PartCut& cut = pair.cut(pair.near());
  const auto share = [](const std::vector<double>& rows, const Patch& patch) {
    double sum = 0;
    for (const double r : rows) sum += r / static_cast<double>(rows.size()) / (patch.rectangle.height - 1);
    return sum;
  };
  return {cut.scale, pair.length_scale(0), share(cut.skipped_rows, pair.source_patch(0)),
          share(cut.kept_rows, pair.target_patch(0))};
}

/// Sets the texels of the placed parts; where the target keeps its surface they stay bit by bit.
void store_placement(ClContext& context, const TransferInput& input, const Placement& placement,
                     SkeletexModel& result) {
  const DevicePlanes points = place_part(context, placement.tables, input.source_points, input.target_points);
  const DevicePlanes target = upload_texels(context, input.target.texture);
  DevicePlanes texels = upload_texels(context, input.target.texture);
  std::vector<LatticeRow> rows;
  for (const TransferRow& row : placement.tables.rows) rows.push_back({row.patch, row.row, row.vertex, 0});
  enter_tangent_space(context, upload_tables(context, placement.frames), context.upload(rows), result.texture.width,
                      points, texels);
  keep_target(context, placement.tables, target, texels);
  download_texels(context, texels, result.texture);
}

/// A part's patches as they are placed in the world.
/// \param source  the same points of the source's surface
std::vector<PlacedPatch> placed_patches(const TransferInput& input, const PartPair& pair, const Placement& placement,
                                        const BonePoints& source) {
  std::vector<PlacedPatch> patches(pair.count());
  for (int i = 0; i < pair.count(); ++i) {
    PlacedPatch& patch = patches[i];
    patch.bone = pair.target_bone(i);
    const auto [x, y, width, height] = input.target.patches[patch.bone].rectangle;
    const BoneBasis& basis = input.separation.bases()[patch.bone];
    const auto in_world = [&](const Vec3& p) { return Vec3(p.x() * basis.s + p.y() * basis.b + p.z() * basis.o); };
    const Vec3 head = end_position(input.target.skeleton, patch.bone, BoneEnd::kHead);
    const std::size_t first = placement.first[patch.bone];
    for (std::size_t k = 0; k < static_cast<std::size_t>(width) * height; ++k) {
      patch.placed.push_back(head + in_world(placement.points.at(first + k)));
      patch.source.push_back(source.at(first + k));
    }
    for (int j = 0; j < width; ++j) {
      const TransferColumn& column = placement.tables.columns[placement.tables.patches[patch.bone].column_begin + j];
      patch.rows.push_back({std::max(1, static_cast<int>(std::floor(column.first_row)) + 1),
                            std::min(height - 2, static_cast<int>(std::ceil(column.last_row)) - 1)});
    }
    for (const int end : {0, 1})
      for (const Vec3& gap : placement.gaps[patch.bone][end]) patch.gaps[end].push_back(in_world(gap));
  }
  return patches;
}

/// Joins parts to the target over the surface.
void join_parts(ClContext& context, const TransferInput& input, const Pairs& pairs, const Placement& placement,
                SkeletexModel& result) {
  // Where a root lies in the first patch, the rows behind it are enough for the correction.
  const auto needs_join = [](const auto& pair) { return !pair->is_between() && report_of(*pair).kept <= kRootShare; };
  if (std::none_of(pairs.begin(), pairs.end(), needs_join)) return;
  const auto folded_edges = [&](const SkeletexModel& model) {
    return static_cast<double>(measure_folds(reconstruct_mesh(context, model)).folded_edges);
  };
  const BonePoints source = download_points(
      context, read_source(context, placement.tables, row_points(context, input.regular_source, RowChoice::kAll)));
  for (const auto& pair : pairs) {
    if (!needs_join(pair)) continue;
    SkeletexModel joined =
        join_surface(context, input.regular_target, result, placed_patches(input, *pair, placement, source),
                     pair->join_distance() / input.target.diagonal);
    // A part that brings much of its body along may lie too far from its place to be bent there.
    if (folded_edges(joined) <=
        kMostFolds * folded_edges(result) + kMoreFolds * static_cast<double>(placement.tables.point_count))
      result = std::move(joined);
  }
}

}  // namespace

SkeletexModel transfer(ClContext& context, const SkeletexModel& source, const SkeletexModel& target,
                       const std::vector<std::pair<std::string, std::string>>& bones, const TransferOptions& options,
                       std::vector<TransferredPart>* report) {
  if (bones.empty()) throw InputError("there are no bones to transfer");
  check_options(options);
  const SkeletexModel from = in_frame(source, target.skeleton.frame);
  const TransferInput input(context, from, target, options);
  const Pairs pairs = pair_parts(input, bones);

  SkeletexModel result = target;
  result.bone_weights.clear();  // they belong to the surface that is replaced
  for (const auto& pair : pairs) {
    pair->set_seams(result, input.separation);
    for (int i = 0; i < pair->count(); ++i) pair->set_rows(i, result.patches[pair->target_bone(i)]);
  }
  const Placement placement = place_parts(context, input, result, pairs);
  store_placement(context, input, placement, result);
  if (options.blend == TransferBlend::kCosine && options.is_smooth)
    join_parts(context, input, pairs, placement, result);

  result.layers = transfer_layers(context, input, placement, result);

  if (report) {
    report->clear();
    for (const auto& pair : pairs) report->push_back(report_of(*pair));
  }
  return result;
}

}  // namespace skeletex
