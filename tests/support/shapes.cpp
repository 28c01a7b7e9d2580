// SPDX-License-Identifier: MIT
#include "support/shapes.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <set>
#include <stdexcept>
#include <unordered_map>

namespace skeletex {
namespace {

constexpr double kPi = std::numbers::pi;

int add_node(Skeleton& skeleton, const std::string& name, const Vec3& position) {
  skeleton.nodes.push_back({name, position});
  return static_cast<int>(skeleton.nodes.size()) - 1;
}

void add_bone(Skeleton& skeleton, const std::string& name, int head, int tail) {
  skeleton.bones.push_back({name, head, tail, std::nullopt});
}

/// Surface of revolution about z of a profile (radius, z) from the lower pole to the upper one, whose radii are 0.
TriangleMesh revolved(const std::vector<std::array<double, 2>>& profile, int around) {
  TriangleMesh mesh;
  const int rings = static_cast<int>(profile.size()) - 2;
  mesh.positions.push_back({0, 0, profile.front()[1]});
  for (int i = 1; i <= rings; ++i)
    for (int j = 0; j < around; ++j) {
      const double angle = 2 * kPi * j / around;
      mesh.positions.push_back({profile[i][0] * std::cos(angle), profile[i][0] * std::sin(angle), profile[i][1]});
    }
  mesh.positions.push_back({0, 0, profile.back()[1]});
  const auto at = [&](int ring, int j) { return 1 + ring * around + j % around; };
  const int top = static_cast<int>(mesh.positions.size()) - 1;
  for (int j = 0; j < around; ++j) mesh.triangles.push_back({0, at(0, j + 1), at(0, j)});
  for (int i = 0; i + 1 < rings; ++i)
    for (int j = 0; j < around; ++j) {
      mesh.triangles.push_back({at(i, j), at(i, j + 1), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i + 1, j)});
    }
  for (int j = 0; j < around; ++j) mesh.triangles.push_back({at(rings - 1, j), at(rings - 1, j + 1), top});
  return mesh;
}

/// Signed distance (nearly: exact for equal radii) to the thickened skeleton; negative inside.
class Thickness {
 public:
  Thickness(const Skeleton& skeleton, const std::vector<double>& radii, double blend) : blend_(blend) {
    for (const Bone& bone : skeleton.bones)
      cones_.push_back(
          {skeleton.nodes[bone.head].position, skeleton.nodes[bone.tail].position, radii[bone.head], radii[bone.tail]});
  }
  double operator()(const Vec3& x) const {
    double result = 1e30;
    for (const Cone& cone : cones_) {
      const Vec3 axis = cone.b - cone.a;
      const double t = std::clamp((x - cone.a).dot(axis) / axis.squaredNorm(), 0.0, 1.0);
      const double distance = (x - cone.a - t * axis).norm() - ((1 - t) * cone.radius_a + t * cone.radius_b);
      // Polynomial smooth minimum.
      const double h = std::max(blend_ - std::abs(result - distance), 0.0);
      result = std::min(result, distance) - h * h / (4 * blend_);
    }
    return result;
  }
  Vec3 gradient(const Vec3& x) const {
    constexpr double kStep = 1e-5;
    Vec3 g;
    for (int i = 0; i < 3; ++i)
      g[i] = ((*this)(x + kStep * Vec3::Unit(i)) - (*this)(x - kStep * Vec3::Unit(i))) / (2 * kStep);
    return g;
  }

 private:
  struct Cone {
    Vec3 a, b;
    double radius_a, radius_b;
  };
  std::vector<Cone> cones_;
  double blend_;
};

/// Marching tetrahedra on the body-centred cubic lattice: its points are the corners and the centres of cubic cells; a
/// tetrahedron is an edge of the face between two cells together with the two centres.
class Marcher {
 public:
  Marcher(const Thickness& f, const Vec3& lower, const std::array<int, 3>& cells, double cell) : cells_(cells) {
    const auto [nx, ny, nz] = cells;
    centres_begin_ = (nx + 1) * (ny + 1) * (nz + 1);
    points_.resize(static_cast<std::size_t>(centres_begin_ + nx * ny * nz));
    for (int k = 0; k <= nz; ++k)
      for (int j = 0; j <= ny; ++j)
        for (int i = 0; i <= nx; ++i) {
          points_[corner({i, j, k})] = lower + cell * Vec3(i, j, k);
          if (i < nx && j < ny && k < nz) points_[centre({i, j, k})] = lower + cell * Vec3(i + 0.5, j + 0.5, k + 0.5);
        }
    for (const Vec3& p : points_) values_.push_back(f(p));
    for (int k = 0; k < nz; ++k)
      for (int j = 0; j < ny; ++j)
        for (int i = 0; i < nx; ++i)
          for (int axis = 0; axis < 3; ++axis) march_face({i, j, k}, axis);
  }
  TriangleMesh mesh;

 private:
  using Cell = std::array<int, 3>;
  int corner(const Cell& c) const { return c[0] + (cells_[0] + 1) * (c[1] + (cells_[1] + 1) * c[2]); }
  int centre(const Cell& c) const { return centres_begin_ + c[0] + cells_[0] * (c[1] + cells_[1] * c[2]); }

  void march_face(const Cell& upper, int axis) {
    Cell lower = upper;
    if (--lower[axis] < 0) return;  // outside everywhere at the rim
    Cell c[4] = {upper, upper, upper, upper};
    const int a = (axis + 1) % 3, b = (axis + 2) % 3;
    ++c[1][a];
    ++c[2][a], ++c[2][b];
    ++c[3][b];
    for (int e = 0; e < 4; ++e) march({centre(lower), centre(upper), corner(c[e]), corner(c[(e + 1) % 4])});
  }

  void march(const std::array<int, 4>& tetrahedron) {
    std::vector<int> in, out;
    for (const int p : tetrahedron) (values_[p] < 0 ? in : out).push_back(p);
    if (in.empty() || out.empty()) return;
    std::vector<int> polygon;
    if (in.size() == 2)
      polygon = {cut(in[0], out[0]), cut(in[0], out[1]), cut(in[1], out[1]), cut(in[1], out[0])};
    else
      for (const int p : in)
        for (const int q : out) polygon.push_back(cut(p, q));
    Vec3 outwards = Vec3::Zero();
    for (const int p : in) outwards -= points_[p] / static_cast<double>(in.size());
    for (const int q : out) outwards += points_[q] / static_cast<double>(out.size());
    const auto& x = mesh.positions;
    const Vec3 normal = (x[polygon[1]] - x[polygon[0]]).cross(x[polygon[2]] - x[polygon[0]]);
    if (normal.dot(outwards) < 0) std::reverse(polygon.begin(), polygon.end());
    for (std::size_t i = 2; i < polygon.size(); ++i) mesh.triangles.push_back({polygon[0], polygon[i - 1], polygon[i]});
  }

  int cut(int p, int q) {
    const auto [low, high] = std::minmax(p, q);
    const auto [found, is_new] =
        cuts_.try_emplace(static_cast<std::int64_t>(low) << 32 | high, static_cast<int>(mesh.positions.size()));
    if (is_new) {
      // Away from the lattice points, so that no two vertices fall together.
      const double t = std::clamp(values_[low] / (values_[low] - values_[high]), 0.1, 0.9);
      mesh.positions.push_back((1 - t) * points_[low] + t * points_[high]);
    }
    return found->second;
  }

  std::array<int, 3> cells_;
  int centres_begin_ = 0;
  std::vector<Vec3> points_;
  std::vector<double> values_;
  std::unordered_map<std::int64_t, int> cuts_;
};

void even_out(TriangleMesh& mesh, const Thickness& f, int steps) {
  std::vector<std::set<int>> neighbours(mesh.positions.size());
  for (const Triangle& t : mesh.triangles)
    for (int i = 0; i < 3; ++i) {
      neighbours[t[i]].insert(t[(i + 1) % 3]);
      neighbours[t[i]].insert(t[(i + 2) % 3]);
    }
  for (int step = 0; step < steps; ++step) {
    std::vector<Vec3> moved = mesh.positions;
    for (std::size_t i = 0; i < moved.size(); ++i) {
      Vec3 mean = Vec3::Zero();
      for (const int j : neighbours[i]) mean += mesh.positions[j];
      moved[i] = 0.5 * (moved[i] + mean / static_cast<double>(neighbours[i].size()));
      for (int newton = 0; newton < 2; ++newton) {
        const Vec3 g = f.gradient(moved[i]);
        moved[i] -= f(moved[i]) / g.squaredNorm() * g;
      }
    }
    mesh.positions = std::move(moved);
  }
}

/// Corner cutting, end points kept.
std::vector<std::array<double, 2>> rounded(std::vector<std::array<double, 2>> line, int steps) {
  for (int step = 0; step < steps; ++step) {
    std::vector<std::array<double, 2>> next{line.front()};
    for (std::size_t i = 0; i + 1 < line.size(); ++i) {
      const auto mix = [&](double t) {
        return std::array<double, 2>{(1 - t) * line[i][0] + t * line[i + 1][0],
                                     (1 - t) * line[i][1] + t * line[i + 1][1]};
      };
      if (i > 0) next.push_back(mix(0.25));
      if (i + 2 < line.size()) next.push_back(mix(0.75));
    }
    next.push_back(line.back());
    line = std::move(next);
  }
  return line;
}

Shape thick(Skeleton skeleton, const std::vector<double>& radii, double blend, double cell) {
  TriangleMesh mesh = thickened(skeleton, radii, blend, cell);
  return {std::move(mesh), std::move(skeleton)};
}

}  // namespace

TriangleMesh thickened(const Skeleton& skeleton, const std::vector<double>& radii, double blend, double cell) {
  const Thickness f(skeleton, radii, blend);
  // The union bulges by less than its blend at creases; two more cells keep the rim outside.
  const double margin = *std::max_element(radii.begin(), radii.end()) + blend + 2 * cell;
  BoundingBox box{skeleton.nodes[0].position, skeleton.nodes[0].position};
  for (const Node& node : skeleton.nodes) {
    box.lower = box.lower.cwiseMin(node.position);
    box.upper = box.upper.cwiseMax(node.position);
  }
  std::array<int, 3> cells;
  for (int i = 0; i < 3; ++i) cells[i] = static_cast<int>(std::ceil((box.upper[i] - box.lower[i] + 2 * margin) / cell));
  const Vec3 lower = box.centre() - 0.5 * cell * Vec3(cells[0], cells[1], cells[2]);
  Marcher marcher(f, lower, cells, cell);
  even_out(marcher.mesh, f, 4);
  return std::move(marcher.mesh);
}

Shape capsule_shape(double length, double radius, int around, int rings) {
  std::vector<std::array<double, 2>> profile;
  // The meridian by its length: quarter circle, straight, quarter circle.
  const double arc = 0.5 * kPi * radius, total = 2 * arc + length;
  for (int i = 0; i <= rings + 1; ++i) {
    const double at = total * i / (rings + 1);
    const double z = 0.5 * length;
    if (at < arc)
      profile.push_back({radius * std::sin(at / radius), -z - radius * std::cos(at / radius)});
    else if (at > arc + length)
      profile.push_back({radius * std::sin((total - at) / radius), z + radius * std::cos((total - at) / radius)});
    else
      profile.push_back({radius, at - arc - z});
  }
  Skeleton skeleton;
  add_bone(skeleton, "bone", add_node(skeleton, "low", {0, 0, -0.5 * length}),
           add_node(skeleton, "high", {0, 0, 0.5 * length}));
  return {revolved(profile, around), std::move(skeleton)};
}

Shape chain_shape(int bones, double bend_rad, double cell) {
  constexpr double kLength = 1.5;
  Skeleton skeleton;
  Vec3 at = Vec3::Zero();
  add_node(skeleton, "n0", at);
  for (int i = 0; i < bones; ++i) {
    at += kLength * Vec3(std::cos(i * bend_rad), 0, std::sin(i * bend_rad));
    add_bone(skeleton, "b" + std::to_string(i), i, add_node(skeleton, "n" + std::to_string(i + 1), at));
  }
  return thick(std::move(skeleton), std::vector<double>(static_cast<std::size_t>(bones) + 1, 0.5), 0.1, cell);
}

Shape y_shape(double cell) {
  Skeleton skeleton;
  const int node = add_node(skeleton, "fork", Vec3::Zero());
  const int stem = add_node(skeleton, "stem", {0, -2.2, 0});
  const int left = add_node(skeleton, "left", {-1.5, 1.2, 0});
  const int right = add_node(skeleton, "right", {1.3, 1.5, 0});
  add_bone(skeleton, "stem", stem, node);
  add_bone(skeleton, "left", node, left);
  add_bone(skeleton, "right", node, right);
  return thick(std::move(skeleton), {0.55, 0.45, 0.4, 0.4}, 0.3, cell);
}

Shape x_shape(double cell) {
  Skeleton skeleton;
  const int node = add_node(skeleton, "cross", Vec3::Zero());
  const int east = add_node(skeleton, "east", {2, 0, 0});
  const int north = add_node(skeleton, "north", {0, 2, 0});
  const int west = add_node(skeleton, "west", {-2, 0, 0});
  const int south = add_node(skeleton, "south", {0, -2, 0});
  add_bone(skeleton, "east", node, east);
  add_bone(skeleton, "north", north, node);
  add_bone(skeleton, "west", node, west);
  add_bone(skeleton, "south", south, node);
  return thick(std::move(skeleton), {0.5, 0.5, 0.5, 0.5, 0.5}, 0.3, cell);
}

Shape creature_shape(double cell) {
  Skeleton skeleton;
  std::vector<double> radii;
  const auto node = [&](const std::string& name, double x, double y, double z, double radius) {
    radii.push_back(radius);
    return add_node(skeleton, name, {x, y, z});
  };
  const int hips = node("hips", 0, 0, 0, 0.55), chest = node("chest", 3, 0, 0.1, 0.6);
  const int neck = node("neck", 4.1, 0, 1.0, 0.35), snout = node("snout", 5.3, 0, 1.1, 0.35);
  const int tail = node("tail", -1.5, 0, 0.3, 0.25), tip = node("tip", -2.6, 0, 0.9, 0.2);
  add_bone(skeleton, "body", hips, chest);
  add_bone(skeleton, "neck", chest, neck);
  add_bone(skeleton, "head", neck, snout);
  add_bone(skeleton, "tail", hips, tail);
  add_bone(skeleton, "tip", tail, tip);
  for (const auto& [name, side] : {std::pair{"left", 1.0}, std::pair{"right", -1.0}}) {
    const std::string prefix = name;
    const int elbow = node(prefix + "_elbow", 3.2, side * 1.0, -1.0, 0.3),
              hand = node(prefix + "_hand", 3.3, side * 1.1, -2.3, 0.25);
    const int knee = node(prefix + "_knee", -0.1, side * 1.0, -1.0, 0.32),
              foot = node(prefix + "_foot", -0.2, side * 1.1, -2.3, 0.25);
    add_bone(skeleton, prefix + "_arm", chest, elbow);
    add_bone(skeleton, prefix + "_forearm", elbow, hand);
    add_bone(skeleton, prefix + "_thigh", hips, knee);
    add_bone(skeleton, prefix + "_shin", knee, foot);
  }
  return thick(std::move(skeleton), radii, 0.25, cell);
}

Shape torus_shape(int bones, double core_radius, double tube_radius, int along, int around) {
  Shape shape;
  for (int i = 0; i < along; ++i)
    for (int j = 0; j < around; ++j) {
      const double phi = 2 * kPi * i / along, theta = 2 * kPi * j / around;
      const double r = core_radius + tube_radius * std::cos(theta);
      shape.mesh.positions.push_back({r * std::cos(phi), r * std::sin(phi), tube_radius * std::sin(theta)});
    }
  const auto at = [&](int i, int j) { return (i % along) * around + j % around; };
  for (int i = 0; i < along; ++i)
    for (int j = 0; j < around; ++j) {
      shape.mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      shape.mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  // Nodes off the rows of vertices, so that a separation plane through vertices is not the only case.
  for (int i = 0; i < bones; ++i) {
    const double phi = 2 * kPi * (i + 0.13) / bones;
    add_node(shape.skeleton, "n" + std::to_string(i), {core_radius * std::cos(phi), core_radius * std::sin(phi), 0});
  }
  for (int i = 0; i < bones; ++i) add_bone(shape.skeleton, "b" + std::to_string(i), i, (i + 1) % bones);
  return shape;
}

Shape theta_shape(double cell) {
  Skeleton skeleton;
  const int west = add_node(skeleton, "west", {-2, 0, 0}), east = add_node(skeleton, "east", {2, 0, 0});
  const int north = add_node(skeleton, "north", {0, 2, 0}), south = add_node(skeleton, "south", {0, -2, 0});
  add_bone(skeleton, "middle", west, east);
  add_bone(skeleton, "north_west", west, north);
  add_bone(skeleton, "north_east", north, east);
  add_bone(skeleton, "south_west", south, west);
  add_bone(skeleton, "south_east", south, east);
  return thick(std::move(skeleton), {0.45, 0.45, 0.4, 0.4}, 0.2, cell);
}

Shape mushroom_shape(int around) {
  const std::vector<std::array<double, 2>> profile{
      {0, -1},    {0.9, -1}, {1, 0}, {1, 1},   {1, 2}, {1, 3}, {1, 4}, {1, 5},  {1.2, 5.2}, {1.8, 4.2}, {2.3, 3.6},
      {2.8, 3.8}, {2.7, 5},  {2, 6}, {1, 6.2}, {1, 7}, {1, 8}, {1, 9}, {1, 10}, {0.9, 11},  {0, 11}};
  Shape shape{revolved(rounded(profile, 2), around), {}};
  for (const double z : {0.0, 2.5, 7.5, 10.0})
    add_node(shape.skeleton, "z" + std::to_string(shape.skeleton.nodes.size()), {0, 0, z});
  add_bone(shape.skeleton, "foot", 0, 1);
  add_bone(shape.skeleton, "brim", 1, 2);
  add_bone(shape.skeleton, "top", 2, 3);
  return shape;
}

std::vector<NamedShape> all_shapes() {
  return {{"capsule", 0, capsule_shape()},
          {"chain", 0, chain_shape()},
          {"y", 0, y_shape()},
          {"x", 0, x_shape()},
          {"creature", 0, creature_shape()},
          {"torus", 1, torus_shape()},
          {"theta", 2, theta_shape()},
          {"mushroom", 0, mushroom_shape()}};
}

Similarity random_similarity(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const auto uniform = [&](double lower, double upper) {
    return lower + (upper - lower) * static_cast<double>(random() >> 11) * 0x1p-53;
  };
  const double a = uniform(0, 1), b = uniform(0, 2 * kPi), c = uniform(0, 2 * kPi);  // a uniform unit quaternion
  const Eigen::Quaterniond q(std::sqrt(a) * std::cos(c), std::sqrt(1 - a) * std::sin(b), std::sqrt(1 - a) * std::cos(b),
                             std::sqrt(a) * std::sin(c));
  Similarity map;
  map.rotation = q.normalized().toRotationMatrix();
  map.scale = std::exp(uniform(-std::log(5), std::log(5)));
  for (int i = 0; i < 3; ++i) map.translation[i] = uniform(-10, 10) / std::sqrt(3.0);
  return map;
}

TriangleMesh transformed(const TriangleMesh& mesh, const Similarity& map) {
  TriangleMesh result = mesh;
  for (Vec3& p : result.positions) p = map(p);
  return result;
}

Skeleton transformed(const Skeleton& skeleton, const Similarity& map) {
  Skeleton result = skeleton;
  for (Node& node : result.nodes) node.position = map(node.position);
  for (Bone& bone : result.bones)
    if (bone.s) bone.s = map.rotation * *bone.s;
  return result;
}

Shape transformed(const Shape& shape, const Similarity& map) {
  return {transformed(shape.mesh, map), transformed(shape.skeleton, map)};
}

std::vector<int> random_permutation(int count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<int> result(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) result[i] = i;
  for (int i = count - 1; i > 0; --i) std::swap(result[i], result[random() % static_cast<std::uint64_t>(i + 1)]);
  return result;
}

namespace {

template <typename T>
std::vector<T> reordered(const std::vector<T>& values, const std::vector<int>& permutation) {
  if (values.size() != permutation.size()) throw std::invalid_argument("a permutation of another size");
  std::vector<T> result(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) result[permutation[i]] = values[i];
  return result;
}

}  // namespace

TriangleMesh with_vertices_renumbered(const TriangleMesh& mesh, const std::vector<int>& permutation) {
  TriangleMesh result{reordered(mesh.positions, permutation), mesh.triangles};
  for (Triangle& triangle : result.triangles)
    for (int& corner : triangle) corner = permutation[corner];
  return result;
}

TriangleMesh with_triangles_renumbered(const TriangleMesh& mesh, const std::vector<int>& permutation) {
  return {mesh.positions, reordered(mesh.triangles, permutation)};
}

Skeleton with_bones_renumbered(const Skeleton& skeleton, const std::vector<int>& permutation) {
  return {skeleton.nodes, reordered(skeleton.bones, permutation)};
}

Skeleton with_nodes_renumbered(const Skeleton& skeleton, const std::vector<int>& permutation) {
  Skeleton result{reordered(skeleton.nodes, permutation), skeleton.bones};
  for (Bone& bone : result.bones) {
    bone.head = permutation[bone.head];
    bone.tail = permutation[bone.tail];
  }
  return result;
}

TriangleMesh inside_out(const TriangleMesh& mesh) {
  TriangleMesh result = mesh;
  for (Triangle& t : result.triangles) std::swap(t[1], t[2]);
  return result;
}

}  // namespace skeletex
