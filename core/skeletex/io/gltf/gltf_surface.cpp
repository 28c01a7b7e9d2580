// SPDX-License-Identifier: MIT
#include "skeletex/io/gltf/gltf_surface.h"

#include <fmt/format.h>

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "skeletex/io/gltf/read_gltf.h"
#include "skeletex/io/gltf/weld.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

using Eigen::Affine3d;

/// Vertices nearer to each other are one; diagonals.
constexpr double kWeldTolerance = 1e-5;
/// Poses that differ by less are the same; of the size of what is posed.
constexpr double kSamePose = 1e-3;

Affine3d affine(const Eigen::Matrix4d& matrix) {
  Affine3d result = Affine3d::Identity();
  result.matrix().topRows<3>() = matrix.topRows<3>();
  return result;
}

Affine3d local_transform(const GltfNode& node) {
  if (node.matrix) return affine(*node.matrix);
  return Eigen::Translation3d(node.translation) * node.rotation * Eigen::Scaling(node.scale);
}

/// The proper rotation by quarter turns about the axes that is nearest to a linear map.
Eigen::Matrix3d nearest_quarter_turns(const Eigen::Matrix3d& linear) {
  Eigen::Matrix3d best = Eigen::Matrix3d::Identity();
  double highest = -std::numeric_limits<double>::infinity();
  std::array<int, 3> order{0, 1, 2};
  do {
    for (int signs = 0; signs < 8; ++signs) {
      Eigen::Matrix3d turn = Eigen::Matrix3d::Zero();
      for (int axis = 0; axis < 3; ++axis) turn(order[axis], axis) = signs >> axis & 1 ? -1 : 1;
      if (turn.determinant() < 0) continue;
      // What is equally near is chosen by the order, not by rounding.
      const double agreement = (turn.array() * linear.array()).sum();
      if (agreement > highest + 1e-9) highest = agreement, best = turn;
    }
  } while (std::next_permutation(order.begin(), order.end()));
  return best;
}

class SurfaceBuilder {
 public:
  SurfaceBuilder(const GltfScene& scene, std::string where)
      : scene_(scene), where_(std::move(where)), shown_(node_transforms(scene.nodes)) {
    surface_.rest.assign(scene.nodes.size(), Affine3d::Identity());
    surface_.is_joint.assign(scene.nodes.size(), false);
  }

  GltfSurface build() {
    place_skins();
    for (int node = 0; node < static_cast<int>(scene_.nodes.size()); ++node)
      if (scene_.nodes[node].mesh >= 0) add_mesh(node);
    if (surface_.mesh.triangles.empty()) throw InputError(where_ + ": the scene that the file shows has no triangles");
    surface_.vertices_in_file = static_cast<int>(surface_.mesh.positions.size());
    weld();
    if (surface_.mesh.triangles.empty())
      throw InputError(fmt::format("{}: none of its {} triangles has an area", where_, surface_.degenerate_triangles));
    finish_attributes();
    return std::move(surface_);
  }

 private:
  /// The size of what a skin moves, before it is placed.
  double extent_of(int skin) const {
    std::vector<Vec3> points;
    for (const GltfNode& node : scene_.nodes)
      if (node.skin == skin && node.mesh >= 0)
        for (const GltfPrimitive& primitive : scene_.meshes[node.mesh].primitives)
          points.insert(points.end(), primitive.positions.begin(), primitive.positions.end());
    return bounding_box(points).diagonal();
  }

  /// From the coordinates of a skin's vertices to the scene.
  Affine3d placement_of(const GltfSkin& skin, double extent) const {
    // Where joints of the skin have their place already, the others follow them.
    for (std::size_t j = 0; j < skin.joints.size(); ++j)
      if (surface_.is_joint[skin.joints[j]]) return surface_.rest[skin.joints[j]] * affine(skin.inverse_binds[j]);
    std::vector<int> depths;
    for (const int joint : skin.joints) {
      int depth = 0;
      for (int above = joint; above >= 0; above = scene_.nodes[above].parent) ++depth;
      depths.push_back(depth);
    }
    const std::size_t root = std::min_element(depths.begin(), depths.end()) - depths.begin();
    const auto shown = [&](std::size_t j) { return shown_[skin.joints[j]] * affine(skin.inverse_binds[j]); };
    Affine3d first = shown(root);
    const double size = extent * std::cbrt(std::abs(first.linear().determinant()));
    double difference = 0;
    for (std::size_t j = 0; j < skin.joints.size(); ++j) {
      const Vec3 joint = affine(skin.inverse_binds[j]).inverse().translation();
      difference = std::max({difference, (shown(j).linear() - first.linear()).norm() * extent,
                             (shown(j) * joint - first * joint).norm()});
    }
    if (difference <= kSamePose * size || first.linear().determinant() < 0) return first;
    const double scale = std::cbrt(first.linear().determinant());
    Affine3d placed = Affine3d::Identity();
    placed.linear() = scale * nearest_quarter_turns(first.linear());
    const Vec3 joint = affine(skin.inverse_binds[root]).inverse().translation();
    placed.translation() = first * joint - placed.linear() * joint;
    return placed;
  }

  /// Whether a node is a joint, or is below one.
  bool hangs_on(int node, const GltfSkin& skin) const {
    for (; node >= 0; node = scene_.nodes[node].parent)
      if (std::find(skin.joints.begin(), skin.joints.end(), node) != skin.joints.end()) return true;
    return false;
  }

  void place_skins() {
    for (int s = 0; s < static_cast<int>(scene_.skins.size()); ++s) {
      const GltfSkin& skin = scene_.skins[s];
      const bool moves_vertices = std::any_of(scene_.nodes.begin(), scene_.nodes.end(),
                                              [s](const GltfNode& node) { return node.skin == s && node.mesh >= 0; });
      bool moves_meshes = false;  // whole ones: machines are made so
      for (int node = 0; node < static_cast<int>(scene_.nodes.size()) && !moves_meshes; ++node)
        moves_meshes = scene_.nodes[node].mesh >= 0 && scene_.nodes[node].skin < 0 && hangs_on(node, skin);
      if ((!moves_vertices && !moves_meshes) || skin.joints.empty()) continue;
      const bool has_binds = moves_vertices && !skin.inverse_binds.empty();
      const Affine3d placement = has_binds ? placement_of(skin, extent_of(s)) : Affine3d::Identity();
      for (std::size_t j = 0; j < skin.joints.size(); ++j) {
        const int node = skin.joints[j];
        if (surface_.is_joint[node]) continue;
        surface_.rest[node] = has_binds ? placement * affine(skin.inverse_binds[j]).inverse() : shown_[node];
        surface_.is_joint[node] = true;
      }
      has_skins_ = true;
    }
  }

  int joint_above(int node) const {
    while (node >= 0 && !surface_.is_joint[node]) node = scene_.nodes[node].parent;
    return node;
  }

  void add_mesh(int node) {
    const int skin = scene_.nodes[node].skin;
    const int joint = joint_above(node);
    for (const GltfPrimitive& primitive : scene_.meshes[scene_.nodes[node].mesh].primitives) {
      const bool is_skinned = skin >= 0 && primitive.influences > 0 && !scene_.skins[skin].joints.empty();
      if (!is_skinned && has_skins_ && joint < 0) {
        surface_.notes.push_back(
            fmt::format("mesh \"{}\" hangs on no joint, so it is left out", scene_.nodes[node].name));
        continue;
      }
      const std::size_t first = surface_.mesh.positions.size();
      if (is_skinned) {
        add_skinned(primitive, scene_.skins[skin]);
      } else {
        const Affine3d place = joint < 0 ? shown_[node] : surface_.rest[joint] * shown_[joint].inverse() * shown_[node];
        for (std::size_t v = 0; v < primitive.positions.size(); ++v) {
          add_vertex(primitive, v, place);
          if (joint >= 0) surface_.weights.back().push_back({joint, 1});
        }
      }
      add_triangles(primitive, static_cast<int>(first));
    }
  }

  void add_skinned(const GltfPrimitive& primitive, const GltfSkin& skin) {
    std::vector<Affine3d> places;
    for (std::size_t j = 0; j < skin.joints.size(); ++j)
      places.push_back(surface_.rest[skin.joints[j]] *
                       (skin.inverse_binds.empty() ? Affine3d::Identity() : affine(skin.inverse_binds[j])));
    for (std::size_t v = 0; v < primitive.positions.size(); ++v) {
      std::map<int, float> by_joint;
      float sum = 0;
      for (int i = 0; i < primitive.influences; ++i) {
        const std::size_t at = v * primitive.influences + i;
        if (primitive.weights[at] == 0) continue;
        if (primitive.joints[at] < 0 || primitive.joints[at] >= static_cast<int>(places.size()))
          throw InputError(fmt::format("{}: a vertex is moved by joint {} of skin \"{}\", which has {} joints", where_,
                                       primitive.joints[at], skin.name, places.size()));
        by_joint[primitive.joints[at]] += primitive.weights[at];
        sum += primitive.weights[at];
      }
      if (by_joint.empty()) by_joint[0] = sum = 1;  // not moved by any joint: it goes with the first one
      Affine3d place = Affine3d::Identity();
      place.matrix().topRows<3>().setZero();
      for (const auto& [joint, weight] : by_joint)
        place.matrix().topRows<3>() += static_cast<double>(weight / sum) * places[joint].matrix().topRows<3>();
      add_vertex(primitive, v, place);
      for (const auto& [joint, weight] : by_joint)
        surface_.weights.back().push_back({skin.joints[joint], weight / sum});
    }
  }

  void add_vertex(const GltfPrimitive& primitive, std::size_t v, const Affine3d& place) {
    surface_.mesh.positions.push_back(place * primitive.positions[v]);
    surface_.weights.emplace_back();
    // A mirrored part is inside out: its triangles are turned, and its normals stay on the side that was outside.
    is_mirrored_ = place.linear().determinant() < 0;
    MeshAttributes& to = surface_.attributes;
    const Vec3 normal =
        primitive.normals.empty() ? Vec3::Zero() : Vec3(place.linear().inverse().transpose() * primitive.normals[v]);
    has_normals_ = has_normals_ && normal.norm() > 0 && normal.allFinite();
    to.normals.values.push_back(has_normals_ ? normal.normalized() : Vec3::Zero());
    has_colours_ = has_colours_ || !primitive.colours.empty();
    to.colours.values.push_back(primitive.colours.empty() ? Colour::Ones() : Colour(primitive.colours[v]));
    const bool has_coordinates = !primitive.texture_coordinates.empty();
    const Eigen::Vector2f uv = has_coordinates ? primitive.texture_coordinates[v] : Eigen::Vector2f::Zero();
    to.texture_coordinates.values.emplace_back(uv.x(), 1 - uv.y());
  }

  void add_triangles(const GltfPrimitive& primitive, int first) {
    for (const auto& [a, b, c] : primitive.triangles) {
      const Triangle triangle =
          is_mirrored_ ? Triangle{a + first, c + first, b + first} : Triangle{a + first, b + first, c + first};
      surface_.mesh.triangles.push_back(triangle);
      surface_.attributes.texture_coordinates.corners.push_back(
          primitive.texture_coordinates.empty() ? Triangle{-1, -1, -1} : triangle);
      surface_.attributes.triangle_materials.push_back(primitive.material);
    }
  }

  void weld() {
    const std::vector<int> target =
        weld_targets(surface_.mesh.positions, kWeldTolerance * bounding_box(surface_.mesh).diagonal());
    TriangleMesh welded;
    std::vector<std::vector<JointWeight>> weights;
    std::vector<int> number(target.size(), -1);
    for (std::size_t v = 0; v < target.size(); ++v) {
      if (target[v] == static_cast<int>(v)) {
        number[v] = static_cast<int>(welded.positions.size());
        welded.positions.push_back(surface_.mesh.positions[v]);
        weights.push_back(std::move(surface_.weights[v]));
      }
    }
    MeshAttributes& attributes = surface_.attributes;
    std::vector<Triangle> corners, coordinates;
    std::vector<int> materials;
    for (std::size_t t = 0; t < surface_.mesh.triangles.size(); ++t) {
      Triangle triangle = surface_.mesh.triangles[t];
      for (int& corner : triangle) corner = number[target[corner]];
      if (triangle[0] == triangle[1] || triangle[1] == triangle[2] || triangle[2] == triangle[0]) {
        ++surface_.degenerate_triangles;
        continue;
      }
      welded.triangles.push_back(triangle);
      corners.push_back(surface_.mesh.triangles[t]);
      coordinates.push_back(attributes.texture_coordinates.corners[t]);
      materials.push_back(attributes.triangle_materials[t]);
    }
    attributes.normals.corners = attributes.colours.corners = std::move(corners);
    attributes.texture_coordinates.corners = std::move(coordinates);
    attributes.triangle_materials = std::move(materials);
    surface_.mesh = std::move(welded);
    surface_.weights = std::move(weights);
  }

  void finish_attributes() {
    MeshAttributes& attributes = surface_.attributes;
    if (!has_normals_) attributes.normals = {};
    if (!has_colours_) attributes.colours = {};
    for (const GltfMaterial& from : scene_.materials) {
      Material material;
      material.name = from.name;
      material.base = from.base_colour;
      if (from.image >= 0) material.image = scene_.images[from.image];
      attributes.materials.push_back(std::move(material));
    }
  }

  const GltfScene& scene_;
  std::string where_;
  std::vector<Affine3d> shown_;
  GltfSurface surface_;
  bool has_skins_ = false;
  bool has_normals_ = true, has_colours_ = false;
  bool is_mirrored_ = false;  ///< the part that is added
};

}  // namespace

std::vector<Affine3d> node_transforms(const std::vector<GltfNode>& nodes) {
  std::vector<Affine3d> transforms(nodes.size());
  std::vector<bool> is_done(nodes.size(), false);
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    std::vector<int> way;
    for (int node = static_cast<int>(i); node >= 0 && !is_done[node]; node = nodes[node].parent) way.push_back(node);
    for (auto node = way.rbegin(); node != way.rend(); ++node) {
      const int parent = nodes[*node].parent;
      transforms[*node] = (parent < 0 ? Affine3d::Identity() : transforms[parent]) * local_transform(nodes[*node]);
      is_done[*node] = true;
    }
  }
  return transforms;
}

GltfSurface gltf_surface(const GltfScene& scene, const std::string& where) {
  return SurfaceBuilder(scene, where).build();
}

MeshFile read_gltf_mesh(const std::filesystem::path& path) {
  GltfSurface surface = gltf_surface(read_gltf(path), path.string());
  MeshFile file;
  file.triangles = static_cast<int>(surface.mesh.triangles.size());
  file.faces_in_file = file.triangles + surface.degenerate_triangles;
  file.degenerate_faces = surface.degenerate_triangles;
  file.vertices_in_file = surface.vertices_in_file;
  file.merged_vertices = surface.vertices_in_file - static_cast<int>(surface.mesh.positions.size());
  file.mesh = std::move(surface.mesh);
  file.attributes = std::move(surface.attributes);
  return file;
}

}  // namespace skeletex
