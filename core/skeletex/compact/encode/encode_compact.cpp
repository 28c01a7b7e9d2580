// SPDX-License-Identifier: MIT
#include "skeletex/compact/encode/encode_compact.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "skeletex/compact/encode/encode_layers.h"
#include "skeletex/compact/encode/encode_seams.h"
#include "skeletex/compact/seam_curves.h"
#include "skeletex/compact/skeleton_code.h"
#include "skeletex/geometry/parallel.h"

namespace skeletex {
namespace {

/// A coarse count and doublings that come nearest to a wanted count.
struct Doublings {
  int coarse, steps;
};
Doublings doublings_of(double wanted, int least, int most) {
  Doublings best{least, 0};
  double nearest = 1e9;
  for (int coarse = least; coarse <= most; ++coarse) {
    const int steps = std::max(0, static_cast<int>(std::lround(std::log2(wanted / coarse))));
    const double off = std::abs(std::log2(wanted / std::ldexp(coarse, steps)));
    if (off < nearest - 1e-9) {
      nearest = off;
      best = {coarse, steps};
    }
  }
  return best;
}

/// Patches with more of all texels begin with more rows: they hold most of a body, whose rows are no simple tubes.
constexpr double kLargeShare = 0.15;

void set_sizes(CompactModel& compact, const SkeletexModel& model, int size) {
  double texels = 0;
  for (const Patch& patch : model.patches)
    texels += static_cast<double>(patch.rectangle.width) * patch.rectangle.height;
  const double scale = size / std::sqrt(texels);
  for (const Patch& patch : model.patches) {
    const bool is_large = patch.rectangle.width * patch.rectangle.height > kLargeShare * texels;
    const Doublings columns = doublings_of(scale * patch.rectangle.width, 4, 7),
                    rows = doublings_of(scale * (patch.rectangle.height - 1), is_large ? 3 : 2, is_large ? 5 : 3);
    CompactPatch& result = compact.patches.emplace_back();
    result.columns = columns.coarse;
    result.intervals = rows.coarse;
    result.step_count = columns.steps + rows.steps;
    result.row_steps = (1u << rows.steps) - 1;  // their number; the encoder chooses the order
  }
  for (const SeamArc& arc : model.arcs) {
    const double wanted = scale * static_cast<double>(arc.samples.size() + (arc.is_closed() ? 0 : 1));
    const double coarse = arc.is_closed() ? 4 : 1;
    compact.arcs.push_back(
        {arc.node,
         arc.bones,
         arc.corners,
         std::max(arc.is_closed() ? 0 : 1, static_cast<int>(std::lround(std::log2(wanted / coarse)))),
         {},
         {}});
  }
  for (const SeamCorner& corner : model.corners) compact.corners.push_back({corner.node, corner.bones, 0, 0});
}

/// Poles from the source's end rows.
void set_poles(CompactModel& compact, const SeparationPlanes& separation, const SourceSurface& source) {
  for (BoneIndex bone = 0; bone < static_cast<int>(compact.patches.size()); ++bone)
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) {
      if (!separation.is_free(bone, end)) continue;
      const SourcePatch& patch = source.patches[bone];
      const Vec3& pole = end == BoneEnd::kHead ? patch.points.front() : patch.points.back();
      const Vec3 offset = pole - end_position(compact.skeleton, bone, end);
      const BoneBasis& basis = separation.bases()[bone];
      const std::array<Vec3, 3> axes{basis.s, basis.b, basis.o};
      for (int k = 0; k < 3; ++k)
        compact.patches[bone].poles[static_cast<int>(end)][k] =
            static_cast<int>(std::lround(offset.dot(axes[k]) / compact.step));
    }
}

/// \param places  per patch, as encode_patch gives them; null: not wanted
void encode_patches(CompactModel& compact, const SeparationPlanes& separation, const SourceSurface& source,
                    const CompactOptions& options, std::vector<std::vector<Place>>* places) {
  const std::vector<Place> none;
  const std::vector<std::array<PatchEnd, 2>> ends = ends_of(compact);
  const SeamCurves seams = decode_seams(compact, separation, 0);
  for_each_index(compact.patches.size(), [&](std::size_t i) {
    const BoneIndex bone = static_cast<int>(i);
    const std::array<bool, 2> has_pole{ends[bone][0].arcs.empty(), ends[bone][1].arcs.empty()};
    const EndRow row = [&](BoneEnd end, int columns) {
      return end_row(compact, separation, ends, seams, bone, end, columns);
    };
    encode_patch(compact, separation, bone, has_pole, row, source.patches[bone], options.residuals,
                 options.fixed_places.empty() ? none : options.fixed_places[bone],
                 places == nullptr ? nullptr : &(*places)[bone]);
  });
}

/// Weights that foretell the offsets best in the least-squares sense, from residuals made with no weights.
void fit_weights(CompactModel& compact) {
  std::array<Eigen::Matrix4d, 2> products{Eigen::Matrix4d::Zero(), Eigen::Matrix4d::Zero()};
  std::array<Eigen::Vector4d, 2> targets{Eigen::Vector4d::Zero(), Eigen::Vector4d::Zero()};
  for (const CompactPatch& patch : compact.patches) {
    int columns = patch.columns;
    for (std::size_t step = 0; step < patch.steps.size(); ++step) {
      const int rows = static_cast<int>(patch.row_steps >> step & 1);
      const std::vector<int>& offsets = patch.steps[step].normal;
      for (int i = 0; i < static_cast<int>(offsets.size()) && !stays_home(static_cast<int>(step)); ++i) {
        const std::array<int, 4> neighbours = neighbours_of(i, columns);
        if (neighbours[1] < 0 || neighbours[0] < 0) continue;
        Eigen::Vector4d values;
        for (int k = 0; k < 4; ++k) values[k] = offsets[neighbours[k]];
        products[rows] += values * values.transpose();
        targets[rows] += offsets[i] * values;
      }
      if (rows == 0) columns *= 2;
    }
  }
  for (int rows = 0; rows < 2; ++rows) {
    const Eigen::Matrix4d damped = products[rows] + (1e-3 * products[rows].trace() + 1) * Eigen::Matrix4d::Identity();
    const Eigen::Vector4d weights = damped.ldlt().solve(targets[rows]);
    for (int k = 0; k < 4; ++k)
      compact.weights[rows][k] = std::clamp(static_cast<int>(std::lround(64 * weights[k])), -127, 127);
  }
}

}  // namespace

SkeletexModel in_unit_frame(SkeletexModel model) {
  if (std::abs(model.diagonal - 1) < 1e-6 && model.origin.norm() < 1e-6) return model;
  const UnitFrame& frame = model.skeleton.frame;
  const UnitFrame unit{frame.to_user(model.origin), frame.scale * model.diagonal};
  return in_frame(std::move(model), unit);
}

CompactModel encode_compact(const SkeletexModel& model, const SourceSurface& source, const CompactOptions& options) {
  CompactModel compact;
  compact.skeleton = rounded_skeleton(model.skeleton);
  compact.stance = model.stance;
  compact.step = options.step;
  compact.bare_levels = options.bare_levels;
  set_sizes(compact, model, options.size);
  const SeparationPlanes separation(compact.skeleton);
  set_poles(compact, separation, source);
  encode_seams(compact, separation, source, (options.bare_levels + 1) / 2, options.residuals.rounding);
  if (options.weights) {
    compact.weights = *options.weights;
  } else {
    encode_patches(compact, separation, source, options, nullptr);
    fit_weights(compact);
  }
  if (options.layer_steps == 0) {
    encode_patches(compact, separation, source, options, nullptr);
    return compact;
  }
  std::vector<std::vector<Place>> places(compact.patches.size());
  encode_patches(compact, separation, source, options, &places);
  encode_layers(compact, model, places, options.layer_steps, options.residuals.rounding);
  return compact;
}

}  // namespace skeletex
