// SPDX-License-Identifier: MIT
#include "skeletex/edit/morph/surface_map.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "skeletex/edit/morph/blend.h"
#include "skeletex/edit/morph/seam_map.h"
#include "skeletex/model/frame.h"
#include "skeletex/reconstruct/displace.h"
#include "skeletex/reconstruct/lattice.h"

namespace skeletex {
namespace {

/// Points of a model read at the places of another one's texels, as a morph reads texels. World units.
DisplacementTexture read_points(ClContext& context, const SkeletexModel& from, const SeparationPlanes& separation,
                                const SeamMap& map) {
  const SkeletexModel& to = map.model();
  BlendTables tables;
  tables.source_count = 1;
  std::vector<int> begins{0};
  for (const Patch& patch : to.patches)
    begins.push_back(begins.back() + patch.rectangle.width * patch.rectangle.height);
  for (BoneIndex bone = 0; bone < static_cast<int>(from.patches.size()); ++bone) {
    const Rectangle& source = to.patches[map.model_bone(bone)].rectangle;
    tables.sources.push_back({begins[map.model_bone(bone)], source.width, source.width, source.height,
                              static_cast<int>(tables.columns.size()), -1, 1.0f});
    append_columns(map, bone, from.patches[bone].rectangle.width, tables);
  }
  const std::vector<LatticeRow> rows = lattice_rows(from.patches, RowChoice::kAll);
  append_rows(map, rows, from.patches, 1, tables);
  DevicePlanes points = allocate_planes(context, static_cast<std::size_t>(from.texture.width) * from.texture.height);
  blend_texels(context, tables, rows, frame_tables(from.skeleton, separation, from.patches, from.origin),
               from.texture.width, row_points(context, to, RowChoice::kAll), points);
  DisplacementTexture read{from.texture.width, from.texture.height, {}, {}, {}};
  download_texels(context, points, read);
  return read;
}

/// Sets the vertices of the inner rows and the poles.
void set_inner(const SkeletexModel& from, const Lattice& lattice, const DisplacementTexture& points, const Vec3& origin,
               std::vector<Vec3>& positions) {
  for (BoneIndex bone = 0; bone < static_cast<int>(from.patches.size()); ++bone) {
    const auto [x, y, width, height] = from.patches[bone].rectangle;
    const auto point_at = [&, x = x, y = y](int row, int column) {
      const std::size_t at = static_cast<std::size_t>(y + row) * points.width + x + column;
      return Vec3(origin + Vec3(points.along[at], points.around[at], points.out[at]));
    };
    for (int row = 1; row + 1 < height; ++row)
      for (int j = 0; j < width; ++j) positions[lattice.first_inner[bone] + (row - 1) * width + j] = point_at(row, j);
    for (const int end : {0, 1})
      if (lattice.poles[bone][end] >= 0) positions[lattice.poles[bone][end]] = point_at(end == 0 ? 0 : height - 1, 0);
  }
}

}  // namespace

std::vector<Vec3> map_surface(ClContext& context, const SkeletexModel& from, const SkeletexModel& to,
                              const Correspondence& correspondence) {
  const Lattice lattice = number_lattice(from);
  const SeparationPlanes separation(from.skeleton), to_separation(to.skeleton);
  SeamMap map(to, from.skeleton, correspondence), own(from, from.skeleton, identity_correspondence(from.skeleton));
  const SeamNetwork network = seam_network(from.skeleton, separation);
  map.set_network(separation, network);
  own.set_network(separation, network);
  for (BoneIndex bone = 0; bone < static_cast<int>(from.patches.size()); ++bone)
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail})
      map.set_target_loop(bone, end, own.model_loop(bone, end));

  std::vector<Vec3> positions(lattice.vertex_count);
  set_inner(from, lattice, read_points(context, from, separation, map), to.origin, positions);
  // The point of the other seam that is found by the same angle.
  const auto seam_point = [&](BoneIndex bone, NodeIndex node, double turn) {
    const BoneEnd end = end_at(from.skeleton, bone, node);
    const SeamMap::SeamPoint point = map.seam_at(bone, end, turn);
    return to_separation.seam_point(map.model_bone(bone), map.model_end(bone, end),
                                    map.model_turn(bone, end, turn) + map.sign(bone) * point.turn_offset,
                                    point.distance);
  };
  for (int a = 0; a < static_cast<int>(from.arcs.size()); ++a) {
    const SeamArc& arc = from.arcs[a];
    int vertex = lattice.first_sample[a];
    for (const double turn : own.sample_turns(arc.bones[0], end_at(from.skeleton, arc.bones[0], arc.node), a))
      positions[vertex++] = seam_point(arc.bones[0], arc.node, turn);
  }
  for (std::size_t c = 0; c < from.corners.size(); ++c)
    positions[lattice.first_corner + static_cast<int>(c)] =
        seam_point(from.corners[c].bones[0], from.corners[c].node, from.corners[c].sample.turn);
  return positions;
}

Distortion measure_distortion(const TriangleMesh& from, const std::vector<Vec3>& to) {
  const double scale2 = surface_area(from) / surface_area({to, from.triangles});
  const double total = surface_area(from);
  struct Measured {
    double weight, area, angle, dirichlet;
  };
  std::vector<Measured> all;
  Distortion result;
  for (const Triangle& t : from.triangles) {
    // Squared singular values of the affine map are eigenvalues of G^-1 H, G and H the edges' Gram matrices.
    const auto gram = [&](const std::vector<Vec3>& p) {
      const Vec3 e = p[t[1]] - p[t[0]], f = p[t[2]] - p[t[0]];
      return Vec3(e.dot(e), e.dot(f), f.dot(f));
    };
    const Vec3 g = gram(from.positions), h = scale2 * gram(to);
    const double g_det = g[0] * g[2] - g[1] * g[1], h_det = h[0] * h[2] - h[1] * h[1];
    const double before = 0.5 * std::sqrt(std::max(0.0, g_det)), after = 0.5 * std::sqrt(std::max(0.0, h_det));
    const double weight = 0.5 * (before + after) / total;
    if (!(before > 1e-3 * after) || !(after > 1e-3 * before)) {
      result.collapsed += weight;
      continue;
    }
    const double sum = (g[2] * h[0] - 2 * g[1] * h[1] + g[0] * h[2]) / g_det, product = h_det / g_det,
                 stretch = std::sqrt(product);
    all.push_back({weight, std::max(stretch, 1 / stretch), sum / (2 * stretch), (sum + sum / product) / 4});
  }
  double counted = 0;
  result.area = result.angle = result.dirichlet = 0;
  for (const Measured& m : all) {
    counted += m.weight;
    result.area += m.weight * m.area;
    result.angle += m.weight * m.angle;
    result.dirichlet += m.weight * m.dirichlet;
  }
  if (!(counted > 0)) return {};
  result.area /= counted;
  result.angle /= counted;
  result.dirichlet /= counted;
  const auto median = [&](double Measured::*value) {
    std::sort(all.begin(), all.end(), [&](const Measured& p, const Measured& q) { return p.*value < q.*value; });
    double below = 0;
    for (const Measured& m : all)
      if ((below += m.weight) >= counted / 2) return m.*value;
    return all.back().*value;
  };
  result.area_median = median(&Measured::area);
  result.angle_median = median(&Measured::angle);
  result.dirichlet_median = median(&Measured::dirichlet);
  return result;
}

}  // namespace skeletex
