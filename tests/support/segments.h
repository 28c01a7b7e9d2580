// SPDX-License-Identifier: MIT
#pragma once
#include <random>
#include <vector>

#include "skeletex/model/segment.h"
#include "skeletex/skeleton/separation_planes.h"

/// Segments made by hand, with the bone along z (s = x, b = y) from (0, 0, 0) to (0, 0, 1) and neighbours in line with
/// it, so that separation planes are the planes z = 0 and z = 1. Later stages need no segmentation to be tested on
/// them.
namespace skeletex::testing {

struct MadeSegment {
  Skeleton skeleton;
  Segment segment;
  int bone() const { return segment.bone; }
};

/// A surface of revolution's profile; r == 0 at the first or last point closes that end.
struct ProfilePoint {
  double r, z;
};

struct RevolveOptions {
  int columns = 16;
  double twist_turns = 0;  ///< how far the columns wind around the bone from the first to the last point
  double noise = 0;        ///< radial noise, relative to r; not on the rows at z = 0 and z = 1
  bool has_random_diagonals = false;
  unsigned seed = 1;
};
MadeSegment revolve(const std::vector<ProfilePoint>& profile, const RevolveOptions& options = {});

/// An open tube of radius 1 and length 1.
std::vector<ProfilePoint> cylinder_profile(int rows);
/// A tube whose separation plane folds back like a mushroom's hat: no height field over the bone.
std::vector<ProfilePoint> mushroom_profile(int rows);
/// A tube with a hemispherical cap around the tail.
std::vector<ProfilePoint> cap_profile(int rows);
/// A capsule around a lone bone.
std::vector<ProfilePoint> capsule_profile(int rows);

/// Puts `count` vertices into randomly chosen triangles (degree 3, slivers after a while).
void insert_random_vertices(Segment& segment, int count, std::mt19937& random);
/// Splits edges opposite a vertex until it has `degree` triangles.
void raise_degree(Segment& segment, int vertex, int degree);
/// Flips up to `count` random inner edges where both triangles stay proper.
void flip_random_edges(Segment& segment, int count, std::mt19937& random);
/// Turns, scales and moves segment and skeleton together.
void transform(MadeSegment& made, const Eigen::Matrix3d& rotation, double scale, const Vec3& offset);
/// Renumbers vertices and triangles at random. Returns new_index[old_index] of the vertices.
std::vector<int> renumber(Segment& segment, std::mt19937& random);

}  // namespace skeletex::testing
