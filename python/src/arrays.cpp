// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <cmath>
#include <cstring>

#include "bind.h"

namespace skeletex::python {
namespace {

void require_columns(const py::array& array, py::ssize_t columns, const char* name) {
  if (array.ndim() != 2 || array.shape(1) != columns)
    throw InputError(fmt::format("{}: an array of shape (n, {}) is wanted", name, columns));
}

}  // namespace

std::vector<Vec3> points_of(const Points& points, const char* name) {
  require_columns(points, 3, name);
  std::vector<Vec3> vectors(static_cast<std::size_t>(points.shape(0)));
  static_assert(sizeof(Vec3) == 3 * sizeof(double));
  if (!vectors.empty()) std::memcpy(vectors[0].data(), points.data(), vectors.size() * sizeof(Vec3));
  return vectors;
}

std::vector<Triangle> triangles_of(const Indices& triangles) {
  require_columns(triangles, 3, "triangles");
  std::vector<Triangle> list(static_cast<std::size_t>(triangles.shape(0)));
  if (!list.empty()) std::memcpy(list[0].data(), triangles.data(), list.size() * sizeof(Triangle));
  return list;
}

TriangleMesh mesh_of(const Points& vertices, const Indices& triangles) {
  return {points_of(vertices, "vertices"), triangles_of(triangles)};
}

Points points_array(const std::vector<Vec3>& points) {
  Points array({static_cast<py::ssize_t>(points.size()), py::ssize_t{3}});
  if (!points.empty()) std::memcpy(array.mutable_data(), points[0].data(), points.size() * sizeof(Vec3));
  return array;
}

py::tuple arrays_of(const TriangleMesh& mesh) {
  Indices triangles({static_cast<py::ssize_t>(mesh.triangles.size()), py::ssize_t{3}});
  if (!mesh.triangles.empty())
    std::memcpy(triangles.mutable_data(), mesh.triangles[0].data(), mesh.triangles.size() * sizeof(Triangle));
  return py::make_tuple(points_array(mesh.positions), triangles);
}

Skeleton skeleton_of(const py::tuple& tuple) {
  const auto [node_names, nodes, bone_names, bones, s] =
      tuple.cast<std::tuple<std::vector<std::string>, Points, std::vector<std::string>, Indices, Points>>();
  const std::vector<Vec3> positions = points_of(nodes, "nodes"), directions = points_of(s, "s");
  require_columns(bones, 2, "bones");
  if (node_names.size() != positions.size())
    throw InputError(fmt::format("{} names for {} nodes", node_names.size(), positions.size()));
  if (static_cast<py::ssize_t>(bone_names.size()) != bones.shape(0) || directions.size() != bone_names.size())
    throw InputError(
        fmt::format("{} names and {} directions s for {} bones", bone_names.size(), directions.size(), bones.shape(0)));
  Skeleton skeleton;
  for (std::size_t i = 0; i < positions.size(); ++i) skeleton.nodes.push_back({node_names[i], positions[i]});
  for (std::size_t i = 0; i < directions.size(); ++i) {
    const auto row = static_cast<py::ssize_t>(i);
    Bone bone{bone_names[i], bones.at(row, 0), bones.at(row, 1), {}};
    if (directions[i].allFinite()) bone.s = directions[i];
    skeleton.bones.push_back(std::move(bone));
  }
  return skeleton;
}

py::tuple tuple_of(const Skeleton& skeleton) {
  std::vector<std::string> node_names, bone_names;
  std::vector<Vec3> positions, directions;
  for (const Node& node : skeleton.nodes) {
    node_names.push_back(node.name);
    positions.push_back(skeleton.frame.to_user(node.position));
  }
  Indices bones({static_cast<py::ssize_t>(skeleton.bones.size()), py::ssize_t{2}});
  for (std::size_t i = 0; i < skeleton.bones.size(); ++i) {
    const Bone& bone = skeleton.bones[i];
    const auto row = static_cast<py::ssize_t>(i);
    bone_names.push_back(bone.name);
    bones.mutable_at(row, 0) = bone.head;
    bones.mutable_at(row, 1) = bone.tail;
    directions.push_back(bone.s.value_or(Vec3::Constant(std::nan(""))));
  }
  return py::make_tuple(node_names, points_array(positions), bone_names, bones, points_array(directions));
}

py::list findings_list(const std::vector<Finding>& findings) {
  constexpr const char* kSeverities[] = {"note", "warning", "error"};
  const auto index = [](int i) { return i < 0 ? py::object(py::none()) : py::object(py::int_(i)); };
  py::list list;
  for (const Finding& f : findings) {
    py::object position = py::none();
    if (f.position) position = py::make_tuple(f.position->x(), f.position->y(), f.position->z());
    list.append(py::make_tuple(kSeverities[static_cast<int>(f.severity)], f.rule, f.message, f.remedy, index(f.node),
                               index(f.bone), position));
  }
  return list;
}

nlohmann::json parse_own_json(const std::string& text) { return nlohmann::json::parse(text); }

}  // namespace skeletex::python
