// SPDX-License-Identifier: MIT
// Closed shapes with skeletons, made on the spot: small enough for a test, and each with something that is hard.
#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "skeletex/geometry/mesh.h"
#include "skeletex/skeleton/skeleton.h"

namespace skeletex {

struct Shape {
  TriangleMesh mesh;  ///< closed, oriented outwards, 2-manifold, one component
  Skeleton skeleton;
};

/// One lone bone (both ends free, the segment is a sphere) along z in a capsule: a tube with hemispheres, centred at
/// the origin. Points lie on the closed form.
/// \param around vertices around,
/// \param rings rings along tube and caps
Shape capsule_shape(double length = 2, double radius = 0.5, int around = 32, int rings = 24);

/// A chain of bones of length 1.5, each turned against the one before by `bend_rad` about y: linear nodes only, caps at
/// both ends. With bend_rad = 0 straight, so that all separation planes are parallel.
Shape chain_shape(int bones = 3, double bend_rad = 0.5, double cell = 0.16);

/// Three bones of different length at one node, in a plane (the two corners lie opposite each other), one head and two
/// tails at the node. All ends are free.
Shape y_shape(double cell = 0.16);

/// Four coplanar bones at right angles at one node, alternately head and tail there: at each of the two corners four
/// segments meet (exactly co-circular directions).
Shape x_shape(double cell = 0.16);

/// Two nodes of four bones each (body and neck or tail, two legs), limbs of two bones, a head: 13 bones. The skeleton
/// is mirror-symmetric in y = 0, the mesh nearly so.
Shape creature_shape(double cell = 0.13);

/// A torus about z with a ring of bones on its core circle: a cyclic skeleton, no free end, genus 1. Points lie on the
/// closed form.
/// \pre bones >= 3
Shape torus_shape(int bones = 5, double core_radius = 2, double tube_radius = 0.5, int along = 64, int around = 24);

/// Two nodes that three bones join, as the Greek letter theta: branches and cycles in one, genus 2.
Shape theta_shape(double cell = 0.16);

/// A tube about z with a brim that droops like a mushroom's: three bones in a chain, and in the middle one's segment
/// (an annulus) rays from the axis meet the surface three times, so it is no height field.
Shape mushroom_shape(int around = 40);

struct NamedShape {
  std::string name;
  int genus;
  Shape shape;
};
/// All of the above with their defaults.
std::vector<NamedShape> all_shapes();

/// The zero set of a smooth union of round cones, one per bone, from the radius of its head to that of its tail.
/// Polygonized by marching the tetrahedra of a body-centred cubic lattice, which gives a closed, oriented 2-manifold
/// whatever the function; the vertices are then evened out on the surface. Deterministic.
/// \param radii  per node
/// \param blend  how far the union rounds its creases
/// \param cell  size of the lattice
TriangleMesh thickened(const Skeleton& skeleton, const std::vector<double>& radii, double blend, double cell);

/// x -> scale rotation x + translation.
struct Similarity {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  double scale = 1;
  Vec3 translation = Vec3::Zero();
  Vec3 operator()(const Vec3& x) const { return scale * (rotation * x) + translation; }
};
/// Any rotation, a scale in [0.2, 5], a translation of up to 10.
Similarity random_similarity(std::uint64_t seed);
TriangleMesh transformed(const TriangleMesh& mesh, const Similarity& map);
Skeleton transformed(const Skeleton& skeleton, const Similarity& map);
Shape transformed(const Shape& shape, const Similarity& map);

/// The numbers 0 to count-1 in a random order that is the same on every platform.
std::vector<int> random_permutation(int count, std::uint64_t seed);
/// Vertex i becomes vertex permutation[i]; triangles keep order and first corner.
TriangleMesh with_vertices_renumbered(const TriangleMesh& mesh, const std::vector<int>& permutation);
/// Triangle i becomes triangle permutation[i].
TriangleMesh with_triangles_renumbered(const TriangleMesh& mesh, const std::vector<int>& permutation);
/// Bone i becomes bone permutation[i], node i becomes node permutation[i].
Skeleton with_bones_renumbered(const Skeleton& skeleton, const std::vector<int>& permutation);
Skeleton with_nodes_renumbered(const Skeleton& skeleton, const std::vector<int>& permutation);
/// Every triangle the other way round.
TriangleMesh inside_out(const TriangleMesh& mesh);

}  // namespace skeletex
