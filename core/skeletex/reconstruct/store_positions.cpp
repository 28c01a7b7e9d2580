// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/store_positions.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "skeletex/geometry/loop_turns.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/displace.h"
#include "skeletex/reconstruct/lattice.h"
#include "skeletex/reconstruct/layers/layer_values.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/reconstruct/seam_strip.h"

namespace skeletex {
namespace {

/// The points of a patch's first or last row: the pole, or where the seam's polyline passes the columns.
std::vector<Vec3> end_row_points(const SkeletexModel& model, const SeparationPlanes& separation, const Lattice& lattice,
                                 BoneIndex bone, BoneEnd end, std::span<const Vec3> positions) {
  const int columns = model.patches[bone].rectangle.width;
  const int pole = lattice.poles[bone][static_cast<int>(end)];
  if (pole >= 0) return std::vector<Vec3>(columns, positions[pole]);
  std::vector<Vec3> points;
  std::vector<double> turns;
  for (const VertexIndex vertex : end_loop(model, lattice, bone, end)) {
    points.push_back(positions[vertex]);
    turns.push_back(separation.turn_of(bone, points.back() - end_position(model.skeleton, bone, end)));
  }
  return points_at_columns(points, seam_turns(points, turns), columns);
}

/// Whether any vertex at a patch's end has moved.
bool has_end_moved(const SkeletexModel& model, const Lattice& lattice, BoneIndex bone, BoneEnd end,
                   std::span<const Vec3> before, std::span<const Vec3> after) {
  const int pole = lattice.poles[bone][static_cast<int>(end)];
  if (pole >= 0) return before[pole] != after[pole];
  const std::vector<int> loop = end_loop(model, lattice, bone, end);
  return std::any_of(loop.begin(), loop.end(), [&](VertexIndex vertex) { return before[vertex] != after[vertex]; });
}

/// \param result  the texels of points that have moved are set
void store_texels(ClContext& context, const PreparedModel& prepared, std::span<const Vec3> before,
                  std::span<const Vec3> after, DisplacementTexture& result) {
  const SkeletexModel& model = prepared.model;
  const SeparationPlanes& separation = prepared.separation;
  const Lattice& lattice = prepared.lattice;
  // All rows of all patches, in each bone's own axes: from H along s, b, o.
  std::array<std::vector<float>, 3> planes;
  std::vector<char> is_stored;
  for (BoneIndex bone = 0; bone < static_cast<int>(model.patches.size()); ++bone) {
    const Rectangle& rectangle = model.patches[bone].rectangle;
    const BoneBasis& basis = separation.bases()[bone];
    const Vec3& head = end_position(model.skeleton, bone, BoneEnd::kHead);
    const auto add = [&](const Vec3& point, bool has_moved) {
      const Vec3 offset = point - head;
      planes[0].push_back(static_cast<float>(offset.dot(basis.s)));
      planes[1].push_back(static_cast<float>(offset.dot(basis.b)));
      planes[2].push_back(static_cast<float>(offset.dot(basis.o)));
      is_stored.push_back(has_moved);
    };
    const auto add_end = [&](BoneEnd end) {
      const bool has_moved = has_end_moved(model, lattice, bone, end, before, after);
      for (const Vec3& point : end_row_points(model, separation, lattice, bone, end, after)) add(point, has_moved);
    };
    add_end(BoneEnd::kHead);
    const int first = lattice.first_inner[bone], last = first + rectangle.width * (rectangle.height - 2);
    for (VertexIndex vertex = first; vertex < last; ++vertex) add(after[vertex], before[vertex] != after[vertex]);
    add_end(BoneEnd::kTail);
  }
  DevicePlanes texels = upload_texels(context, model.texture);
  enter_tangent_space(context, upload_tables(context, prepared.tables), context.upload(prepared.all_rows),
                      model.texture.width, upload_planes(context, planes[0], planes[1], planes[2]), texels);
  const std::array<std::vector<float>, 3> stored = download_planes(context, texels);
  const auto keep_moved = [&](const std::vector<float>& all, std::vector<float>& plane) {
    std::size_t point = 0;
    for (const LatticeRow& row : prepared.all_rows) {
      const Rectangle& rectangle = model.patches[row[0]].rectangle;
      std::size_t texel = static_cast<std::size_t>(rectangle.y + row[1]) * model.texture.width + rectangle.x;
      for (int j = 0; j < rectangle.width; ++j, ++point, ++texel)
        if (is_stored[point]) plane[texel] = all[texel];
    }
  };
  keep_moved(stored[0], result.along);
  keep_moved(stored[1], result.around);
  keep_moved(stored[2], result.out);
}

/// The point in the separation plane through `node` with unit normal `plane_normal` that p comes to by the shortest way
/// in its tangent plane. The way is h / sin of the angle between the two planes; below some 18 degrees it turns towards
/// the separation plane.
Vec3 slide_to_separation_plane(const Vec3& p, const Vec3& normal, const Vec3& node, const Vec3& plane_normal) {
  const double cosine = normal.dot(plane_normal);
  const double share = std::min(1.0, 0.9 / std::max(cosine * cosine, 1e-9));
  return p - plane_normal.dot(p - node) / (1 - share * cosine * cosine) * (plane_normal - share * cosine * normal);
}

/// The point of the ray from `node` in a unit direction that lies in p's tangent plane, where they meet at more than
/// some 18 degrees, else towards the nearest one.
Vec3 slide_to_ray(const Vec3& p, const Vec3& normal, const Vec3& node, const Vec3& ray) {
  const double sine = ray.dot(normal), nearest = std::max(0.0, 0.1 - sine * sine);
  const double distance = (sine * normal.dot(p - node) + nearest * ray.dot(p - node)) / (sine * sine + nearest);
  return node + std::max(0.0, distance) * ray;
}

}  // namespace

SkeletexModel store_positions(ClContext& context, const PreparedModel& prepared, std::span<const Vec3> positions) {
  const SkeletexModel& model = prepared.model;
  const SeparationPlanes& separation = prepared.separation;
  const Lattice& lattice = prepared.lattice;
  if (static_cast<int>(positions.size()) != lattice.vertex_count)
    throw InputError(
        fmt::format("{} positions are given for a model of {} vertices", positions.size(), lattice.vertex_count));
  const auto bad = std::find_if(positions.begin(), positions.end(), [](const Vec3& p) { return !p.allFinite(); });
  if (bad != positions.end())
    throw InputError(fmt::format("the position of vertex {} is not a finite number", bad - positions.begin()));

  const std::vector<Vec3> before = lattice_positions(context, prepared);
  SkeletexModel result = model;
  store_texels(context, prepared, before, positions, result.texture);
  if (!model.layers.empty())
    turn_normal_layer(prepared, reconstruct_bind_mesh(context, prepared).mesh, positions, result);
  for (std::size_t a = 0; a < model.arcs.size(); ++a) {
    const SeamArc& arc = model.arcs[a];
    const BoneIndex bone = arc.bones[0];
    const BoneEnd end = end_at(model.skeleton, bone, arc.node);
    for (std::size_t i = 0; i < arc.samples.size(); ++i) {
      const Vec3& point = positions[lattice.first_sample[a] + i];
      if (point == before[lattice.first_sample[a] + i]) continue;
      SeamSample& sample = result.arcs[a].samples[i];
      sample.distance = separation.half_line_distance(bone, end, point);
      // Beyond its arc it would be restored in another separation plane.
      const double turn = separation.turn_of(bone, point - model.skeleton.nodes[arc.node].position);
      if (separation.neighbour(bone, end, turn) == arc.bones[1]) sample.turn = turn;
    }
  }
  for (std::size_t i = 0; i < model.corners.size(); ++i) {
    const Vec3& point = positions[lattice.first_corner + i];
    const BoneIndex bone = model.corners[i].bones[0];
    if (point != before[lattice.first_corner + i])
      result.corners[i].sample.distance =
          separation.half_line_distance(bone, end_at(model.skeleton, bone, model.corners[i].node), point);
  }
  return result;
}

void slide_to_separation(const PreparedModel& prepared, std::span<const Vec3> normals, std::span<Vec3> positions) {
  const SkeletexModel& model = prepared.model;
  const SeparationPlanes& separation = prepared.separation;
  const Lattice& lattice = prepared.lattice;
  for (std::size_t a = 0; a < model.arcs.size(); ++a) {
    const SeamArc& arc = model.arcs[a];
    const auto away = [&](BoneIndex bone) {
      return direction_from(model.skeleton, {bone, end_at(model.skeleton, bone, arc.node)});
    };
    const Vec3 plane_normal = (away(arc.bones[0]) - away(arc.bones[1])).normalized();
    for (std::size_t i = 0; i < arc.samples.size(); ++i) {
      const std::size_t vertex = lattice.first_sample[a] + i;
      positions[vertex] = slide_to_separation_plane(positions[vertex], normals[vertex],
                                                    model.skeleton.nodes[arc.node].position, plane_normal);
    }
  }
  for (std::size_t i = 0; i < model.corners.size(); ++i) {
    const SeamCorner& corner = model.corners[i];
    const std::size_t vertex = lattice.first_corner + i;
    const Vec3& node = model.skeleton.nodes[corner.node].position;
    const Vec3 ray = (separation.seam_point(corner.bones[0], end_at(model.skeleton, corner.bones[0], corner.node),
                                            corner.sample.turn, 1) -
                      node)
                         .normalized();
    positions[vertex] = slide_to_ray(positions[vertex], normals[vertex], node, ray);
  }
}

}  // namespace skeletex
