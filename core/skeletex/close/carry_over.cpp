// SPDX-License-Identifier: MIT
#include "skeletex/close/carry_over.h"

#include <algorithm>
#include <map>

#include "skeletex/convert/layers/read_layers.h"
#include "skeletex/geometry/parallel.h"
#include "skeletex/geometry/union_find.h"

namespace skeletex {
namespace {

constexpr std::size_t kMostDistances = 20'000;

std::vector<BoneWeight> mixed(const TriangleMesh& mesh, const VertexBoneWeights& weights, const SurfacePoint& point) {
  std::map<int, double> by_bone;
  for (int k = 0; k < 3; ++k)
    for (const auto& [bone, weight] : weights[mesh.triangles[point.triangle][k]])
      by_bone[bone] += static_cast<double>(point.weights[k]) * weight;
  std::vector<BoneWeight> result;
  for (const auto& [bone, weight] : by_bone)
    if (weight > 0) result.push_back({bone, weight});
  return result;
}

/// Per triangle, whether its part of the mesh is inside out: a closed one by its volume, an open one by its normals.
std::vector<bool> is_inside_out(const TriangleMesh& mesh, const CornerValues<Vec3>& normals) {
  struct Part {
    bool is_open = false;
    double volume = 0, towards_normals = 0;
  };
  UnionFind vertices = connected_vertices(mesh);
  std::vector<std::pair<int, int>> edges;
  for (const Triangle& t : mesh.triangles)
    for (int k = 0; k < 3; ++k) edges.emplace_back(t[k], t[(k + 1) % 3]);
  std::sort(edges.begin(), edges.end());
  std::map<int, Part> parts;
  const Vec3 origin = bounding_box(mesh).centre();
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const Triangle& t = mesh.triangles[i];
    Part& part = parts[vertices.find(t[0])];
    const Vec3 area = area_vector(mesh, t);
    part.volume += (mesh.positions[t[0]] - origin).dot(area) / 3;
    for (int k = 0; k < 3; ++k) {
      const std::pair twin(t[(k + 1) % 3], t[k]);
      if (!std::binary_search(edges.begin(), edges.end(), twin)) part.is_open = true;
      if (normals.empty()) continue;
      const int corner = normals.of(mesh, i)[k];
      if (corner >= 0) part.towards_normals += normals.values[corner].dot(area);
    }
  }
  std::vector<bool> result;
  for (const Triangle& t : mesh.triangles) {
    const Part& part = parts[vertices.find(t[0])];
    result.push_back((part.is_open ? part.towards_normals : part.volume) < 0);
  }
  return result;
}

/// A mesh with its triangles turned outwards, so that both sides of a thin part can be told apart.
AttributedMesh turned_outwards(AttributedMesh mesh) {
  const std::vector<bool> is_turned = is_inside_out(mesh.mesh, mesh.attributes.normals);
  for (std::size_t t = 0; t < is_turned.size(); ++t)
    if (is_turned[t]) std::swap(mesh.mesh.triangles[t][1], mesh.mesh.triangles[t][2]);
  turn_over(mesh.attributes, is_turned);
  return mesh;
}

}  // namespace

CarriedOver carry_over(const TriangleMesh& from, const TriangleTree& tree, const MeshAttributes& attributes,
                       const VertexBoneWeights& weights, const TriangleMesh& to) {
  const std::size_t count = to.positions.size();
  CarriedOver result;
  const bool has_colours = has_colour(attributes);
  if (has_colours) result.attributes.colours.values.resize(count);
  result.attributes.original =
      attributes.original ? attributes.original
                          : std::make_shared<const AttributedMesh>(turned_outwards({from, attributes, weights}));
  for (const VertexNumbers& numbers : attributes.numbers)
    result.attributes.numbers.push_back({numbers.name, std::vector<float>(count)});
  if (!weights.empty()) result.weights.resize(count);
  const SurfaceColours colours(from, attributes);
  for_each_index(count, 256, [&](std::size_t v) {
    const SurfacePoint point =
        nearest_in_triangle(from, find_nearest_triangle(from, tree, to.positions[v]).triangle, to.positions[v]);
    if (has_colours) result.attributes.colours.values[v] = colours.at(point);
    if (!weights.empty()) result.weights[v] = mixed(from, weights, point);
    for (std::size_t i = 0; i < attributes.numbers.size(); ++i) {
      float sum = 0;
      for (int k = 0; k < 3; ++k)
        sum += point.weights[k] * attributes.numbers[i].values[from.triangles[point.triangle][k]];
      result.attributes.numbers[i].values[v] = sum;
    }
  });
  return result;
}

VertexDistances distances_of_vertices(const TriangleMesh& mesh, const TriangleMesh& to) {
  const TriangleTree tree = build_triangle_tree(to);
  std::vector<bool> is_used(mesh.positions.size(), false);
  for (const Triangle& t : mesh.triangles)
    for (const int corner : t) is_used[corner] = true;
  const std::size_t step = std::max<std::size_t>(1, mesh.positions.size() / kMostDistances);
  std::vector<double> distances(mesh.positions.size() / step + 1, -1);
  for_each_block(distances.size(), 256, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end && i * step < mesh.positions.size(); ++i)
      if (is_used[i * step]) distances[i] = find_nearest_triangle(to, tree, mesh.positions[i * step]).distance;
  });
  std::erase_if(distances, [](double distance) { return distance < 0; });
  VertexDistances result;
  for (const double distance : distances) {
    result.mean += distance / static_cast<double>(distances.size());
    result.largest = std::max(result.largest, distance);
  }
  return result;
}

// One rule for each kind of attribute, in a row.
// NOLINTNEXTLINE(readability-function-cognitive-complexity)
MeshAttributes with_triangles(const MeshAttributes& attributes, std::span<const Triangle> before,
                              std::span<const Triangle> after, std::span<const int> origins) {
  MeshAttributes result = attributes;
  std::map<int, int> triangle_at;  // vertex -> a triangle before, of those that border on new ones
  for (std::size_t t = 0; t < after.size(); ++t)
    if (origins[t] < 0)
      for (const int v : after[t]) triangle_at.emplace(v, -1);
  for (int t = 0; t < static_cast<int>(before.size()); ++t)
    for (const int v : before[t])
      if (const auto found = triangle_at.find(v); found != triangle_at.end()) found->second = t;
  const auto change = [&](std::vector<Triangle>& corners) {
    if (corners.empty()) return;
    const std::vector<Triangle> old = std::move(corners);
    corners.clear();
    for (std::size_t t = 0; t < after.size(); ++t) {
      Triangle own{-1, -1, -1};
      for (int k = 0; k < 3; ++k) {
        const int from = origins[t] >= 0 ? origins[t] : triangle_at.at(after[t][k]);
        if (from < 0) continue;
        for (int i = 0; i < 3; ++i)
          if (before[from][i] == after[t][k]) own[k] = old[from][i];
      }
      corners.push_back(own);
    }
  };
  change(result.normals.corners);
  change(result.colours.corners);
  change(result.texture_coordinates.corners);
  if (attributes.triangle_materials.empty()) return result;
  result.triangle_materials.clear();
  for (std::size_t t = 0; t < after.size(); ++t) {
    const int from = origins[t] >= 0 ? origins[t] : triangle_at.at(after[t][0]);
    result.triangle_materials.push_back(from < 0 ? -1 : attributes.triangle_materials[from]);
  }
  return result;
}

void flip_inward_normals(const TriangleMesh& mesh, std::span<const Triangle> before, std::span<const Triangle> after,
                         std::span<const int> origins, CornerValues<Vec3>& normals) {
  // Validation will turn a mesh that is inside out; then it is the other triangles that run the other way round.
  const bool is_inside_out = signed_volume(mesh) < 0;
  for (std::size_t t = 0; t < normals.corners.size(); ++t) {
    if (origins[t] < 0) continue;
    const Triangle& old = before[origins[t]];
    const auto first = std::find(old.begin(), old.end(), after[t][0]) - old.begin();
    const bool is_turned = old[(first + 1) % 3] != after[t][1];
    if (is_turned == is_inside_out) continue;
    const Vec3 area = area_vector(mesh, mesh.triangles[t]);
    for (int& corner : normals.corners[t]) {
      if (corner < 0 || (normals.values[corner].dot(area) < 0) == is_inside_out) continue;
      normals.values.push_back(-normals.values[corner]);
      corner = static_cast<int>(normals.values.size()) - 1;
    }
  }
}

}  // namespace skeletex
