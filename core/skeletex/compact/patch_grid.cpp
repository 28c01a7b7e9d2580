// SPDX-License-Identifier: MIT
#include "skeletex/compact/patch_grid.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace skeletex {

std::vector<BaseSite> base_sites(const CompactModel& model, const SeparationPlanes& separation, BoneIndex bone,
                                 const EndRow& end_row) {
  const CompactPatch& patch = model.patches[bone];
  const std::vector<Vec3> head = end_row(BoneEnd::kHead, patch.columns), tail = end_row(BoneEnd::kTail, patch.columns);
  const Vec3& o = separation.bases()[bone].o;
  std::vector<BaseSite> sites;
  for (int row = 1; row < patch.intervals; ++row)
    for (int column = 0; column < patch.columns; ++column) {
      const double share = static_cast<double>(row) / patch.intervals;
      const Vec3 radial = separation.radial(bone, static_cast<double>(column) / patch.columns);
      sites.push_back({(1 - share) * head[column] + share * tail[column], radial, o.cross(radial), o});
    }
  return sites;
}

PatchGrid empty_grid(const CompactPatch& patch, const std::array<bool, 2>& has_pole, const EndRow& end_row) {
  PatchGrid grid{patch.intervals, patch.columns, has_pole, {}};
  grid.points.assign(static_cast<std::size_t>(patch.intervals + 1) * patch.columns, Vec3::Zero());
  const std::vector<Vec3> head = end_row(BoneEnd::kHead, grid.columns), tail = end_row(BoneEnd::kTail, grid.columns);
  std::copy(head.begin(), head.end(), grid.points.begin());
  std::copy(tail.begin(), tail.end(), grid.points.end() - grid.columns);
  return grid;
}

bool step_doubles_rows(const CompactPatch& patch, int step) {
  return step < patch.step_count ? (patch.row_steps >> step & 1) != 0 : (step - patch.step_count) % 2 == 0;
}

namespace {

std::vector<Vec3> site_points(const CompactModel& model, const Refinement& refinement, const StepResiduals* residuals,
                              int step, bool rows) {
  std::vector<Vec3> points;
  points.reserve(refinement.site_count());
  if (residuals == nullptr) {
    for (const Site& site : refinement.sites()) points.push_back(site.predicted);
    return points;
  }
  const double q = normal_step(model.step, step);
  std::vector<int> offsets(refinement.site_count());
  for (int i = 0; i < refinement.site_count(); ++i) {
    const Site& site = refinement.sites()[i];
    offsets[i] = offset_of(residuals->normal[i], expected_offset(model.weights[rows ? 1 : 0],
                                                                 neighbours_of(i, refinement.site_columns()), offsets));
    Vec3 point = site.predicted + q / 64 * offsets[i] * site.normal;
    if (!residuals->side.empty()) {
      const double tangential = tangential_step(q, step, refinement.mean_spacing(), site);
      point += tangential * (residuals->side[i] * site.side + residuals->across[i] * site.across);
    }
    points.push_back(point);
  }
  return points;
}

}  // namespace

PatchGrid decode_patch(const CompactModel& model, const SeparationPlanes& separation, BoneIndex bone,
                       const std::array<bool, 2>& has_pole, const EndRow& end_row, int step_count) {
  const CompactPatch& patch = model.patches[bone];
  PatchGrid grid = empty_grid(patch, has_pole, end_row);
  const std::vector<BaseSite> sites = base_sites(model, separation, bone, end_row);
  const std::array<double, 3> steps = base_steps(model, bone);
  for (std::size_t i = 0; i < sites.size(); ++i) grid.points[i + patch.columns] = base_point(patch, sites[i], steps, i);
  for (int step = 0; step < step_count; ++step) {
    const bool rows = step_doubles_rows(patch, step);
    const Refinement refinement(grid, rows, end_row);
    const StepResiduals* residuals =
        step < static_cast<int>(patch.steps.size()) && !patch.steps[step].normal.empty() ? &patch.steps[step] : nullptr;
    grid = refinement.refined(site_points(model, refinement, residuals, step, rows));
  }
  return grid;
}

}  // namespace skeletex
