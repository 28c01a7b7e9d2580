// SPDX-License-Identifier: MIT
#include "skeletex/edit/transfer/placement.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "skeletex/edit/morph/blend.h"
#include "skeletex/edit/regular_grid.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

constexpr std::array<BoneEnd, 2> kEnds{BoneEnd::kHead, BoneEnd::kTail};
constexpr double kMostLean = 0.5;     // a part leans by at most half of its length
constexpr double kMostRunBack = 0.5;  // share of the rows behind its cut that a column may leave out, too

std::vector<PatchPoints> patch_points(const std::vector<Patch>& patches, const BonePoints& points) {
  std::vector<PatchPoints> result;
  std::size_t count = 0;
  for (const Patch& patch : patches) {
    result.push_back({&points, count, patch.rectangle.width, patch.rectangle.height});
    count += static_cast<std::size_t>(patch.rectangle.width) * patch.rectangle.height;
  }
  return result;
}

/// Makes a placement, step by step.
class Placing {
 public:
  Placing(ClContext& context, const TransferInput& input, const SkeletexModel& result)
      : context_(context), input_(input), options_(input.options) {
    place_.frames = frame_tables(result.skeleton, input.separation, result.patches, result.origin);
    place_.owners.resize(result.patches.size());
    place_.first.resize(result.patches.size());
    place_.gaps.resize(result.patches.size());
    tables_.patches.resize(result.patches.size());
  }

  Placement run(std::span<const std::unique_ptr<PartPair>> pairs) {
    set_owners(pairs);
    for_each_bone([&](BoneIndex bone, const PartPair& pair, int i) { append_bone(bone, pair, i); });
    tables_.corrections.assign(tables_.correction_size(), 0);
    if (options_.blend != TransferBlend::kNone && options_.skip < 0) {
      place();
      for_each_bone([&](BoneIndex bone, PartPair& pair, int i) { skip_reversed_rows(bone, pair, i); });
    }
    if (options_.blend != TransferBlend::kNone) {
      place();
      for_each_bone([&](BoneIndex bone, const PartPair& pair, int i) { find_lean(bone, pair, i); });
    }
    place();
    for_each_bone([&](BoneIndex bone, const PartPair& pair, int i) {
      for (const BoneEnd end : kEnds) find_correction(bone, pair, i, end);
    });
    return std::move(place_);
  }

 private:
  template <class Visit>
  void for_each_bone(const Visit& visit) {
    for (BoneIndex bone = 0; bone < static_cast<int>(place_.owners.size()); ++bone)
      if (place_.owners[bone].pair) visit(bone, *place_.owners[bone].pair, place_.owners[bone].index);
  }

  void set_owners(std::span<const std::unique_ptr<PartPair>> pairs) {
    for (const auto& pair : pairs)
      for (int i = 0; i < pair->count(); ++i) {
        Placement::Owner& owner = place_.owners[pair->target_bone(i)];
        if (owner.pair)
          throw InputError(fmt::format("bone \"{}\" of the target is replaced twice",
                                       input_.target.skeleton.bones[pair->target_bone(i)].name));
        owner = {pair.get(), i};
      }
  }

  /// The points as the tables place them.
  void place() {
    place_.points =
        download_points(context_, place_part(context_, tables_, input_.source_points, input_.target_points));
  }
  PatchPoints placed_points_of(BoneIndex bone) const {
    const Rectangle& rectangle = input_.target.patches[bone].rectangle;
    return {&place_.points, place_.first[bone], rectangle.width, rectangle.height};
  }
  TransferColumn& column(BoneIndex bone, int j) { return tables_.columns[tables_.patches[bone].column_begin + j]; }

  /// Rows over which the correction at an end fades; 0: there is none.
  double fade_width(const PartPair& pair, int i, BoneEnd end) const {
    if (pair.is_inner_seam(i, end)) return 0.5 * (pair.target_patch(i).rectangle.height - 1);
    return options_.blend == TransferBlend::kNone || !pair.is_boundary(i, end) ? 0.0 : pair.width_in_rows(i);
  }

  /// Appends the tables of a bone.
  void append_bone(BoneIndex bone, const PartPair& pair, int i) {
    const Rectangle& source = pair.source_patch(i).rectangle;
    const auto [x, y, width, height] = input_.target.patches[bone].rectangle;
    TransferPatch& patch = tables_.patches[bone];
    patch = {};
    patch.begin = static_cast<int>(input_.source_patches[pair.source_bone(i)].first);
    patch.width = source.width;
    patch.height = source.height;
    patch.column_begin = static_cast<int>(tables_.columns.size());
    patch.sign = static_cast<float>(pair.map().sign(i));
    patch.source_length = static_cast<float>(pair.source_length(i));
    patch.length_scale = static_cast<float>(pair.length_scale(i));
    patch.length_offset = static_cast<float>(pair.length_offset(i));
    patch.head_width = static_cast<float>(fade_width(pair, i, BoneEnd::kHead));
    patch.tail_width = static_cast<float>(fade_width(pair, i, BoneEnd::kTail));
    patch.is_linear = options_.blend == TransferBlend::kLinear;
    const bool is_mixed = pair.is_between() && options_.blend != TransferBlend::kNone;
    patch.target_begin = is_mixed ? static_cast<int>(input_.target_patches[bone].first) : -1;

    const auto columns = model_columns(pair.map(), i, width);
    const auto shear = [&, width = width](BoneEnd end, int j) {
      // A part between two seams that are kept follows their separation planes, too.
      if (!pair.is_inner_seam(i, end) && !pair.is_between()) return 0.0f;
      return static_cast<float>(
          pair.shear(input_.source_separation, input_.separation, i, end, static_cast<double>(j) / width));
    };
    for (int j = 0; j < width; ++j) {
      tables_.columns.push_back(
          {columns[0][j], columns[1][j], shear(BoneEnd::kHead, j), shear(BoneEnd::kTail, j), 0, 0, 0, 0});
      set_column_rows(bone, pair, i, j);
    }
    place_.first[bone] = tables_.point_count;
    for (int row = 0; row < height; ++row) {
      const double share = static_cast<double>(row) / (height - 1);
      const double scale = (1 - share) * pair.cut(BoneEnd::kHead).scale + share * pair.cut(BoneEnd::kTail).scale;
      tables_.rows.push_back(
          {bone, row, width, static_cast<int>(tables_.point_count), (y + row) * input_.target.texture.width + x,
           place_.frames.rows[place_.frames.patches[bone].row_begin + row].axial, static_cast<float>(scale)});
      tables_.point_count += width;
    }
  }

  /// Sets the rows that one column reads: the source's from cut to cut.
  void set_column_rows(BoneIndex bone, const PartPair& pair, int i, int j) {
    double first = 0, last = pair.target_patch(i).rectangle.height - 1, source_first = 0,
           source_last = pair.source_patch(i).rectangle.height - 1;
    const bool has_head = pair.is_boundary(i, BoneEnd::kHead), has_tail = pair.is_boundary(i, BoneEnd::kTail);
    if (has_head)
      first += pair.cut(BoneEnd::kHead).kept_rows[j], source_first += pair.cut(BoneEnd::kHead).skipped_rows[j];
    if (has_tail)
      last -= pair.cut(BoneEnd::kTail).kept_rows[j], source_last -= pair.cut(BoneEnd::kTail).skipped_rows[j];
    const double step = (source_last - source_first) / (last - first);
    TransferColumn& table = column(bone, j);
    table.row_begin = static_cast<float>(source_first - step * first);
    table.row_step = static_cast<float>(step);
    table.first_row = static_cast<float>(has_head ? first : -1);
    table.last_row = static_cast<float>(has_tail ? last : last + 1);
  }

  /// Where the target's edge lies further along the bone than the part's, the surface behind the edge would run back
  /// along the bone. There the part begins later.
  void skip_reversed_rows(BoneIndex bone, PartPair& pair, int i) {
    const double length = pair.target_length(i);
    const PatchPoints placed = placed_points_of(bone), target = input_.target_patches[bone];
    for (const BoneEnd end : kEnds) {
      if (!pair.is_boundary(i, end) || pair.is_between()) continue;
      PartCut& cut = pair.cut(end);
      std::vector<double> more(placed.width);
      for (int j = 0; j < placed.width; ++j) {
        const BoneProfile profile = bone_profile(placed, j, end, length);
        const double kept = cut.kept_rows[j];
        const double limit = at_row(bone_profile(target, j, end, length), kept).z() - 1e-5 * input_.target.diagonal;
        const double most = kept + kMostRunBack * (placed.height - 1 - kept);
        double row = kept;
        while (row < most && at_row(profile, row).z() < limit) row += 0.5;
        more[j] = std::abs(column(bone, j).row_step) * (row - kept);
      }
      smooth_around(more);
      for (int j = 0; j < placed.width; ++j) cut.skipped_rows[j] += more[j];
    }
    for (int j = 0; j < placed.width; ++j) set_column_rows(bone, pair, i, j);
  }

  /// Where the centre of a part's edge lies away from the target's, the part leans towards it; its far end stays.
  void find_lean(BoneIndex bone, const PartPair& pair, int i) {
    if (pair.is_boundary(i, BoneEnd::kHead) == pair.is_boundary(i, BoneEnd::kTail)) return;
    const BoneEnd end = pair.is_boundary(i, BoneEnd::kHead) ? BoneEnd::kHead : BoneEnd::kTail;
    const PatchPoints placed = placed_points_of(bone), target = input_.target_patches[bone];
    Vec3 edge = Vec3::Zero(), target_edge = Vec3::Zero(), far = Vec3::Zero();
    for (int j = 0; j < placed.width; ++j) {
      const double row = pair.cut(end).kept_rows[j];
      const auto add = [&](Vec3& sum, const PatchPoints& points, double at) {
        sum += about_bone(at_row(bone_profile(points, j, end, 0), at), -j, placed.width) / placed.width;
      };
      add(edge, placed, row);
      add(target_edge, target, row);
      add(far, placed, placed.height - 1);
    }
    const double sign = end == BoneEnd::kHead ? 1 : -1;
    TransferPatch& patch = tables_.patches[bone];
    patch.lean_end = static_cast<float>(sign * far.z());
    const Vec3 lean =
        (target_edge - edge) / (sign * std::max(std::abs(far.z() - edge.z()), 1e-3 * input_.target.diagonal));
    const double share = std::min(1.0, kMostLean / std::max(lean.head<2>().norm(), 1e-30));
    patch.lean_s = static_cast<float>(share * lean.x());
    patch.lean_b = static_cast<float>(share * lean.y());
  }

  /// An offset along s', o x s' and o, and its change per row.
  struct Correction {
    Vec3 offset = Vec3::Zero(), slope = Vec3::Zero();
  };
  /// From the placed part to the target, where the part begins.
  Correction boundary_correction(BoneIndex bone, const PartPair& pair, int i, BoneEnd end, int j) const {
    const BoneProfile to = bone_profile(input_.target_patches[bone], j, end, 0),
                      from = bone_profile(placed_points_of(bone), j, end, 0);
    const double kept = pair.cut(end).kept_rows[j], range = std::max(1.0, pair.width_in_rows(i) / 6),
                 back = std::min(kept, range / 2);
    const auto change = [&](double row) {
      Vec3 d = at_row(to, row) - at_row(from, row);
      if (end == BoneEnd::kTail) d.z() = -d.z();
      return d;
    };
    return {change(kept), (change(kept + range - back) - change(kept - back)) / range};
  }

  void find_correction(BoneIndex bone, const PartPair& pair, int i, BoneEnd end) {
    const bool is_boundary = pair.is_boundary(i, end);
    if (!is_boundary && !pair.is_inner_seam(i, end)) return;
    const int width = pair.target_patch(i).rectangle.width;
    std::array<std::vector<double>, 3> offsets, slopes;
    for (int j = 0; j < width; ++j) {
      Correction correction;
      if (is_boundary)
        correction = boundary_correction(bone, pair, i, end, j);
      else
        correction.offset =
            pair.seam_offset(input_.source_separation, input_.separation, i, end, static_cast<double>(j) / width);
      for (int axis = 0; axis < 3; ++axis) {
        offsets[axis].push_back(correction.offset[axis]);
        slopes[axis].push_back(correction.slope[axis]);
      }
      if (is_boundary) place_.gaps[bone][static_cast<int>(end)].push_back(about_bone(correction.offset, -j, width));
    }
    store_correction(bone, end, offsets, false);
    store_correction(bone, end, slopes, true);
  }

  void store_correction(BoneIndex bone, BoneEnd end, const std::array<std::vector<double>, 3>& values, bool is_slope) {
    const int width = static_cast<int>(values[0].size());
    const std::array bands{wave_bands(values[0]), wave_bands(values[1]), wave_bands(values[2])};
    for (int band = 0; band < SKELETEX_TRANSFER_BANDS; ++band)
      for (int j = 0; j < width; ++j) {
        const Vec3 in_bone_axes = about_bone({bands[0][band][j], bands[1][band][j], bands[2][band][j]}, -j, width);
        for (int axis = 0; axis < 3; ++axis)
          tables_.correction(end, band, is_slope, axis, tables_.patches[bone].column_begin + j) =
              static_cast<float>(in_bone_axes[axis]);
      }
  }

  ClContext& context_;
  const TransferInput& input_;
  const TransferOptions& options_;
  Placement place_;
  TransferTables& tables_ = place_.tables;
};

}  // namespace

TransferInput::TransferInput(ClContext& context, const SkeletexModel& source_model, const SkeletexModel& target_model,
                             const TransferOptions& transfer_options)
    : source(source_model),
      target(target_model),
      options(transfer_options),
      source_separation(source.skeleton),
      separation(target.skeleton),
      regular_source(regular_grid(context, source)),
      regular_target(regular_grid(context, target)),
      source_points(points_in_bone_axes(context, regular_source)),
      target_points(points_in_bone_axes(context, regular_target)),
      source_host(download_points(context, source_points)),
      target_host(download_points(context, target_points)),
      source_patches(patch_points(source.patches, source_host)),
      target_patches(patch_points(target.patches, target_host)) {}

Placement place_parts(ClContext& context, const TransferInput& input, const SkeletexModel& result,
                      std::span<const std::unique_ptr<PartPair>> pairs) {
  return Placing(context, input, result).run(pairs);
}

}  // namespace skeletex
