// SPDX-License-Identifier: MIT
#include "skeletex/edit/morph/landmarks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "skeletex/convert/layers/read_layers.h"
#include "skeletex/convert/layers/surface_points.h"
#include "skeletex/convert/resample/resample_snapped.h"
#include "skeletex/edit/morph/patch_warp.h"
#include "skeletex/edit/morph/surface_map.h"
#include "skeletex/geometry/parallel.h"
#include "skeletex/model/encoder_settings.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex {
namespace {

/// Where a morph from one model to another takes points of the first surface.
/// \param points  in the first model's frame
/// \return in the second model's frame
std::vector<Vec3> mapped_points(ClContext& context, const SkeletexModel& first, const SkeletexModel& second,
                                const Correspondence& first_to_second, std::span<const Vec3> points) {
  const TriangleMesh mesh = reconstruct_bind_mesh(context, PreparedModel(first)).mesh;
  const TriangleTree tree = build_triangle_tree(mesh);
  const std::vector<Vec3> images = map_surface(context, first, second, first_to_second);
  std::vector<Vec3> mapped;
  for (const Vec3& point : points) {
    const TriangleIndex triangle = find_nearest_triangle(mesh, tree, point).triangle;
    const SurfacePoint at = nearest_in_triangle(mesh, triangle, point);
    Vec3 image = Vec3::Zero();
    for (int k = 0; k < 3; ++k) image += at.weights[k] * images[mesh.triangles[triangle][k]];
    mapped.push_back(image);
  }
  return mapped;
}

/// A place on a model's patches, in texels.
struct Place {
  BoneIndex bone;
  Eigen::Vector2d at = Eigen::Vector2d::Zero();  ///< column, row
};

double row_of(const Patch& patch, double u) {
  const auto above = std::upper_bound(patch.row_u.begin() + 1, patch.row_u.end() - 1, u);
  const double low = *(above - 1);
  return static_cast<double>(above - patch.row_u.begin() - 1) + (u - low) / (*above - low);
}

double u_of(const Patch& patch, double row) {
  const int below = std::clamp(static_cast<int>(row), 0, patch.rectangle.height - 2);
  return patch.row_u[below] + (row - below) * (patch.row_u[below + 1] - patch.row_u[below]);
}

/// A point of a chart in the texels of its patch.
Place place_of(const Chart& chart, const Patch& patch, const SurfacePoint& at) {
  double u = 0, v = 0, share_of_v = 0;  // a pole has no v
  for (int k = 0; k < 3; ++k) {
    const VertexIndex vertex = chart.triangles[at.triangle][k];
    u += at.weights[k] * chart.u[vertex];
    if (is_pole(chart.kinds[vertex])) continue;
    v += at.weights[k] * (chart.v[vertex] + chart.turns[at.triangle][k]);
    share_of_v += at.weights[k];
  }
  return {chart.bone,
          {patch.rectangle.width * (share_of_v > 0 ? v / share_of_v : 0), row_of(patch, std::clamp(u, 0.0, 1.0))}};
}

/// The places of the surface that are nearest to points.
std::vector<Place> nearest_places(std::span<const Chart> charts, std::span<const Patch> patches,
                                  std::span<const Vec3> points) {
  std::vector<Place> places(points.size());
  std::vector<double> nearest(points.size(), std::numeric_limits<double>::infinity());
  for (const Chart& chart : charts) {
    const TriangleMesh mesh{chart.positions, chart.triangles};
    const TriangleTree tree = build_triangle_tree(mesh);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const NearestTriangle found = find_nearest_triangle(mesh, tree, points[i], nearest[i]);
      if (found.triangle < 0) continue;
      nearest[i] = found.distance;
      places[i] = place_of(chart, patches[chart.bone], nearest_in_triangle(mesh, found.triangle, points[i]));
    }
  }
  return places;
}

/// Moves the map of a chart.
void warp_chart(const Patch& patch, const PatchWarp& warp, Chart& chart) {
  const int width = patch.rectangle.width;
  std::vector<int> passed(chart.positions.size(), 0);  // turns that the vertex has gone beyond its period
  for_each_index(chart.positions.size(), 256, [&](std::size_t i) {
    if (chart.kinds[i] != ChartVertex::kInner) return;
    const Eigen::Vector2d place(width * chart.v[i], row_of(patch, chart.u[i]));
    const Eigen::Vector2d moved = place + warp.move(place);
    const double v = moved.x() / width;
    passed[i] = static_cast<int>(std::floor(v));
    chart.v[i] = v - passed[i];
    chart.u[i] = u_of(patch, moved.y());
  });
  for (std::size_t t = 0; t < chart.triangles.size(); ++t)
    for (int k = 0; k < 3; ++k)
      chart.turns[t][k] = static_cast<std::int8_t>(chart.turns[t][k] + passed[chart.triangles[t][k]]);
}

/// The moves of each patch of the second model that bring its landmarks to the places where a morph looks for them.
std::vector<std::vector<PlaceMove>> landmark_moves(const SkeletexModel& second, std::span<const Chart> charts,
                                                   std::span<const Vec3> points, std::span<const Vec3> goals,
                                                   std::span<const Landmark> landmarks) {
  const auto name_of = [&](BoneIndex bone) { return second.skeleton.bones[bone].name; };
  const std::vector<Place> all_from = nearest_places(charts, second.patches, points),
                           all_to = nearest_places(charts, second.patches, goals);
  std::vector<std::vector<PlaceMove>> moves(second.patches.size());
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    const std::string& name = landmarks[i].name;
    const Place &from = all_from[i], &to = all_to[i];
    if (from.bone != to.bone)
      throw InputError(
          fmt::format("landmark \"{}\" lies on bone \"{}\" of the second model, but its partner on the first one on "
                      "what becomes \"{}\"; partners must lie on bones that correspond",
                      name, name_of(from.bone), name_of(to.bone)));
    const double last = second.patches[from.bone].rectangle.height - 1;
    for (const double row : {from.at.y(), to.at.y()})
      if (row < 1 || row > last - 1)
        throw InputError(fmt::format(
            "landmark \"{}\" lies at an end of bone \"{}\", where the surface cannot move; choose a point further on",
            name, name_of(from.bone)));
    moves[from.bone].push_back({from.at, to.at});
    for (std::size_t k = 0; k + 1 < moves[from.bone].size(); ++k)
      if ((moves[from.bone][k].from - from.at).norm() < 0.5 || (moves[from.bone][k].to - to.at).norm() < 0.5)
        throw InputError(fmt::format("landmark \"{}\" lies at the place of another one; keep one of the two", name));
  }
  return moves;
}

std::vector<Vec3> points_in_frame(std::span<const Landmark> landmarks, Vec3 Landmark::*side, const UnitFrame& frame) {
  std::vector<Vec3> points;
  for (const Landmark& landmark : landmarks) points.push_back(frame.from_user(landmark.*side));
  return points;
}

}  // namespace

SkeletexModel align_landmarks(ClContext& context, const SkeletexModel& first, SkeletexModel second,
                              const Correspondence& first_to_second, std::span<const Landmark> landmarks) {
  const UnitFrame& frame = first.skeleton.frame;
  second = in_frame(std::move(second), frame);
  const PreparedModel prepared(second);
  const TriangleMesh mesh = reconstruct_bind_mesh(context, prepared).mesh;
  std::vector<Chart> charts = charts_of_mesh(prepared, mesh);
  const std::vector<Vec3> goals =
      mapped_points(context, first, second, first_to_second, points_in_frame(landmarks, &Landmark::first, frame));
  const auto moves =
      landmark_moves(second, charts, points_in_frame(landmarks, &Landmark::second, frame), goals, landmarks);
  SkeletexModel result = second;
  for (std::size_t bone = 0; bone < moves.size(); ++bone) {
    if (moves[bone].empty()) continue;
    Patch& patch = result.patches[bone];
    patch.method = Method::kVsm;  // the rays of a height field read fixed places
    const int flipped = count_flipped(charts[bone]);
    warp_chart(patch, PatchWarp(patch.rectangle.width, patch.rectangle.height, moves[bone]), charts[bone]);
    constexpr double kFlippedShare = 1e-3;
    if (count_flipped(charts[bone]) > flipped + kFlippedShare * static_cast<double>(charts[bone].triangles.size()))
      throw InputError(
          fmt::format("the landmarks on bone \"{}\" cannot be met without folding the surface's map; give fewer, or "
                      "check that their partners are not exchanged",
                      second.skeleton.bones[bone].name));
  }
  snap_again(context, prepared, mesh, charts, result);
  result.layers = read_layers_of(context, second, result);
  record_setting(result, "landmarks", static_cast<int>(landmarks.size()));
  return result;
}

std::vector<double> landmark_distances(ClContext& context, const SkeletexModel& first, const SkeletexModel& second,
                                       const Correspondence& first_to_second, std::span<const Landmark> landmarks) {
  const SkeletexModel other = in_frame(second, first.skeleton.frame);
  const std::vector<Vec3> images = mapped_points(context, first, other, first_to_second,
                                                 points_in_frame(landmarks, &Landmark::first, first.skeleton.frame));
  const std::vector<Vec3> goals = points_in_frame(landmarks, &Landmark::second, first.skeleton.frame);
  std::vector<double> distances;
  for (std::size_t i = 0; i < goals.size(); ++i) distances.push_back((images[i] - goals[i]).norm() / other.diagonal);
  return distances;
}

}  // namespace skeletex
