// SPDX-License-Identifier: MIT
#include "skeletex/convert/parameterize/spd.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "skeletex/geometry/parallel.h"
#include "spd_structs.h"

namespace skeletex {
namespace {

constexpr int kWorkGroup = 32;
// A CPU goes through a column's list once; a GPU needs more work-items than there are columns.
constexpr int kTileRowsGpu = 64;
// The pole's ray leans this much towards its column, so that it meets what holds the axis whatever rounding does there.
constexpr double kPoleCosine = 1e-6;
// Lists of triangles for sight lines: per turn, and along the bone.
constexpr int kSightSectors = 128;
constexpr int kSightSlabs = 64;
constexpr double kSightTriangles = 4096;  // of a chart, up to which so many sectors and slabs will do

/// The triangles of all charts in the coordinates of their bones.
struct LocalTriangles {
  std::vector<int> begins;    // per chart, and the end
  std::vector<float> points;  // 9 per triangle
  // What angles about the bone a triangle covers, in turns; last - first >= 1: all.
  std::vector<float> first_turn, last_turn;
  double extent = 0;  // the largest coordinate

  int count() const { return begins.back(); }
};

LocalTriangles localize(const Skeleton& skeleton, const SeparationPlanes& separation, std::span<const Chart> charts) {
  LocalTriangles local;
  local.begins.push_back(0);
  for (const Chart& chart : charts)
    local.begins.push_back(local.begins.back() + static_cast<int>(chart.triangles.size()));
  local.points.resize(9 * static_cast<std::size_t>(local.count()));
  local.first_turn.resize(local.count());
  local.last_turn.resize(local.count());
  std::vector<double> extents(charts.size(), 0);
  for_each_block(charts.size(), 1, [&](std::size_t k, std::size_t, std::size_t) {
    const Chart& chart = charts[k];
    const BoneBasis& basis = separation.bases()[chart.bone];
    const Vec3& head = end_position(skeleton, chart.bone, BoneEnd::kHead);
    std::vector<std::array<float, 3>> positions;
    std::vector<double> turns;
    int t = local.begins[k];
    for (const Vec3& position : chart.positions) {
      const Vec3 offset = position - head;
      positions.push_back({static_cast<float>(offset.dot(basis.s)), static_cast<float>(offset.dot(basis.b)),
                           static_cast<float>(offset.dot(basis.o))});
      // Of the rounded coordinates: the device must find the same half-planes.
      turns.push_back(std::atan2(static_cast<double>(positions.back()[1]), static_cast<double>(positions.back()[0])) /
                      (2 * std::numbers::pi));
      extents[k] = std::max(extents[k], offset.norm());
    }
    for (const Triangle& triangle : chart.triangles) {
      for (int corner = 0; corner < 3; ++corner)
        for (int i = 0; i < 3; ++i)
          local.points[9 * static_cast<std::size_t>(t) + 3 * corner + i] = positions[triangle[corner]][i];
      double low = 0, high = 0;
      bool is_on_axis = false;
      for (int corner = 0; corner < 3; ++corner) {
        const auto& p = positions[triangle[corner]];
        is_on_axis = is_on_axis || (p[0] == 0 && p[1] == 0);
        double turn = turns[triangle[corner]] - turns[triangle[0]];
        turn -= std::round(turn);
        low = std::min(low, turn);
        high = std::max(high, turn);
      }
      // A triangle that the axis does not pass through covers less than half a turn.
      if (is_on_axis || high - low > 0.5 - 1e-6) {
        local.first_turn[t] = 0;
        local.last_turn[t] = 1;
      } else {
        local.first_turn[t] = static_cast<float>(turns[triangle[0]] + low);
        local.last_turn[t] = static_cast<float>(turns[triangle[0]] + high);
      }
      ++t;
    }
  });
  for (const double extent : extents) local.extent = std::max(local.extent, extent);
  return local;
}

/// Lists of numbers as compressed rows.
struct Lists {
  std::vector<int> begins;
  std::vector<int> triangles;
};

/// Calls visit(index) for every one of `count` angles (j / count) or sectors ([j, j + 1) / count) that a triangle
/// covers.
enum class AngleCell { kAngle, kSector };
template <class Visit>
void for_each_angle(const LocalTriangles& local, int triangle, int count, AngleCell cell, Visit&& visit) {
  // Slack for the rounding of angles in single precision, here and on the device.
  constexpr double kSlack = 4e-7;
  int first = 0, last = count - 1;
  if (local.last_turn[triangle] - local.first_turn[triangle] < 1) {
    const double low = (static_cast<double>(local.first_turn[triangle]) - kSlack) * count;
    first = static_cast<int>(cell == AngleCell::kAngle ? std::ceil(low) : std::floor(low));
    last = static_cast<int>(std::floor((static_cast<double>(local.last_turn[triangle]) + kSlack) * count));
    last = std::min(last, first + count - 1);
  }
  for (int j = first; j <= last; ++j) visit(((j % count) + count) % count);
}

/// Compressed rows of charts, whose lists lie behind each other, from a function that calls visit(list, triangle) for
/// everything that belongs into those of one, in order.
template <class ForEach>
Lists fill_lists(int count, std::size_t charts, ForEach&& for_each_list) {
  Lists lists;
  lists.begins.assign(count + 1, 0);
  const auto for_charts = [&](const auto& visit) {
    for_each_block(charts, 1, [&](std::size_t chart, std::size_t, std::size_t) { for_each_list(chart, visit); });
  };
  for_charts([&](int list, int) { ++lists.begins[list + 1]; });
  for (std::size_t i = 1; i < lists.begins.size(); ++i) lists.begins[i] += lists.begins[i - 1];
  lists.triangles.resize(lists.begins.back());
  std::vector<int> next(lists.begins.begin(), lists.begins.end() - 1);
  for_charts([&](int list, int t) { lists.triangles[next[list]++] = t; });
  return lists;
}

/// Appends a patch's table of guesses and notes its size: one entry per half row or so.
void append_guesses(std::span<const RowRecord> rows, SpdPatch& patch, std::vector<int>& guesses) {
  patch.guesses_per_mark = 2 * static_cast<float>(rows.size());
  patch.guess_count = 6 * static_cast<int>(rows.size()) + 2;
  int row = 0;
  for (int i = 0; i < patch.guess_count; ++i) {
    const float mark = static_cast<float>(i) / patch.guesses_per_mark - 1;
    const auto mark_of = [](const RowRecord& r) { return r.axial + r.cap_sin / (r.cap_cos + std::abs(r.cap_sin)); };
    while (row < static_cast<int>(rows.size()) && mark_of(rows[row]) < mark) ++row;
    guesses.push_back(row);
  }
}

}  // namespace

std::vector<SpdHits> cast_spd_rays(ClContext& context, const Skeleton& skeleton, const SeparationPlanes& separation,
                                   std::span<const Chart> charts, std::span<const Patch> patches, SpdHit which) {
  const LocalTriangles local = localize(skeleton, separation, charts);
  std::vector<SpdPatch> records;
  std::vector<int> column_patches;
  std::vector<RowRecord> rows;
  std::vector<int> row_guesses;
  std::vector<ColumnRecord> columns;
  int texels = 0, tallest = 0;
  for (std::size_t i = 0; i < charts.size(); ++i) {
    const int bone = charts[i].bone, width = patches[i].rectangle.width, height = patches[i].rectangle.height;
    const bool is_head_free = separation.is_free(bone, BoneEnd::kHead),
               is_tail_free = separation.is_free(bone, BoneEnd::kTail);
    // Cuts lie off the separation planes by the segmentation's perturbation and by rounding; both are relative to the
    // model's size.
    const float tolerance = static_cast<float>(4e-6 * local.extent);
    records.push_back({static_cast<float>(bone_length(skeleton, bone)), tolerance, is_head_free ? 0 : tolerance,
                       is_tail_free ? 0 : tolerance, width, height, static_cast<int>(rows.size()),
                       static_cast<int>(columns.size()), texels, is_head_free, is_tail_free,
                       static_cast<int>(row_guesses.size()), 0, 0});
    tallest = std::max(tallest, height);
    texels += width * height;
    for (const double u : patches[i].row_u) {
      const Axial at = axial_of(u, is_head_free, is_tail_free);
      rows.push_back({static_cast<float>(u), static_cast<float>(at.axial),
                      static_cast<float>(std::max(kPoleCosine, std::cos(at.latitude))),
                      static_cast<float>(std::sin(at.latitude))});
    }
    append_guesses(std::span(rows).last(height), records.back(), row_guesses);
    for (int j = 0; j < width; ++j) {
      const double turn = static_cast<double>(j) / width, angle = 2 * std::numbers::pi * turn;
      columns.push_back({static_cast<float>(std::cos(angle)), static_cast<float>(std::sin(angle)),
                         static_cast<float>(separation.slope(bone, BoneEnd::kHead, turn)),
                         static_cast<float>(separation.slope(bone, BoneEnd::kTail, turn))});
      column_patches.push_back(static_cast<int>(i));
    }
  }
  const Lists lists = fill_lists(static_cast<int>(columns.size()), charts.size(), [&](std::size_t i, auto&& visit) {
    for (int t = local.begins[i]; t < local.begins[i + 1]; ++t)
      for_each_angle(local, t, records[i].width, AngleCell::kAngle,
                     [&](int j) { visit(records[i].column_begin + j, t); });
  });

  const int column_count = static_cast<int>(columns.size());
  const int tile_rows = context.device().type == "cpu" ? std::max(tallest, 1) : kTileRowsGpu;
  const std::size_t tiles = (tallest + tile_rows - 1) / tile_rows;
  auto hit_triangles = context.allocate<int>(texels);
  auto hit_distances = context.allocate<float>(texels);
  const ClKernelName kernel{"spd.cl", "cast_rays"};
  context.launch(kernel, ClRange({columns.size(), tiles}, {context.work_group_size(kernel, kWorkGroup), 1}),
                 column_count, tile_rows, which == SpdHit::kLast ? 1 : 0, context.upload(records),
                 context.upload(column_patches), context.upload(rows), context.upload(row_guesses),
                 context.upload(columns), context.upload(lists.begins), context.upload(lists.triangles),
                 context.upload(local.points), hit_triangles, hit_distances);
  const std::vector<int> found = context.download(hit_triangles);
  const std::vector<float> distances = context.download(hit_distances);

  std::vector<SpdHits> hits(charts.size());
  for (std::size_t i = 0; i < charts.size(); ++i) {
    const int begin = records[i].texel_begin, end = begin + records[i].width * records[i].height;
    hits[i].triangles.assign(found.begin() + begin, found.begin() + end);
    hits[i].distances.assign(distances.begin() + begin, distances.begin() + end);
    for (int& triangle : hits[i].triangles)
      if (triangle >= 0) triangle -= local.begins[i];
  }
  return hits;
}

std::vector<double> unseen_area_fractions(ClContext& context, const Skeleton& skeleton,
                                          const SeparationPlanes& separation, std::span<const Chart> charts) {
  const LocalTriangles local = localize(skeleton, separation, charts);
  // Each chart cut into sectors about its bone and slabs along it: as many as leave lists as long as in small charts,
  // however fine the mesh.
  std::vector<int> sectors, slabs, first_lists{0};
  for (const Chart& chart : charts) {
    const double finer = std::max(1.0, std::sqrt(static_cast<double>(chart.triangles.size()) / kSightTriangles));
    sectors.push_back(static_cast<int>(finer * kSightSectors));
    slabs.push_back(static_cast<int>(finer * kSightSlabs));
    first_lists.push_back(first_lists.back() + sectors.back() * slabs.back());
  }
  std::vector<float> lowest(charts.size(), 0), slabs_per_height(charts.size(), 0);
  for (std::size_t i = 0; i < charts.size(); ++i) {
    const auto [first, last] = std::pair{3 * local.begins[i], 3 * local.begins[i + 1]};
    float low = std::numeric_limits<float>::max(), high = std::numeric_limits<float>::lowest();
    for (int p = first; p < last; ++p) {
      low = std::min(low, local.points[3 * static_cast<std::size_t>(p) + 2]);
      high = std::max(high, local.points[3 * static_cast<std::size_t>(p) + 2]);
    }
    lowest[i] = low;
    slabs_per_height[i] = high > low ? static_cast<float>(slabs[i]) / (high - low) : 0;
  }
  const auto slab_of = [&](std::size_t chart, float z) {
    return std::clamp(static_cast<int>((z - lowest[chart]) * slabs_per_height[chart]), 0, slabs[chart] - 1);
  };
  const Lists lists = fill_lists(first_lists.back(), charts.size(), [&](std::size_t i, auto&& visit) {
    for (int t = local.begins[i]; t < local.begins[i + 1]; ++t) {
      const float* p = &local.points[9 * static_cast<std::size_t>(t)];
      const int first = slab_of(i, std::min({p[2], p[5], p[8]})), last = slab_of(i, std::max({p[2], p[5], p[8]}));
      for_each_angle(local, t, sectors[i], AngleCell::kSector, [&](int sector) {
        for (int slab = first; slab <= last; ++slab) visit(first_lists[i] + sector * slabs[i] + slab, t);
      });
    }
  });
  std::vector<SpdSightLine> lines(local.count());
  std::vector<float> spheres(4 * static_cast<std::size_t>(local.count()));
  const float radius_slack = static_cast<float>(1e-6 * local.extent);
  for (std::size_t i = 0; i < charts.size(); ++i) {
    const Chart& chart = charts[i];
    const BoneBasis& basis = separation.bases()[chart.bone];
    const Vec3& head = end_position(skeleton, chart.bone, BoneEnd::kHead);
    const double length = bone_length(skeleton, chart.bone);
    const bool is_head_free = separation.is_free(chart.bone, BoneEnd::kHead),
               is_tail_free = separation.is_free(chart.bone, BoneEnd::kTail);
    for_each_block(chart.triangles.size(), 1024, [&](std::size_t, std::size_t begin, std::size_t end) {
      for (std::size_t k = begin; k < end; ++k) {
        const Triangle& triangle = chart.triangles[k];
        const Vec3 centre =
            (chart.positions[triangle[0]] + chart.positions[triangle[1]] + chart.positions[triangle[2]]) / 3;
        const SpdCoordinates at = spd_coordinates(skeleton, separation, chart.bone, centre);
        const Vec3 offset = centre - head;
        const double x = offset.dot(basis.s), y = offset.dot(basis.b), r = std::hypot(x, y);
        SpdSightLine line{};
        line.distance = -1;
        if (at.u >= 0 && at.u <= 1 && r > 0) {
          const double foot = axial_of(at.u, is_head_free, is_tail_free).axial * length;
          const double z = offset.dot(basis.o) - foot, distance = std::hypot(r, z);
          const double slack = 1e-6 * (std::abs(foot) + std::abs(z) + distance);
          const int sector = std::min(sectors[i] - 1, static_cast<int>(at.turn * sectors[i]));
          const int list = first_lists[i] + sector * slabs[i];
          line = {static_cast<float>(x / r),
                  static_cast<float>(y / r),
                  static_cast<float>(foot),
                  static_cast<float>(r / distance),
                  static_cast<float>(z / distance),
                  static_cast<float>(distance),
                  list + slab_of(i, static_cast<float>(foot + std::min(z, 0.0) - slack)),
                  list + slab_of(i, static_cast<float>(foot + std::max(z, 0.0) + slack))};
        }
        const std::size_t t = static_cast<std::size_t>(local.begins[i]) + k;
        lines[t] = line;
        const Eigen::Map<const Eigen::Matrix3f> corners(&local.points[9 * t]);
        const Eigen::Vector3f middle = corners.rowwise().mean();
        const float radius = std::sqrt((corners.colwise() - middle).colwise().squaredNorm().maxCoeff());
        Eigen::Map<Eigen::Vector4f>(&spheres[4 * t]) << middle, radius + radius_slack;
      }
    });
  }

  auto is_hidden = context.allocate<int>(lines.size());
  const ClKernelName kernel{"spd.cl", "find_hidden"};
  context.launch(kernel, ClRange({lines.size(), 1}, {context.work_group_size(kernel, kWorkGroup), 1}), local.count(),
                 context.upload(lines), context.upload(lists.begins), context.upload(lists.triangles),
                 context.upload(spheres), context.upload(local.points), is_hidden);
  const std::vector<int> hidden = context.download(is_hidden);

  std::vector<double> fractions(charts.size(), 0);
  for_each_block(charts.size(), 1, [&](std::size_t i, std::size_t, std::size_t) {
    double unseen = 0, area = 0;
    for (std::size_t t = 0; t < charts[i].triangles.size(); ++t) {
      const Triangle& triangle = charts[i].triangles[t];
      const Vec3& p = charts[i].positions[triangle[0]];
      const double a = 0.5 * (charts[i].positions[triangle[1]] - p).cross(charts[i].positions[triangle[2]] - p).norm();
      area += a;
      if (hidden[local.begins[i] + t]) unseen += a;
    }
    fractions[i] = area > 0 ? unseen / area : 0;
  });
  return fractions;
}

SpdCoordinates spd_coordinates(const Skeleton& skeleton, const SeparationPlanes& separation, int bone,
                               const Vec3& point) {
  const BoneBasis& basis = separation.bases()[bone];
  const Vec3 offset = point - end_position(skeleton, bone, BoneEnd::kHead);
  const double length = bone_length(skeleton, bone);
  const double z = offset.dot(basis.o), x = (offset - z * basis.o).norm();
  const double turn = separation.turn_of(bone, offset);
  const bool is_head_free = separation.is_free(bone, BoneEnd::kHead),
             is_tail_free = separation.is_free(bone, BoneEnd::kTail);
  if (is_tail_free && z > length) return {u_of({1, std::atan2(z - length, x)}, is_head_free, is_tail_free), turn};
  if (is_head_free && z < 0) return {u_of({0, std::atan2(z, x)}, is_head_free, is_tail_free), turn};
  // Along the line through P parallel to the bone: A_H and A_T are where it meets the separation planes (paper, Figure
  // 5).
  const double a_head = x * separation.slope(bone, BoneEnd::kHead, turn),
               a_tail = length + x * separation.slope(bone, BoneEnd::kTail, turn);
  double axial = (z - a_head) / (a_tail - a_head);
  // Past the edge where both separation planes meet, what lies between them is in neither half-space.
  if (a_tail <= a_head)
    axial = z < a_head ? std::min((z - a_head) / length, -1e-9) : 1 + std::max((z - a_tail) / length, 1e-9);
  return {u_of({axial, 0}, is_head_free, is_tail_free), turn};
}

namespace {

class SpdMethod : public ParameterizationMethod {
 public:
  std::vector<MapReport> map(ClContext&, std::span<Chart> charts, const MapOptions&) const override {
    return std::vector<MapReport>(charts.size());
  }
};

}  // namespace

std::unique_ptr<ParameterizationMethod> make_spd_method() { return std::make_unique<SpdMethod>(); }

}  // namespace skeletex
