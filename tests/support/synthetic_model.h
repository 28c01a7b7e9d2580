// SPDX-License-Identifier: MIT
#pragma once
#include <utility>
#include <vector>

#include "skeletex/model/frame.h"
#include "skeletex/model/texture.h"

namespace skeletex {

/// A closed surface around a skeleton in closed form, and models that sample it: no mesh, no cutting, no map. At every
/// end that meets others the surface lies at a distance from the node that depends on the direction alone, so that the
/// bones there agree; in between it swells and leans smoothly.
class SyntheticSurface {
 public:
  /// \param radius  distance of the surface from the bones, world units
  /// \param relief  0: as plain as can be, a capsule around a lone bone; 1: bumps of a tenth of the radius
  SyntheticSurface(Skeleton skeleton, double radius, double relief = 1);
  SyntheticSurface(const SyntheticSurface&) = delete;
  SyntheticSurface& operator=(const SyntheticSurface&) = delete;

  const Skeleton& skeleton() const { return skeleton_; }
  const SeparationPlanes& separation() const { return separation_; }
  /// The surface point at map coordinates (u, turn) of a bone.
  Vec3 point(int bone, double u, double turn) const;
  /// The seam point in a unit direction from a node.
  Vec3 seam_point(int node, const Vec3& direction) const;
  int genus() const;  ///< of a connected skeleton

  /// A model with one rectangle of the given width and height per bone, stacked in shelves; seams get about as many
  /// samples as the wider of their patches has columns, spread evenly in the angle.
  SkeletexModel model(const std::vector<std::pair<int, int>>& sizes) const;

 private:
  double seam_radius(int node, const Vec3& direction) const;
  Skeleton skeleton_;
  double radius_, relief_;
  SeparationPlanes separation_;
};

/// Skeletons by name. All without "s": it is carried.
Skeleton lone_bone();
Skeleton chain(int bones);          ///< bent by some degrees at every node
Skeleton y_branch();                ///< three bones at one node: two corners
Skeleton cross(int arms);           ///< arms in general position at one node
Skeleton ring(int bones);           ///< cyclic: a torus
Skeleton ring_with_arm(int bones);  ///< cyclic with a branch node
/// A random tree whose bones turn away from each other, as far as the seed allows.
Skeleton random_tree(int bones, unsigned seed);

struct NamedSkeleton {
  const char* name;
  Skeleton skeleton;
  double radius;  ///< of a surface around it that its separation planes cut well
};
/// Some of each kind.
std::vector<NamedSkeleton> all_skeletons();

/// Rectangle sizes between `smallest` and `largest`, both ways.
std::vector<std::pair<int, int>> random_sizes(int count, int smallest, int largest, unsigned seed);

}  // namespace skeletex
