// SPDX-License-Identifier: MIT
#include "skeletex/convert/snap/vertex_distances.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>

#include "skeletex/convert/snap/snap.h"
#include "skeletex/geometry/point_triangle.h"

namespace skeletex {
namespace {

constexpr int kVertexReach =
    6;  // columns and rows around a texel: diagonals depend on it, vertices are measured to their quads (guard.cl)
constexpr int kEndsInBox = 32;  // triangles of strips and fans that a vertex is compared to at once

}  // namespace

PlacedVertices place_vertices(std::span<const Chart> charts, std::span<const Patch> patches, int texture_width,
                              int texture_height) {
  std::vector<PlacedVertex> placed;
  PlacedVertices by_line;
  by_line.first_of_line.assign(texture_height + 1, 0);
  int first_point = 0;  // as in DeviceMaps
  for (int bone = 0; bone < static_cast<int>(charts.size()); ++bone) {
    if (patches[bone].method != Method::kVsm) continue;
    const Chart& chart = charts[bone];
    const Rectangle& r = patches[bone].rectangle;
    const std::vector<double> rows = rows_of(patches[bone].row_u, chart.u);
    for (int i = 0; i < static_cast<int>(chart.positions.size()); ++i) {
      if (chart.kinds[i] != ChartVertex::kInner) continue;
      const auto x = static_cast<float>(chart.v[i] * r.width), y = static_cast<float>(rows[i]);
      const int column = static_cast<int>(std::floor(x)),
                line = r.y + std::clamp(static_cast<int>(std::floor(y)), 1, r.height - 3);
      placed.push_back({bone, first_point + i, x, y, line * texture_width + r.x + wrapped(column, r.width)});
      ++by_line.first_of_line[line + 1];
    }
    first_point += static_cast<int>(chart.positions.size());
  }
  std::partial_sum(by_line.first_of_line.begin(), by_line.first_of_line.end(), by_line.first_of_line.begin());
  by_line.all.resize(placed.size());
  std::vector<int> next = by_line.first_of_line;
  for (const PlacedVertex& vertex : placed) by_line.all[next[vertex.texel / texture_width]++] = vertex;
  return by_line;
}

VertexDistances::VertexDistances(const SkeletexModel& model, std::span<const Chart> charts, const DeviceLayout& layout,
                                 const DeviceMaps& maps, const PlacedVertices& placed)
    : model_(model), charts_(charts), layout_(layout), maps_(maps), placed_(placed) {}

void VertexDistances::list(std::span<const int> vertex_points, std::vector<int> anchors) {
  anchors_ = std::move(anchors);
  is_held_.assign(maps_.x.size, 0);
  for (const int anchor : anchors_)
    if (anchor > 0) is_held_[vertex_points[anchor - 1]] = 1;
  vertices_.resize(placed_.all.size());
  are_near_.assign(layout_.size(), 0), are_lines_near_.assign(layout_.height, 0);
  asked_.clear();
  for (std::size_t i = 0; i < placed_.all.size(); ++i)
    if (is_held_[placed_.all[i].point] == 0) asked_.push_back(static_cast<int>(i));
}

void VertexDistances::list(std::span<const int> vertex_points, const LatticeMesh& lattice,
                           const std::vector<int>& back) {
  for (const int texel : back) {
    if (anchors_[texel] > 0) is_held_[vertex_points[anchors_[texel] - 1]] = 0;
    anchors_[texel] = 0;
    add_around(lattice, texel);
  }
  asked_.clear();
  for (int line = 0; line < layout_.height; ++line) {
    if (std::exchange(are_lines_near_[line], 0) == 0) continue;
    for (int i = placed_.first_of_line[line]; i < placed_.first_of_line[line + 1]; ++i) {
      if (are_near_[placed_.all[i].texel] == 0) continue;
      vertices_[i].is_far = false;
      if (is_held_[placed_.all[i].point] == 0) asked_.push_back(i);
    }
    std::fill_n(are_near_.begin() + static_cast<std::ptrdiff_t>(line) * layout_.width, layout_.width, 0);
  }
  std::erase_if(far_, [&](int i) { return !vertices_[i].is_far; });
}

void VertexDistances::start(ClContext& context, const LatticeMesh& lattice, float limit) {
  if (asked_.empty()) return;
  std::vector<int> points, patches;
  std::vector<float> places;
  for (const int i : asked_) {
    const PlacedVertex& vertex = placed_.all[i];
    points.push_back(vertex.point), patches.push_back(vertex.patch);
    places.push_back(vertex.x), places.push_back(vertex.y);
  }
  device_distances_ = context.allocate<float>(points.size()), device_nearest_ = context.allocate<int>(points.size());
  context.launch({"guard.cl", "measure_vertices"}, ClRange({points.size(), 1}, {64, 1}),
                 static_cast<int>(points.size()), layout_.width, limit * limit, context.upload(points),
                 context.upload(patches), context.upload(places), layout_.patches, lattice.device_diagonals(), maps_.x,
                 maps_.y, maps_.z, lattice.device_points().x, lattice.device_points().y, lattice.device_points().z,
                 device_distances_, device_nearest_);
}

std::vector<int> VertexDistances::take_far(ClContext& context, const LatticeMesh& lattice,
                                           const std::vector<int>& changed, float limit) {
  if (!asked_.empty()) {
    const auto [distances2, nearest] = context.download(device_distances_, device_nearest_);
    for (std::size_t k = 0; k < asked_.size(); ++k) {
      vertices_[asked_[k]] = {distances2[k], nearest[k], distances2[k] > limit * limit};
      if (vertices_[asked_[k]].is_far) far_.push_back(asked_[k]);
    }
  }
  return triangles_at_far(lattice, changed, limit);
}

std::vector<int> VertexDistances::triangles_at_far(const LatticeMesh& lattice, const std::vector<int>& changed,
                                                   float limit) {
  std::vector<int> far;
  std::vector<int> at_ends;
  for (const int i : far_) {
    const PlacedVertex& vertex = placed_.all[i];
    if (vertex.y < 2 || vertex.y > static_cast<float>(model_.patches[vertex.patch].rectangle.height - 3)) {
      at_ends.push_back(i);
    } else {
      far.push_back(vertices_[i].nearest);
    }
  }
  // Where these are not what they were, all are compared to them again.
  const bool have_ends_moved = std::any_of(changed.begin(), changed.end(),
                                           [&](int triangle) { return triangle >= lattice.first_end_triangle(); });
  // Strips and fans can be nearer: nearly always their own, those across the seam else.
  std::erase_if(at_ends, [&](int i) { return vertices_[i].is_compared && !have_ends_moved; });
  compare_to_ends(lattice, at_ends, limit);
  for (const int i : far_)
    if (vertices_[i].is_compared && vertices_[i].nearer >= 0) far.push_back(vertices_[i].nearer);
  return far;
}

/// Boxes tell which are too far away: nearly all. Most vertices need those of their own end alone.
void VertexDistances::compare_to_ends(const LatticeMesh& lattice, const std::vector<int>& asked, float limit) {
  if (asked.empty()) return;
  struct Box {
    Eigen::Array4f least, greatest;
  };
  const auto box_of = [&](const Triangle& t) {
    const Eigen::Array4f a = lattice.point(t[0]), b = lattice.point(t[1]), c = lattice.point(t[2]);
    return Box{a.min(b).min(c), a.max(b).max(c)};
  };
  const int first_end = lattice.first_end_triangle(), all = lattice.triangle_count();
  std::vector<std::optional<Box>> boxes((all - first_end + kEndsInBox - 1) / kEndsInBox);
  const auto box_with = [&](int triangle) -> const Box& {
    const int number = (triangle - first_end) / kEndsInBox, first = first_end + number * kEndsInBox;
    if (!boxes[number]) {
      Box around = box_of(lattice.triangle(first));
      for (int i = first + 1; i < std::min(first + kEndsInBox, all); ++i) {
        const Box box = box_of(lattice.triangle(i));
        around = {around.least.min(box.least), around.greatest.max(box.greatest)};
      }
      boxes[number] = around;
    }
    return *boxes[number];
  };
  const auto margin = static_cast<float>(1e-6 * model_.diagonal);  // more than rounding
  for (const int asked_vertex : asked) {
    MeasuredVertex& measured = vertices_[asked_vertex];
    const PlacedVertex& vertex = placed_.all[asked_vertex];
    const Vec3& point = charts_[vertex.patch].positions[vertex.point - maps_.first_vertex[vertex.patch]];
    Eigen::Array4f place = Eigen::Array4f::Zero();
    place.head<3>() = (point - model_.origin).cast<float>().array();
    double least2 = measured.distance2;
    measured.is_compared = true, measured.nearer = measured.nearest;
    const auto is_too_far = [&](const Box& box) {
      const Eigen::Array4f gap = (box.least - place).max(place - box.greatest).max(margin) - margin;
      return static_cast<double>((gap * gap).sum()) > least2;
    };
    const auto [begin, end] = lattice.triangles_of_end(vertex.patch, vertex.y < 2 ? BoneEnd::kHead : BoneEnd::kTail);
    for (const auto& [first, last] : {std::pair(begin, end), std::pair(first_end, all)}) {
      for (int i = first; i < last; ++i) {
        if (is_too_far(box_with(i))) {
          i += kEndsInBox - 1 - (i - first_end) % kEndsInBox;
          continue;
        }
        const Triangle triangle = lattice.triangle(i);
        if (is_too_far(box_of(triangle))) continue;
        const auto [a, b, c] = lattice.corners(triangle);
        const double distance2 = offset_from_triangle(point, a, b, c).squaredNorm();
        if (distance2 < least2) least2 = distance2, measured.nearer = i;
      }
      if (least2 <= static_cast<double>(limit) * limit) measured.nearer = -1;
      if (measured.nearer < 0) break;
    }
  }
}

/// Texels whose vertices can be measured to a triangle that changes with one.
void VertexDistances::add_around(const LatticeMesh& lattice, int texel) {
  const Rectangle& r = lattice.model().patches[lattice.patch_of(texel)].rectangle;
  const int row = texel / layout_.width - r.y, column = texel % layout_.width - r.x;
  for (int i = std::max(1, row - kVertexReach); i <= std::min(r.height - 3, row + kVertexReach); ++i) {
    are_lines_near_[r.y + i] = 1;
    const auto line = are_near_.begin() + (r.y + i) * static_cast<std::ptrdiff_t>(layout_.width) + r.x;
    if (column >= kVertexReach && column + kVertexReach < r.width)
      std::fill_n(line + column - kVertexReach, 2 * kVertexReach + 1, 1);
    else
      for (int j = column - kVertexReach; j <= column + kVertexReach; ++j) line[wrapped(j, r.width)] = 1;
  }
}

}  // namespace skeletex
