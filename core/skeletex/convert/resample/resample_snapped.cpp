// SPDX-License-Identifier: MIT
#include "skeletex/convert/resample/resample_snapped.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <utility>

#include "skeletex/convert/choose_placing.h"
#include "skeletex/convert/sample/read_texels.h"
#include "skeletex/geometry/parallel.h"
#include "skeletex/model/frame.h"
#include "skeletex/reconstruct/displace.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex {
namespace {

constexpr double kLeastDihedral = 0.004;  // as the encoder's
/// Radians, see second_spreads: vertices of a model's mesh with less lie within a face or on an edge of the original.
constexpr double kLeastSpread = 0.01;

/// New places of old ones, 0 to `last`, and per new one the old one that it reads.
std::vector<double> read_between(int old_last, int last) {
  std::vector<double> read(last + 1);
  const auto place = [&](int old) { return static_cast<int>(std::lround(static_cast<double>(old) * last / old_last)); };
  for (int old = 0; old < old_last; ++old) {
    const int begin = place(old), end = place(old + 1);
    for (int i = begin; i <= end; ++i) read[i] = old + static_cast<double>(i - begin) / (end - begin);
  }
  return read;
}

/// The points of a patch on the regular numbering of its texels, and how its quads are cut.
struct PatchPoints {
  const float *x, *y, *z;  ///< of its first texel
  int width, height;
  const char* is_first_diagonal;  ///< per texel, of the quad to the right of and above it: from the texel itself

  Eigen::Vector3f point(int row, int column) const {
    const std::size_t at = static_cast<std::size_t>(row) * width + (column == width ? 0 : column);
    return {x[at], y[at], z[at]};
  }
  /// On the triangles between the texels.
  Eigen::Vector3f read(double row, double column) const {
    const int r = std::min(static_cast<int>(row), height - 2), c = std::min(static_cast<int>(column), width - 1);
    const auto s = static_cast<float>(column - c), t = static_cast<float>(row - r);
    const Eigen::Vector3f low = point(r, c), right = point(r, c + 1), high = point(r + 1, c + 1),
                          left = point(r + 1, c);
    if (is_first_diagonal[static_cast<std::size_t>(r) * width + c] != 0)
      return s >= t ? low + s * (right - low) + t * (high - right) : low + t * (left - low) + s * (high - left);
    return s + t <= 1 ? low + s * (right - low) + t * (left - low)
                      : high + (1 - s) * (left - high) + (1 - t) * (right - high);
  }
};

/// Per texel of all patches, behind each other, whether the quad to the right of and above it is cut from the texel
/// itself.
std::vector<char> first_diagonals(const PreparedModel& model, const TriangleMesh& mesh) {
  std::vector<char> are_first;
  for (std::size_t bone = 0; bone < model.model.patches.size(); ++bone) {
    const Rectangle& r = model.model.patches[bone].rectangle;
    const std::size_t begin = are_first.size();
    are_first.resize(begin + static_cast<std::size_t>(r.width) * r.height, 1);
    for (int row = 1; row + 2 < r.height; ++row)
      for (int column = 0; column < r.width; ++column) {
        const int vertex = model.lattice.first_inner[bone] + (row - 1) * r.width + column,
                  across = model.lattice.first_inner[bone] + row * r.width + (column + 1) % r.width,
                  quad = model.lattice.first_quad[bone] + (row - 1) * r.width + column;
        const auto has = [&](TriangleIndex triangle, int which) {
          const Triangle& t = mesh.triangles[triangle];
          return std::find(t.begin(), t.end(), which) != t.end();
        };
        are_first[begin + static_cast<std::size_t>(row) * r.width + column] =
            static_cast<char>(has(2 * quad, vertex) && has(2 * quad, across));
      }
  }
  return are_first;
}

/// The points of a seam where v is j / columns.
std::vector<Vec3> points_at_columns(const EndSeam& seam, std::span<const Vec3> positions, int columns) {
  const std::size_t count = seam.turns.size();
  const auto position = [&](std::size_t k) { return positions[seam.ring.vertices[k % count]]; };
  const auto turn = [&](std::size_t k) { return k < count ? seam.turns[k] : seam.turns[0] + 1; };
  std::vector<Vec3> points;
  for (int j = 0; j < columns; ++j) {
    double v = static_cast<double>(j) / columns;
    if (v < turn(0)) v += 1;
    const auto above = std::upper_bound(seam.turns.begin(), seam.turns.end(), v);
    const std::size_t k = static_cast<std::size_t>(above - seam.turns.begin()) - 1;
    const double span = turn(k + 1) - turn(k), share = span > 0 ? std::clamp((v - turn(k)) / span, 0.0, 1.0) : 0;
    points.push_back((1 - share) * position(k) + share * position(k + 1));
  }
  return points;
}

/// Per vertex how far the normals of the triangles around it spread in their second direction: the square root of the
/// middle eigenvalue of their covariance, radians. Along a straight edge, however sharp, they spread in one alone.
std::vector<double> second_spreads(const Chart& chart) {
  struct Moments {
    double area = 0;
    Vec3 first = Vec3::Zero();
    Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
  };
  std::vector<Moments> moments(chart.positions.size());
  for (const auto& [a, b, c] : chart.triangles) {
    const Vec3 across = (chart.positions[b] - chart.positions[a]).cross(chart.positions[c] - chart.positions[a]);
    const double area = across.norm();
    if (!(area > 0)) continue;
    for (Moments* const m : {&moments[a], &moments[b], &moments[c]})
      m->area += area, m->first += across, m->second += across * across.transpose() / area;
  }
  std::vector<double> spreads(moments.size(), 0);
  for (std::size_t i = 0; i < spreads.size(); ++i) {
    const auto& [area, first, second] = moments[i];
    if (!(area > 0)) continue;
    const Vec3 mean = first / area;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(second / area - mean * mean.transpose(),
                                                                Eigen::EigenvaluesOnly);
    spreads[i] = std::sqrt(std::max(0.0, solver.eigenvalues()[1]));
  }
  return spreads;
}

/// The features of a model's mesh. Its vertices lie all over the faces and edges of the original mesh. Those that count
/// are where normals spread in two directions: nearly the vertices of the original. Their strength is that spread.
MapFeatures features_of_model(std::span<const Chart> charts, std::span<const Method> methods) {
  MapFeatures features = find_features(charts, methods, kLeastDihedral);
  for (std::size_t bone = 0; bone < charts.size(); ++bone) {
    const std::vector<double> spreads = second_spreads(charts[bone]);
    std::erase_if(features.vertices[bone], [&](MapFeatures::Vertex& vertex) {
      vertex.strength = spreads[vertex.vertex];
      return vertex.strength < kLeastSpread;
    });
  }
  rank_vertices(features);
  return features;
}

/// Builds the chart of one patch from the mesh's triangles.
class ChartBuilder {
 public:
  ChartBuilder(const PreparedModel& model, const TriangleMesh& mesh, BoneIndex bone) : mesh_(mesh) {
    chart_.bone = bone;
    chart_.topology = model.model.patches[bone].topology;
  }
  void add(VertexIndex vertex, ChartVertex kind, double u, double v) {
    locals_.emplace(vertex, static_cast<int>(chart_.positions.size()));
    chart_.positions.push_back(mesh_.positions[vertex]);
    chart_.kinds.push_back(kind);
    chart_.u.push_back(u), chart_.v.push_back(v - std::floor(v));
  }
  void add(const Triangle& triangle) {
    Triangle local;
    std::array<std::int8_t, 3> turns{0, 0, 0};
    int first = -1;
    for (int k = 0; k < 3; ++k) {
      local[k] = locals_.at(triangle[k]);
      if (is_pole(chart_.kinds[local[k]])) continue;
      if (first < 0)
        first = k;
      else
        turns[k] = static_cast<std::int8_t>(std::lround(chart_.v[local[first]] - chart_.v[local[k]]));
    }
    chart_.triangles.push_back(local), chart_.turns.push_back(turns);
  }
  Chart finish() {
    chart_.half_edges = link_half_edges(chart_.triangles, static_cast<int>(chart_.positions.size()));
    return std::move(chart_);
  }

 private:
  const TriangleMesh& mesh_;
  Chart chart_;
  std::unordered_map<int, int> locals_;
};

/// How many triangles there are between an end and the row next to it.
int count_end_triangles(const SkeletexModel& model, const EndSeam& seam, BoneIndex bone) {
  return model.patches[bone].rectangle.width + static_cast<int>(seam.ring.vertices.size());
}

std::vector<std::array<EndSeam, 2>> end_seams(const PreparedModel& model, std::span<const Vec3> positions) {
  std::vector<std::array<EndSeam, 2>> seams(model.model.patches.size());
  for (BoneIndex bone = 0; bone < static_cast<int>(seams.size()); ++bone)
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail})
      seams[bone][static_cast<int>(end)] = end_seam(model.model, model.separation, model.lattice, positions, bone, end);
  return seams;
}

/// The vertices of a patch at their places in the map.
void add_vertices(const PreparedModel& prepared, BoneIndex bone, const std::array<EndSeam, 2>& seams,
                  ChartBuilder& builder) {
  const Patch& patch = prepared.model.patches[bone];
  const Lattice& lattice = prepared.lattice;
  const int width = patch.rectangle.width;
  for (int row = 1; row + 1 < patch.rectangle.height; ++row)
    for (int column = 0; column < width; ++column)
      builder.add(lattice.first_inner[bone] + (row - 1) * width + column, ChartVertex::kInner, patch.row_u[row],
                  static_cast<double>(column) / width);
  for (const int end : {0, 1}) {
    if (lattice.poles[bone][end] >= 0)
      builder.add(lattice.poles[bone][end], end == 0 ? ChartVertex::kHeadPole : ChartVertex::kTailPole, end, 0);
    for (std::size_t k = 0; k < seams[end].turns.size(); ++k)
      builder.add(seams[end].ring.vertices[k], end == 0 ? ChartVertex::kHeadRow : ChartVertex::kTailRow, end,
                  seams[end].turns[k]);
  }
}

}  // namespace

bool is_finer(const SkeletexModel& model, const std::vector<Patch>& patches) {
  for (std::size_t bone = 0; bone < patches.size(); ++bone) {
    const Rectangle &old = model.patches[bone].rectangle, &made = patches[bone].rectangle;
    if (made.width < old.width || made.height < old.height) return false;
  }
  return true;
}

std::vector<double> rows_of_finer(const PreparedModel& model, BoneIndex bone, int height) {
  const auto [head_pole, tail_pole] = model.lattice.poles[bone];
  const int old_last = model.model.patches[bone].rectangle.height - 1, head = head_pole < 0, tail = tail_pole < 0;
  std::vector<double> rows = read_between(old_last - head - tail, height - 1 - head - tail);
  for (double& row : rows) row += head;
  if (head > 0) rows.insert(rows.begin(), 0);
  if (tail > 0) rows.push_back(old_last);
  return rows;
}

std::vector<double> columns_of_finer(int old_width, int width) {
  std::vector<double> columns = read_between(old_width, width);
  columns.pop_back();
  return columns;
}

void refine_texels(ClContext& context, const PreparedModel& prepared, SkeletexModel& result) {
  const SkeletexModel& model = prepared.model;
  const TriangleMesh mesh = reconstruct_bind_mesh(context, prepared).mesh;
  const std::vector<char> are_first = first_diagonals(prepared, mesh);
  const std::array<std::vector<float>, 3> old = download_planes(context, points_in_bone_axes(context, prepared));
  std::vector<std::size_t> begins{0}, old_begins{0};
  for (std::size_t bone = 0; bone < model.patches.size(); ++bone) {
    const Rectangle &from = model.patches[bone].rectangle, &to = result.patches[bone].rectangle;
    old_begins.push_back(old_begins.back() + static_cast<std::size_t>(from.width) * from.height);
    begins.push_back(begins.back() + static_cast<std::size_t>(to.width) * to.height);
    std::vector<double>& row_u = result.patches[bone].row_u;
    const std::vector<double>& old_u = model.patches[bone].row_u;
    const std::vector<double> rows = rows_of_finer(prepared, static_cast<int>(bone), to.height);
    for (int r = 0; r < to.height; ++r) {
      const int below = std::min(static_cast<int>(rows[r]), from.height - 2);
      row_u[r] = old_u[below] + (rows[r] - below) * (old_u[below + 1] - old_u[below]);
    }
    row_u.front() = 0, row_u.back() = 1;
  }
  std::array<std::vector<float>, 3> made;
  for (std::vector<float>& plane : made) plane.resize(begins.back());
  for_each_index(model.patches.size(), [&](std::size_t bone) {
    const Rectangle &from = model.patches[bone].rectangle, &to = result.patches[bone].rectangle;
    const std::size_t first = old_begins[bone];
    const PatchPoints points{old[0].data() + first, old[1].data() + first,   old[2].data() + first, from.width,
                             from.height,           are_first.data() + first};
    const std::vector<double> rows = rows_of_finer(prepared, static_cast<int>(bone), to.height),
                              columns = columns_of_finer(from.width, to.width);
    std::size_t at = begins[bone];
    for (int r = 0; r < to.height; ++r)
      for (int c = 0; c < to.width; ++c, ++at) {
        const Eigen::Vector3f point = points.read(rows[r], columns[c]);
        for (int k = 0; k < 3; ++k) made[k][at] = point[k];
      }
  });
  const DeviceTables tables = upload_tables(
      context, in_bone_axes(frame_tables(model.skeleton, prepared.separation, result.patches, model.origin)));
  const auto rows = context.upload(lattice_rows(result.patches, RowChoice::kAll));
  DevicePlanes texels =
      allocate_planes(context, static_cast<std::size_t>(result.texture.width) * result.texture.height);
  context.fill(texels.values, 0.f);
  enter_tangent_space(context, tables, rows, result.texture.width, upload_planes(context, made[0], made[1], made[2]),
                      texels);
  download_texels(context, texels, result.texture);
}

std::vector<Vec3> arc_points(const SkeletexModel& model, const SeparationPlanes& separation, const SeamArc& arc) {
  std::vector<Vec3> points;
  const auto add = [&](BoneIndex bone, const SeamSample& sample) {
    points.push_back(separation.seam_point(bone, end_at(model.skeleton, bone, arc.node), sample.turn, sample.distance));
  };
  const auto add_corner = [&](int corner) { add(model.corners[corner].bones[0], model.corners[corner].sample); };
  if (!arc.is_closed()) add_corner(arc.corners[0]);
  for (const SeamSample& sample : arc.samples) add(arc.bones[0], sample);
  if (!arc.is_closed()) add_corner(arc.corners[1]);
  return points;
}

SeamArc divide_arc(const SkeletexModel& model, const SeparationPlanes& separation, const SeamArc& arc, int parts) {
  const BoneIndex bone = arc.bones[0];
  const BoneEnd end = end_at(model.skeleton, bone, arc.node);
  const Vec3& node = model.skeleton.nodes[arc.node].position;
  const std::vector<Vec3> points = arc_points(model, separation, arc);
  SeamArc divided = arc;
  divided.samples.clear();
  const auto add_between = [&](const Vec3& last, const Vec3& next) {
    for (int part = 1; part < parts; ++part) {
      const Vec3 point = last + static_cast<double>(part) / parts * (next - last);
      divided.samples.push_back(
          {separation.turn_of(bone, point - node), separation.half_line_distance(bone, end, point)});
    }
  };
  const std::size_t first = arc.is_closed() ? 0 : 1;
  for (std::size_t i = 0; i < arc.samples.size(); ++i) {
    add_between(i + first == 0 ? points.back() : points[i + first - 1], points[i + first]);
    divided.samples.push_back(arc.samples[i]);
  }
  if (!arc.is_closed()) add_between(points[points.size() - 2], points.back());
  return divided;
}

std::vector<Chart> charts_of_mesh(const PreparedModel& prepared, const TriangleMesh& mesh) {
  const SkeletexModel& model = prepared.model;
  const std::vector<std::array<EndSeam, 2>> seams = end_seams(prepared, mesh.positions);
  std::vector<int> first_ends{2 * prepared.lattice.quad_count};
  for (std::size_t bone = 0; bone < seams.size(); ++bone)
    for (const EndSeam& seam : seams[bone])
      first_ends.push_back(first_ends.back() + count_end_triangles(model, seam, static_cast<int>(bone)));
  std::vector<Chart> charts(model.patches.size());
  for_each_index(charts.size(), [&](std::size_t bone) {
    const Rectangle& rectangle = model.patches[bone].rectangle;
    ChartBuilder builder(prepared, mesh, static_cast<int>(bone));
    add_vertices(prepared, static_cast<int>(bone), seams[bone], builder);
    const int first = 2 * prepared.lattice.first_quad[bone];
    for (TriangleIndex triangle = first; triangle < first + 2 * rectangle.width * (rectangle.height - 3); ++triangle)
      builder.add(mesh.triangles[triangle]);
    for (TriangleIndex triangle = first_ends[2 * bone]; triangle < first_ends[2 * bone + 2]; ++triangle)
      builder.add(mesh.triangles[triangle]);
    charts[bone] = builder.finish();
  });
  return charts;
}

void snap_again(ClContext& context, const PreparedModel& prepared, const TriangleMesh& mesh,
                std::span<const Chart> charts, SkeletexModel& result) {
  const SkeletexModel& model = prepared.model;
  const TriangleTree tree = build_triangle_tree(mesh);
  std::vector<Method> methods;
  std::vector<SpdHits> hits(charts.size());
  for (std::size_t bone = 0; bone < charts.size(); ++bone) {
    methods.push_back(result.patches[bone].method);
    if (is_height_field(methods[bone]))
      hits[bone] = cast_spd_rays(context, model.skeleton, prepared.separation, charts.subspan(bone, 1),
                                 std::span(result.patches).subspan(bone, 1), SpdHit::kLast)[0];
  }
  result.diagonals = model.diagonals;
  const PreparedModel made(result);
  std::vector<Vec3> positions(made.lattice.vertex_count);
  place_seams(result, made.separation, made.lattice, positions);
  const std::vector<std::array<EndSeam, 2>> seams = end_seams(made, positions);
  std::vector<std::array<std::vector<Vec3>, 2>> end_points(charts.size());
  for (std::size_t bone = 0; bone < charts.size(); ++bone)
    for (const int end : {0, 1}) {
      const int pole = prepared.lattice.poles[bone][end];
      if (pole >= 0)
        end_points[bone][end] = {mesh.positions[pole]};
      else
        end_points[bone][end] = points_at_columns(seams[bone][end], positions, result.patches[bone].rectangle.width);
    }
  // There is no time to save here, and what counts is the mesh that the model has been made of, not its triangles.
  const std::size_t texels = static_cast<std::size_t>(result.texture.width) * result.texture.height;
  const TexelPlacing placing = choose_placing(texels, texels, model.sampling.is_snapped, std::nullopt);
  std::optional<DeviceSnapTables> features;
  if (placing.has_snap)
    features = upload_tables(
        context, tables_of(place_features(features_of_model(charts, methods), charts, result.patches), result.patches));
  const RevertSources revert{result, mesh, tree, charts};
  TexelResult read = read_texels(context, model.skeleton, prepared.separation,
                                 {charts, result.patches, hits, end_points, &revert, features ? &*features : nullptr},
                                 result.texture.width, result.texture.height, model.origin,
                                 {.has_prefilter = model.sampling.is_prefiltered, .fit_steps = placing.fit_steps});
  result.texture = std::move(read.texture);
  result.sampling.is_snapped = placing.has_snap, result.sampling.is_fitted = placing.is_fitted();
}

}  // namespace skeletex
