// SPDX-License-Identifier: MIT
#include "skeletex/compact/encode/encode_patch.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "skeletex/compact/encode/rounding.h"

namespace skeletex {
namespace {

/// The grid as it is decoded, and where in the source its points were read.
struct Traced {
  PatchGrid grid;
  std::vector<Place> places;  ///< columns lie around those of the regular grid, whatever the period
};

class PatchEncoder {
 public:
  PatchEncoder(CompactModel& compact, const SeparationPlanes& separation, BoneIndex bone,
               const std::array<bool, 2>& has_pole, const EndRow& end_row, const SourcePatch& source,
               const ResidualOptions& options, const std::vector<Place>& fixed_places)
      : compact_(compact),
        patch_(compact.patches[bone]),
        separation_(separation),
        bone_(bone),
        has_pole_(has_pole),
        end_row_(end_row),
        source_(source),
        options_(options),
        fixed_places_(fixed_places) {}

  void run(std::vector<Place>* places) {
    Traced traced = encode_base();
    const int coded = patch_.step_count - compact_.bare_levels;
    patch_.steps.clear();
    patch_.row_steps = 0;
    for (int step = 0; step < patch_.step_count; ++step) {
      const bool rows = next_refines_rows(traced.grid, step);
      if (rows) patch_.row_steps |= 1u << step;
      if (step < coded) {
        traced = encode_step(traced, step, rows);
        set_rows(traced);
      } else {
        traced = bare_step(traced, step, rows, places != nullptr);
      }
    }
    if (places != nullptr) *places = std::move(traced.places);
  }

 private:
  Place home(int row, int column, const PatchGrid& grid) const {
    return {static_cast<double>(row) / grid.intervals * (source_.rows - 1),
            static_cast<double>(column) / grid.columns * source_.columns};
  }
  void set_end_places(Traced& traced) const {
    for (const int row : {0, traced.grid.intervals})
      for (int c = 0; c < traced.grid.columns; ++c)
        traced.places[traced.grid.index(row, c)] = home(row, c, traced.grid);
  }

  Traced encode_base() {
    Traced traced{empty_grid(patch_, has_pole_, end_row_), {}};
    traced.places.resize(traced.grid.points.size());
    set_end_places(traced);
    const std::vector<BaseSite> sites = base_sites(compact_, separation_, bone_, end_row_);
    double radius = 0;
    std::vector<Vec3> offsets;
    for (std::size_t i = 0; i < sites.size(); ++i) {
      const int row = 1 + static_cast<int>(i) / patch_.columns, column = static_cast<int>(i) % patch_.columns;
      const Place place = home(row, column, traced.grid);
      traced.places[traced.grid.index(row, column)] = place;
      const Vec3 point = source_.at(place);
      offsets.push_back(point - sites[i].predicted);
      const Vec3 from_head = point - end_position(compact_.skeleton, bone_, BoneEnd::kHead);
      const Vec3& o = separation_.bases()[bone_].o;
      radius += (from_head - from_head.dot(o) * o).norm() / static_cast<double>(sites.size());
    }
    patch_.base_exponent =
        std::clamp(rounded(std::log2(std::max(0.03 * radius, 4 * compact_.step) / compact_.step)), 0, 30);
    set_scales(traced.grid);
    const Place reach(0.25 * row_scale_, 0.25 * column_scale_);
    const std::array<double, 3> steps = base_steps(compact_, bone_);
    patch_.base.clear();
    for (std::size_t i = 0; i < sites.size(); ++i) {
      const BaseSite& site = sites[i];
      Place& place = traced.places[i + patch_.columns];
      const int around = rounded(offsets[i].dot(site.around) / steps[1]),
                along = rounded(offsets[i].dot(site.along) / steps[2]);
      // Rounding moves the point off the surface, to which it then goes back.
      const Vec3 moved = site.predicted + steps[1] * around * site.around + steps[2] * along * site.along;
      double out = offsets[i].dot(site.out);
      if (const auto found = meet_line(source_, place, reach, moved, site.out, 0.05 * steps[0])) {
        place = found->place;
        out = found->distance;
      }
      patch_.base.insert(patch_.base.end(), {rounded(out / steps[0]), around, along});
      traced.grid.points[i + patch_.columns] = base_point(patch_, site, steps, i);
    }
    return traced;
  }

  /// Rows or columns, whichever are further apart, as long as the wanted size has some of them left.
  bool next_refines_rows(const PatchGrid& grid, int step) {
    const int taken = __builtin_popcount(patch_.row_steps & ((1u << step) - 1));
    if (taken >= row_step_count_) return false;
    if (step - taken >= patch_.step_count - row_step_count_) return true;
    double between_rows = 0, between_columns = 0;
    for (int r = 1; r < grid.intervals; ++r)
      for (int c = 0; c < grid.columns; ++c) {
        between_rows += (grid.at(r, c) - grid.at(r - 1, c)).norm();
        between_columns += (grid.at(r, c + 1) - grid.at(r, c)).norm();
      }
    return between_rows > between_columns;
  }

  /// The integers of one point.
  struct Residual {
    int normal = 0, side = 0, across = 0;
    Place place;
  };

  /// A step's number and its quantization.
  struct Step {
    int number = 0;
    bool is_rows = false;
    double q = 0, mean_spacing = 0;
    double mean_columns = 0;     ///< distance between columns
    std::vector<char> is_fixed;  ///< per site: whether it lies next to a fixed place
  };

  std::vector<char> fixed_sites(const Refinement& refinement, const PatchGrid& grid, bool rows) const {
    const int intervals = (rows ? 2 : 1) * grid.intervals, columns = (rows ? 1 : 2) * grid.columns;
    std::vector<char> is_near(static_cast<std::size_t>(intervals + 1) * columns, 0);
    for (const Place& place : fixed_places_) {
      const int row = rounded(place[0] * intervals), column = rounded((place[1] - std::floor(place[1])) * columns);
      for (int r = std::max(0, row - 1); r <= std::min(intervals, row + 1); ++r)
        for (int c = column - 1; c <= column + 1; ++c) is_near[r * columns + (c + columns) % columns] = 1;
    }
    std::vector<char> is_fixed;
    for (const Site& site : refinement.sites()) is_fixed.push_back(is_near[site.row * columns + site.column]);
    return is_fixed;
  }

  Residual residual_of(const Site& site, const Traced& traced, const Step& step, int expected,
                       const std::vector<Place>& before) const {
    const Place middle = middle_of(site, traced);
    if (step.is_fixed[before.size()] != 0) return home_residual(site, middle, step, expected);
    Residual residual;
    if (!stays_home(step.number)) {
      const Place reach = options_.reach * Place(row_scale_, column_scale_);
      const auto found = meet_line(source_, middle, reach, site.predicted, site.normal, tolerance(step.q, site));
      const double columns = step.is_rows ? site.width : site.spacing;
      if (columns < options_.least_spacing * step.q && columns < 0.4 * step.mean_columns) {
        residual.place = found ? found->place : middle;
        return residual;
      }
      if (found && !folds(found->place, site, traced, step.is_rows, before)) {
        residual.place = found->place;
        residual.normal = rounded_towards_zero((64 * found->distance / step.q - expected) / 64, options_.rounding);
        return residual;
      }
    }
    if (is_fine(step.number)) {
      const Vec3 point = site.predicted + step.q / 64 * expected * site.normal;
      residual.place = nearest_place(source_, middle, Place(row_scale_, column_scale_), point);
      if ((source_.at(residual.place) - point).norm() < options_.near_enough * step.q) return residual;
    }
    return home_residual(site, middle, step, expected);
  }

  /// The same place, in the period next to another one.
  Place near(Place place, const Place& other) const {
    place[1] -= source_.columns * std::round((place[1] - other[1]) / source_.columns);
    return place;
  }
  double tolerance(double q, const Site& site) const { return std::max(0.05 * q, 1e-4 * site.spacing); }

  /// Whether a cell of the refined grid whose corners are the new point and points before it would be turned over, or
  /// nearly so, in rows and columns of the source.
  bool folds(const Place& place, const Site& site, const Traced& traced, bool is_rows,
             const std::vector<Place>& before) const {
    const PatchGrid& grid = traced.grid;
    const double least = 0.3 * row_scale_ * column_scale_ / 2;
    const auto old = [&](int row, int column) { return near(traced.places[grid.index(row, column)], place); };
    const auto is_good = [&](const Place& upper_left, const Place& upper_right, const Place& lower_right,
                             const Place& lower_left) {
      const std::array<Place, 4> corners{near(upper_left, place), near(upper_right, place), near(lower_right, place),
                                         near(lower_left, place)};
      for (int i = 0; i < 4; ++i) {
        const Place one = corners[(i + 1) % 4] - corners[i], two = corners[(i + 3) % 4] - corners[i];
        if (one[1] * two[0] - one[0] * two[1] < least) return false;
      }
      return true;
    };
    if (is_rows) {
      const int r = (site.row - 1) / 2, c = site.column, first = r * grid.columns;
      const auto beside = [&](int left, int right, const Place& left_place, const Place& right_place) {
        return is_good(old(r, left), old(r, right), right_place, left_place) &&
               is_good(left_place, right_place, old(r + 1, right), old(r + 1, left));
      };
      if (c > 0 && !beside(c - 1, c, before[first + c - 1], place)) return true;
      return c == grid.columns - 1 && !beside(c, 0, place, before[first]);
    }
    const int r = site.row, c = (site.column - 1) / 2;
    const Place upper = r > 1 ? before[before.size() - grid.columns] : Place(0.5 * (old(0, c) + old(0, c + 1)));
    if (!is_good(old(r - 1, c), upper, place, old(r, c)) || !is_good(upper, old(r - 1, c + 1), old(r, c + 1), place))
      return true;
    if (r + 1 < grid.intervals) return false;
    const Place lower = 0.5 * (old(r + 1, c) + old(r + 1, c + 1));
    return !is_good(old(r, c), place, lower, old(r + 1, c)) || !is_good(place, old(r, c + 1), old(r + 1, c + 1), lower);
  }

  Residual home_residual(const Site& site, const Place& middle, const Step& step, int expected) const {
    const double tangential = tangential_step(step.q, step.number, step.mean_spacing, site);
    Residual residual;
    residual.place = middle;
    const Vec3 offset = source_.at(middle) - site.predicted;
    residual.side = rounded(offset.dot(site.side) / tangential);
    residual.across = rounded(offset.dot(site.across) / tangential);
    const Vec3 moved = site.predicted + tangential * (residual.side * site.side + residual.across * site.across);
    double distance = offset.dot(site.normal);
    const Place reach = Place(0.25 * row_scale_, 0.25 * column_scale_);
    if (const auto found = meet_line(source_, middle, reach, moved, site.normal, tolerance(step.q, site))) {
      residual.place = found->place;
      distance = found->distance;
    }
    residual.normal = rounded_towards_zero((64 * distance / step.q - expected) / 64, options_.rounding);
    return residual;
  }

  Traced encode_step(const Traced& traced, int step, bool rows) {
    const Refinement refinement(traced.grid, rows, end_row_);
    Step quantization{step,
                      rows,
                      normal_step(compact_.step, step),
                      refinement.mean_spacing(),
                      0,
                      fixed_sites(refinement, traced.grid, rows)};
    for (const Site& site : refinement.sites())
      quantization.mean_columns += (rows ? site.width : site.spacing) / refinement.site_count();
    const double q = quantization.q;
    set_scales(traced.grid);
    const int coded = patch_.step_count - compact_.bare_levels;
    const bool is_sparse = step >= coded - options_.kept_levels;
    StepResiduals residuals;
    std::vector<int> offsets(refinement.site_count());
    std::vector<Vec3> points;
    std::vector<Place> places;
    bool has_tangential = false;
    for (int i = 0; i < refinement.site_count(); ++i) {
      const Site& site = refinement.sites()[i];
      const int expected =
          expected_offset(compact_.weights[rows ? 1 : 0], neighbours_of(i, refinement.site_columns()), offsets);
      Residual r = residual_of(site, traced, quantization, expected, places);
      if (is_sparse && quantization.is_fixed[i] == 0 && std::abs(r.normal) < options_.least_kept)
        r.normal = r.side = r.across = 0;
      offsets[i] = offset_of(r.normal, expected);
      const double tangential = tangential_step(q, step, refinement.mean_spacing(), site);
      points.push_back(site.predicted + q / 64 * offsets[i] * site.normal +
                       tangential * (r.side * site.side + r.across * site.across));
      places.push_back(r.place);
      residuals.normal.push_back(r.normal);
      residuals.side.push_back(r.side);
      residuals.across.push_back(r.across);
      has_tangential = has_tangential || r.side != 0 || r.across != 0;
    }
    if (!has_tangential) {
      residuals.side.clear();
      residuals.across.clear();
    }
    patch_.steps.push_back(std::move(residuals));
    return refined(traced, refinement, rows, points, places);
  }

  Traced refined(const Traced& traced, const Refinement& refinement, bool rows, const std::vector<Vec3>& points,
                 const std::vector<Place>& places) const {
    Traced fine{refinement.refined(points), {}};
    fine.places.resize(fine.grid.points.size());
    for (int r = 0; r <= traced.grid.intervals; ++r)
      for (int c = 0; c < traced.grid.columns; ++c)
        fine.places[fine.grid.index(rows ? 2 * r : r, rows ? c : 2 * c)] = traced.places[traced.grid.index(r, c)];
    for (std::size_t i = 0; i < places.size(); ++i)
      fine.places[fine.grid.index(refinement.sites()[i].row, refinement.sites()[i].column)] = places[i];
    set_end_places(fine);
    return fine;
  }

  /// \param wants_places  whether the places of its points are found as well
  Traced bare_step(const Traced& traced, int number, bool rows, bool wants_places) {
    const Refinement refinement(traced.grid, rows, end_row_);
    std::vector<Vec3> points;
    for (const Site& site : refinement.sites()) points.push_back(site.predicted);
    if (!wants_places) return {refinement.refined(points), {}};
    set_scales(traced.grid);
    std::vector<Place> places;
    for (const Site& site : refinement.sites()) {
      const Place middle = middle_of(site, traced), reach = options_.reach * Place(row_scale_, column_scale_);
      const auto found = meet_line(source_, middle, reach, site.predicted, site.normal,
                                   tolerance(normal_step(compact_.step, number), site));
      places.push_back(found ? found->place : middle);
    }
    return refined(traced, refinement, rows, points, places);
  }

  void set_scales(const PatchGrid& grid) {
    row_scale_ = static_cast<double>(source_.rows - 1) / grid.intervals;
    column_scale_ = static_cast<double>(source_.columns) / grid.columns;
  }
  /// Halfway between the places of a site's parents.
  Place middle_of(const Site& site, const Traced& traced) const {
    const Place& a = traced.places[site.parents[0]];
    return 0.5 * (a + near(traced.places[site.parents[1]], a));
  }

  /// The row table from the places of the rows.
  void set_rows(const Traced& traced) {
    std::array<int, 3> knots{};
    for (int k = 0; k < 3; ++k) {
      const double row = (k + 1) / 4.0 * traced.grid.intervals;
      const int upper = std::min(static_cast<int>(row), traced.grid.intervals - 1);
      double mean = 0;
      for (int c = 0; c < traced.grid.columns; ++c)
        mean += ((1 - (row - upper)) * u_at(traced.places[traced.grid.index(upper, c)][0]) +
                 (row - upper) * u_at(traced.places[traced.grid.index(upper + 1, c)][0])) /
                traced.grid.columns;
      const int least = k == 0 ? 1 : knots[k - 1] + 1;
      knots[k] = std::clamp(rounded(256 * mean), least, 253 + k);
    }
    patch_.row_knots = knots;
  }
  double u_at(double row) const {
    const int r = std::clamp(static_cast<int>(row), 0, source_.rows - 2);
    return source_.row_u[r] + (row - r) * (source_.row_u[r + 1] - source_.row_u[r]);
  }

  CompactModel& compact_;
  CompactPatch& patch_;
  const SeparationPlanes& separation_;
  int bone_;
  std::array<bool, 2> has_pole_;
  const EndRow& end_row_;
  const SourcePatch& source_;
  const ResidualOptions& options_;
  const std::vector<Place>& fixed_places_;
  double row_scale_ = 1, column_scale_ = 1;  ///< texels of the source between the grid's rows, and columns
  int row_step_count_ = __builtin_popcount(patch_.row_steps);
};

}  // namespace

void encode_patch(CompactModel& compact, const SeparationPlanes& separation, BoneIndex bone,
                  const std::array<bool, 2>& has_pole, const EndRow& end_row, const SourcePatch& source,
                  const ResidualOptions& options, const std::vector<Place>& fixed_places, std::vector<Place>* places) {
  PatchEncoder(compact, separation, bone, has_pole, end_row, source, options, fixed_places).run(places);
}

}  // namespace skeletex
