// SPDX-License-Identifier: MIT
#include "support/segments.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <set>

namespace skeletex::testing {

MadeSegment revolve(const std::vector<ProfilePoint>& profile, const RevolveOptions& options) {
  std::mt19937 random(options.seed);
  std::uniform_real_distribution<double> unit(-1, 1);
  MadeSegment made;
  Segment& segment = made.segment;
  const bool is_head_free = profile.front().r == 0, is_tail_free = profile.back().r == 0;
  Skeleton& skeleton = made.skeleton;
  if (!is_head_free) skeleton.nodes.push_back({"before", Vec3(0, 0, -1)});
  skeleton.nodes.push_back({"head", Vec3(0, 0, 0)});
  skeleton.nodes.push_back({"tail", Vec3(0, 0, 1)});
  if (!is_tail_free) skeleton.nodes.push_back({"after", Vec3(0, 0, 2)});
  for (int i = 0; i + 1 < static_cast<int>(skeleton.nodes.size()); ++i)
    skeleton.bones.push_back({skeleton.nodes[i].name + "-" + skeleton.nodes[i + 1].name, i, i + 1, Vec3(1, 0, 0)});
  segment.bone = is_head_free ? 0 : 1;
  segment.topology = is_head_free && is_tail_free   ? SegmentTopology::kSphere
                     : is_head_free || is_tail_free ? SegmentTopology::kDisk
                                                    : SegmentTopology::kAnnulus;
  const int rows = static_cast<int>(profile.size()), columns = options.columns;
  std::vector<std::vector<int>> grid(rows);
  for (int i = 0; i < rows; ++i) {
    const int count = profile[i].r == 0 ? 1 : columns;
    for (int j = 0; j < count; ++j) {
      const double turn = static_cast<double>(j) / columns + options.twist_turns * i / (rows - 1);
      const bool is_separation_plane = (i == 0 && !is_head_free) || (i == rows - 1 && !is_tail_free);
      const double r = profile[i].r * (1 + (is_separation_plane ? 0 : options.noise * unit(random)));
      const double angle = 2 * std::numbers::pi * turn;
      grid[i].push_back(static_cast<int>(segment.mesh.positions.size()));
      segment.mesh.positions.push_back({r * std::cos(angle), r * std::sin(angle), profile[i].z});
    }
  }
  auto& triangles = segment.mesh.triangles;
  for (int i = 0; i + 1 < rows; ++i)
    for (int j = 0; j < columns; ++j) {
      const int k = (j + 1) % columns;
      if (profile[i].r == 0) {
        triangles.push_back({grid[i][0], grid[i + 1][k], grid[i + 1][j]});
      } else if (profile[i + 1].r == 0) {
        triangles.push_back({grid[i][j], grid[i][k], grid[i + 1][0]});
      } else {
        const int a = grid[i][j], b = grid[i][k], c = grid[i + 1][k], d = grid[i + 1][j];
        if (options.has_random_diagonals && unit(random) > 0) {
          triangles.push_back({a, b, c});
          triangles.push_back({a, c, d});
        } else {
          triangles.push_back({a, b, d});
          triangles.push_back({b, c, d});
        }
      }
    }
  if (!is_head_free) segment.loops[0].vertices = grid.front();
  if (!is_tail_free) segment.loops[1].vertices = grid.back();
  segment.source_vertices.resize(segment.mesh.positions.size());
  std::iota(segment.source_vertices.begin(), segment.source_vertices.end(), 0);
  return made;
}

std::vector<ProfilePoint> cylinder_profile(int rows) {
  std::vector<ProfilePoint> profile;
  for (int i = 0; i < rows; ++i) profile.push_back({1, static_cast<double>(i) / (rows - 1)});
  return profile;
}

std::vector<ProfilePoint> mushroom_profile(int rows) {
  std::vector<ProfilePoint> profile;
  for (int i = 0; i < rows; ++i) {
    const double t = static_cast<double>(i) / (rows - 1), bump = std::sin(std::numbers::pi * t);
    profile.push_back({0.3 + 1.2 * bump * bump, t - 0.35 * std::sin(2 * std::numbers::pi * t)});
  }
  return profile;
}

std::vector<ProfilePoint> cap_profile(int rows) {
  std::vector<ProfilePoint> profile;
  const int tube = rows / 3;
  for (int i = 0; i < tube; ++i) profile.push_back({1, static_cast<double>(i) / tube});
  for (int i = 0; i < rows - tube; ++i) {
    const double latitude = std::numbers::pi / 2 * i / (rows - tube - 1);
    profile.push_back({i + 1 == rows - tube ? 0 : std::cos(latitude), 1 + std::sin(latitude)});
  }
  return profile;
}

std::vector<ProfilePoint> capsule_profile(int rows) {
  const auto cap = cap_profile(rows);
  std::vector<ProfilePoint> profile;
  for (auto it = cap.rbegin(); it != cap.rend(); ++it) profile.push_back({it->r, 1 - it->z});
  profile.insert(profile.end(), cap.begin() + rows / 3 + 1, cap.end());
  // The reversed cap ends at z = 1, where the second one begins.
  return profile;
}

namespace {

void insert_vertex(Segment& segment, int t, const Vec3& barycentric) {
  auto& mesh = segment.mesh;
  const Triangle tri = mesh.triangles[t];
  Vec3 p = Vec3::Zero();
  for (int c = 0; c < 3; ++c) p += barycentric[c] * mesh.positions[tri[c]];
  const int v = static_cast<int>(mesh.positions.size());
  mesh.positions.push_back(p);
  segment.source_vertices.push_back(v);
  mesh.triangles[t] = {tri[0], tri[1], v};
  mesh.triangles.push_back({tri[1], tri[2], v});
  mesh.triangles.push_back({tri[2], tri[0], v});
}

}  // namespace

void insert_random_vertices(Segment& segment, int count, std::mt19937& random) {
  std::uniform_real_distribution<double> unit(0.01, 1);
  for (int i = 0; i < count; ++i) {
    const int t = static_cast<int>(random() % segment.mesh.triangles.size());
    Vec3 w(unit(random), unit(random), unit(random));
    insert_vertex(segment, t, w / w.sum());
  }
}

void raise_degree(Segment& segment, int vertex, int degree) {
  auto& mesh = segment.mesh;
  while (true) {
    // The longest edge opposite the vertex that has a triangle on its other side.
    int around = 0, first = -1, second = -1;
    double longest = 0;
    for (int t = 0; t < static_cast<int>(mesh.triangles.size()); ++t) {
      const Triangle& tri = mesh.triangles[t];
      const auto c = std::find(tri.begin(), tri.end(), vertex) - tri.begin();
      if (c == 3) continue;
      ++around;
      const int a = tri[(c + 1) % 3], b = tri[(c + 2) % 3];
      if ((mesh.positions[a] - mesh.positions[b]).norm() <= longest) continue;
      for (int u = 0; u < static_cast<int>(mesh.triangles.size()); ++u)
        for (int k = 0; k < 3; ++k)
          if (mesh.triangles[u][k] == b && mesh.triangles[u][(k + 1) % 3] == a) {
            longest = (mesh.positions[a] - mesh.positions[b]).norm();
            first = t;
            second = u;
          }
    }
    if (around >= degree) return;
    Triangle tri = mesh.triangles[first], other = mesh.triangles[second];
    std::rotate(tri.begin(), std::find(tri.begin(), tri.end(), vertex), tri.end());
    std::rotate(other.begin(), std::find(other.begin(), other.end(), tri[2]), other.end());
    const int middle = static_cast<int>(mesh.positions.size());
    mesh.positions.push_back(0.5 * (mesh.positions[tri[1]] + mesh.positions[tri[2]]));
    segment.source_vertices.push_back(middle);
    mesh.triangles[first] = {vertex, tri[1], middle};
    mesh.triangles[second] = {tri[2], middle, other[2]};
    mesh.triangles.push_back({vertex, middle, tri[2]});
    mesh.triangles.push_back({middle, tri[1], other[2]});
  }
}

void flip_random_edges(Segment& segment, int count, std::mt19937& random) {
  auto& triangles = segment.mesh.triangles;
  std::set<std::array<int, 2>> edges;
  std::vector<std::vector<int>> at(segment.mesh.positions.size());
  for (int t = 0; t < static_cast<int>(triangles.size()); ++t)
    for (int c = 0; c < 3; ++c) {
      const int a = triangles[t][c], b = triangles[t][(c + 1) % 3];
      edges.insert({std::min(a, b), std::max(a, b)});
      at[triangles[t][c]].push_back(t);
    }
  std::vector<int> degree(segment.mesh.positions.size(), 0);
  for (const auto& e : edges) ++degree[e[0]], ++degree[e[1]];
  for (int i = 0; i < count; ++i) {
    const int t = static_cast<int>(random() % triangles.size()), c = static_cast<int>(random() % 3);
    const int a = triangles[t][c], b = triangles[t][(c + 1) % 3], x = triangles[t][(c + 2) % 3];
    int other = -1, y = -1;
    for (const int u : at[a])
      for (int k = 0; k < 3; ++k)
        if (triangles[u][k] == b && triangles[u][(k + 1) % 3] == a) other = u, y = triangles[u][(k + 2) % 3];
    if (other < 0 || x == y || degree[a] <= 4 || degree[b] <= 4 || edges.contains({std::min(x, y), std::max(x, y)}))
      continue;
    edges.erase({std::min(a, b), std::max(a, b)});
    edges.insert({std::min(x, y), std::max(x, y)});
    --degree[a], --degree[b], ++degree[x], ++degree[y];
    triangles[t] = {a, y, x};
    triangles[other] = {y, b, x};
    std::erase(at[a], other);
    std::erase(at[b], t);
    at[x].push_back(other);
    at[y].push_back(t);
  }
}

void transform(MadeSegment& made, const Eigen::Matrix3d& rotation, double scale, const Vec3& offset) {
  for (Vec3& p : made.segment.mesh.positions) p = scale * (rotation * p) + offset;
  for (Node& node : made.skeleton.nodes) node.position = scale * (rotation * node.position) + offset;
  for (Bone& bone : made.skeleton.bones)
    if (bone.s) bone.s = rotation * *bone.s;
}

std::vector<int> renumber(Segment& segment, std::mt19937& random) {
  const int count = static_cast<int>(segment.mesh.positions.size());
  std::vector<int> new_index(count);
  std::iota(new_index.begin(), new_index.end(), 0);
  std::shuffle(new_index.begin(), new_index.end(), random);
  const Segment old = segment;
  for (int v = 0; v < count; ++v) {
    segment.mesh.positions[new_index[v]] = old.mesh.positions[v];
    segment.source_vertices[new_index[v]] = old.source_vertices[v];
  }
  for (Triangle& t : segment.mesh.triangles) {
    for (int& v : t) v = new_index[v];
    std::rotate(t.begin(), t.begin() + random() % 3, t.end());
  }
  std::shuffle(segment.mesh.triangles.begin(), segment.mesh.triangles.end(), random);
  for (BoundaryLoop& loop : segment.loops) {
    for (int& v : loop.vertices) v = new_index[v];
    if (!loop.vertices.empty())
      std::rotate(loop.vertices.begin(), loop.vertices.begin() + random() % loop.vertices.size(), loop.vertices.end());
  }
  return new_index;
}

}  // namespace skeletex::testing
