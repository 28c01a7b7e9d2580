// SPDX-License-Identifier: MIT
#include "skeletex/convert/parameterize/spd.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "skeletex/geometry/parallel.h"
#include "skeletex/geometry/triangle_tree.h"
#include "skeletex/math/portable.h"
#include "spd_structs.h"

namespace skeletex {
namespace {

constexpr int kWorkGroup = 32;
// A CPU goes through a column's list once; a GPU needs more work-items than there are columns.
constexpr int kTileRowsGpu = 64;
// The pole's ray leans this much towards its column, so that it meets what holds the axis whatever rounding does there.
constexpr double kPoleCosine = 1e-6;

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
  for_each_index(charts.size(), [&](std::size_t k) {
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
      turns.push_back(
          portable::atan2(static_cast<double>(positions.back()[1]), static_cast<double>(positions.back()[0])) /
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

/// Calls visit(j) for every one of `count` angles j / count that a triangle covers.
template <class Visit>
void for_each_angle(const LocalTriangles& local, TriangleIndex triangle, int count, Visit&& visit) {
  // Slack for the rounding of angles in single precision, here and on the device.
  constexpr double kSlack = 4e-7;
  int first = 0, last = count - 1;
  if (local.last_turn[triangle] - local.first_turn[triangle] < 1) {
    const double low = (static_cast<double>(local.first_turn[triangle]) - kSlack) * count;
    first = static_cast<int>(std::ceil(low));
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
    for_each_index(charts, [&](std::size_t chart) { for_each_list(chart, visit); });
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

/// The rays of patches in the layout of spd.cl.
struct RayTables {
  std::vector<SpdPatch> patches;
  std::vector<RowRecord> rows;
  std::vector<ColumnRecord> columns;
  std::vector<int> column_patches, row_guesses;
  int texels = 0, tallest = 0;

  void add(const Skeleton& skeleton, const SeparationPlanes& separation, BoneIndex bone, const Patch& patch,
           double extent) {
    const int width = patch.rectangle.width, height = patch.rectangle.height;
    const bool is_head_free = separation.is_free(bone, BoneEnd::kHead),
               is_tail_free = separation.is_free(bone, BoneEnd::kTail);
    // Cuts lie off the separation planes by the segmentation's perturbation and by rounding; both are relative to the
    // model's size.
    const float tolerance = static_cast<float>(4e-6 * extent);
    column_patches.resize(column_patches.size() + width, static_cast<int>(patches.size()));
    patches.push_back({static_cast<float>(bone_length(skeleton, bone)), tolerance, is_head_free ? 0 : tolerance,
                       is_tail_free ? 0 : tolerance, width, height, static_cast<int>(rows.size()),
                       static_cast<int>(columns.size()), texels, is_head_free, is_tail_free,
                       static_cast<int>(row_guesses.size()), 0, 0});
    tallest = std::max(tallest, height);
    texels += width * height;
    for (const double u : patch.row_u) {
      const Axial at = axial_of(u, is_head_free, is_tail_free);
      rows.push_back({static_cast<float>(u), static_cast<float>(at.axial),
                      static_cast<float>(std::max(kPoleCosine, portable::cos(at.latitude))),
                      static_cast<float>(portable::sin(at.latitude))});
    }
    append_guesses(std::span(rows).last(height), patches.back(), row_guesses);
    for (int j = 0; j < width; ++j) {
      const double turn = static_cast<double>(j) / width, angle = 2 * std::numbers::pi * turn;
      columns.push_back({static_cast<float>(portable::cos(angle)), static_cast<float>(portable::sin(angle)),
                         static_cast<float>(separation.slope(bone, BoneEnd::kHead, turn)),
                         static_cast<float>(separation.slope(bone, BoneEnd::kTail, turn))});
    }
  }
};

/// Whether the ray from the bone's axis to a triangle's centre meets another triangle first, or there is no such ray.
bool is_hidden(const Skeleton& skeleton, const SeparationPlanes& separation, const TriangleMesh& mesh,
               const TriangleTree& tree, BoneIndex bone, int t) {
  const Triangle& triangle = mesh.triangles[t];
  const Vec3 centre = (mesh.positions[triangle[0]] + mesh.positions[triangle[1]] + mesh.positions[triangle[2]]) / 3;
  const double u = spd_coordinates(skeleton, separation, bone, centre).u;
  if (!(u >= 0 && u <= 1)) return true;
  const Axial axial = axial_of(u, separation.is_free(bone, BoneEnd::kHead), separation.is_free(bone, BoneEnd::kTail));
  const Vec3 foot = end_position(skeleton, bone, BoneEnd::kHead) +
                    axial.axial * bone_length(skeleton, bone) * separation.bases()[bone].o;
  constexpr double kNearer = 1 - 1e-5;  // than the centre, in single precision
  return std::isfinite(find_first_hit(mesh, tree, foot, centre - foot, kNearer, t));
}

/// Appends tables behind each other.
/// \return where the second one begins
int append(std::vector<int>& tables, const std::vector<int>& more) {
  const int begin = static_cast<int>(tables.size());
  tables.insert(tables.end(), more.begin(), more.end());
  return begin;
}

}  // namespace

std::vector<SpdHits> cast_spd_rays(ClContext& context, const Skeleton& skeleton, const SeparationPlanes& separation,
                                   std::span<const Chart> charts, std::span<const Patch> patches, SpdHit which) {
  const LocalTriangles local = localize(skeleton, separation, charts);
  RayTables rays;
  for (std::size_t i = 0; i < charts.size(); ++i)
    rays.add(skeleton, separation, charts[i].bone, patches[i], local.extent);
  const int columns = static_cast<int>(rays.columns.size());
  const Lists lists = fill_lists(columns, charts.size(), [&](std::size_t i, auto&& visit) {
    for (int t = local.begins[i]; t < local.begins[i + 1]; ++t)
      for_each_angle(local, t, rays.patches[i].width, [&](int j) { visit(rays.patches[i].column_begin + j, t); });
  });
  const int tile_rows = context.device().type == "cpu" ? std::max(rays.tallest, 1) : kTileRowsGpu;
  const std::size_t tiles = (rays.tallest + tile_rows - 1) / tile_rows;
  std::vector<int> tables = std::move(rays.column_patches);
  const int guesses = append(tables, rays.row_guesses), list_begins = append(tables, lists.begins);
  const CastParameters parameters{columns, tile_rows, which == SpdHit::kLast ? 1 : 0, guesses, list_begins};
  auto hit_triangles = context.allocate<int>(rays.texels);
  auto hit_distances = context.allocate<float>(rays.texels);
  const ClKernelName kernel{"spd.cl", "cast_rays"};
  context.launch(kernel, ClRange({rays.columns.size(), tiles}, {context.work_group_size(kernel, kWorkGroup), 1}),
                 parameters, context.upload(rays.patches), context.upload(rays.rows), context.upload(rays.columns),
                 context.upload(tables), context.upload(lists.triangles), context.upload(local.points), hit_triangles,
                 hit_distances);
  const auto [found, distances] = context.download(hit_triangles, hit_distances);

  std::vector<SpdHits> hits(charts.size());
  for (std::size_t i = 0; i < charts.size(); ++i) {
    const SpdPatch& patch = rays.patches[i];
    const int begin = patch.texel_begin, end = begin + patch.width * patch.height;
    hits[i].triangles.assign(found.begin() + begin, found.begin() + end);
    hits[i].distances.assign(distances.begin() + begin, distances.begin() + end);
    for (int& triangle : hits[i].triangles)
      if (triangle >= 0) triangle -= local.begins[i];
  }
  return hits;
}

std::vector<double> unseen_area_fractions(const Skeleton& skeleton, const SeparationPlanes& separation,
                                          std::span<const Chart> charts) {
  std::vector<double> fractions(charts.size(), 0);
  for (std::size_t i = 0; i < charts.size(); ++i) {
    const TriangleMesh mesh{charts[i].positions, charts[i].triangles};
    if (mesh.triangles.empty()) continue;
    const TriangleTree tree = build_triangle_tree(mesh);
    std::vector<std::uint8_t> hidden(mesh.triangles.size());
    for_each_index(hidden.size(), 256, [&](std::size_t t) {
      hidden[t] = is_hidden(skeleton, separation, mesh, tree, charts[i].bone, static_cast<int>(t));
    });
    double unseen = 0, area = 0;
    for (std::size_t t = 0; t < hidden.size(); ++t) {
      const double a = area_vector(mesh, mesh.triangles[t]).norm();
      area += a;
      if (hidden[t]) unseen += a;
    }
    if (area > 0) fractions[i] = unseen / area;
  }
  return fractions;
}

SpdCoordinates spd_coordinates(const Skeleton& skeleton, const SeparationPlanes& separation, BoneIndex bone,
                               const Vec3& point) {
  const BoneBasis& basis = separation.bases()[bone];
  const Vec3 offset = point - end_position(skeleton, bone, BoneEnd::kHead);
  const double length = bone_length(skeleton, bone);
  const double z = offset.dot(basis.o), x = (offset - z * basis.o).norm();
  const double turn = separation.turn_of(bone, offset);
  const bool is_head_free = separation.is_free(bone, BoneEnd::kHead),
             is_tail_free = separation.is_free(bone, BoneEnd::kTail);
  if (is_tail_free && z > length) return {u_of({1, portable::atan2(z - length, x)}, is_head_free, is_tail_free), turn};
  if (is_head_free && z < 0) return {u_of({0, portable::atan2(z, x)}, is_head_free, is_tail_free), turn};
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
