// SPDX-License-Identifier: MIT
#include "skeletex/convert/guess_stance.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "skeletex/model/error.h"

namespace skeletex {
namespace {

/// The words of a bone's name in lower case: "left_arm.001", "Arm_L" and "LeftArm" have two or three.
std::vector<std::string> words_of(std::string_view name) {
  std::vector<std::string> words{""};
  bool was_lower = false;
  for (const char character : name) {
    const auto c = static_cast<unsigned char>(character);
    if ((std::isalnum(c) == 0 || (was_lower && std::isupper(c) != 0)) && !words.back().empty()) words.emplace_back();
    if (std::isalnum(c) != 0) words.back() += static_cast<char>(std::tolower(c));
    was_lower = std::islower(c) != 0;
  }
  return words;
}

/// Where the bones that are called left lie, seen from those that are called right; zero where none are.
Vec3 named_left(const Skeleton& skeleton) {
  std::map<std::vector<std::string>, Vec3> left, right;  // the middle of a bone, by its name without the side
  for (const Bone& bone : skeleton.bones) {
    std::vector<std::string> words = words_of(bone.name);
    const bool is_left = std::erase(words, "left") + std::erase(words, "l") > 0;
    const bool is_right = std::erase(words, "right") + std::erase(words, "r") > 0;
    if (is_left == is_right) continue;
    const Vec3 middle = (skeleton.nodes[bone.head].position + skeleton.nodes[bone.tail].position) / 2;
    (is_left ? left : right).emplace(std::move(words), middle);
  }
  Vec3 sum = Vec3::Zero();
  for (const auto& [words, middle] : left)
    if (const auto other = right.find(words); other != right.end()) sum += middle - other->second;
  return sum;
}

/// Shares of the height.
struct Slice {
  double from, to;
};

/// The centroid of the part of a surface in a slice, by the middles of its triangles; none where there is no such part.
std::optional<Vec3> centroid(const TriangleMesh& mesh, const Vec3& up, double lowest, double height, Slice slice) {
  Vec3 sum = Vec3::Zero();
  double area = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    const Vec3 &p = mesh.positions[a], &q = mesh.positions[b], &r = mesh.positions[c], middle = (p + q + r) / 3;
    const double share = (middle.dot(up) - lowest) / height, own = (q - p).cross(r - p).norm();
    if (share < slice.from || share >= slice.to) continue;
    sum += own * middle;
    area += own;
  }
  return area > 0 ? std::optional<Vec3>(sum / area) : std::nullopt;
}

/// Whether the shape says that a body looks the other way. Feet stick out in front of ankles, where a body is upright;
/// one that is longer has its head in front, which is the highest part.
bool looks_back(const TriangleMesh& mesh, const Stance& stance) {
  constexpr double kUpright = 0.9, kFeet = 0.035, kHead = 0.2;
  constexpr Slice kSoles{0, 0.04}, kAnkles{0.07, 0.14}, kTop{0.88, 1.01}, kWhole{0, 1.01};
  const BoundingBox box = bounding_box(mesh);
  const double height = std::abs((box.upper - box.lower).dot(stance.up));
  const double length = std::abs((box.upper - box.lower).dot(stance.front));
  const double lowest = std::min(box.lower.dot(stance.up), box.upper.dot(stance.up));
  const auto offset = [&](Slice part, Slice from) {
    const std::optional<Vec3> there = centroid(mesh, stance.up, lowest, height, part),
                              here = centroid(mesh, stance.up, lowest, height, from);
    return there && here ? (*there - *here).dot(stance.front) : 0;
  };
  if (length < kUpright * height) return offset(kSoles, kAnkles) < -kFeet * height;
  return length > height && offset(kTop, kWhole) < -kHead * length;
}

/// Which way up a body is that is seen from z, or -y where up is z.
Stance guess_upright(const TriangleMesh& mesh, const Skeleton& skeleton) {
  constexpr double kTall = 1.5, kLowest = 0.2;  // of the height along y, of that along z
  const BoundingBox box = bounding_box(mesh);
  const Vec3 size = box.upper - box.lower;
  if (!(size.z() > kTall * size.y())) return {};
  int feet = 0;
  const auto bones = bones_at_nodes(skeleton);
  for (std::size_t node = 0; node < bones.size(); ++node)
    feet += bones[node].size() == 1 && skeleton.nodes[node].position.z() < box.lower.z() + kLowest * size.z();
  return feet >= 2 ? Stance{Vec3::UnitZ(), -Vec3::UnitY()} : Stance{};
}

}  // namespace

Stance guess_stance(const TriangleMesh& mesh, const Skeleton& skeleton) {
  Stance stance = guess_upright(mesh, skeleton);
  const Vec3 left = named_left(skeleton);
  const double seen = left.dot(stance.up.cross(stance.front));
  if (std::abs(seen) > 0.5 * left.norm() ? seen < 0 : looks_back(mesh, stance)) stance.front = -stance.front;
  return stance;
}

Stance make_stance(const Vec3& up, const std::optional<Vec3>& given) {
  const Vec3 above = up.stableNormalized();
  const Vec3 front =
      given ? given->stableNormalized() : (std::abs(above.z()) < 0.9 ? Vec3(Vec3::UnitZ()) : Vec3(-Vec3::UnitY()));
  const Vec3 across = front - front.dot(above) * above;
  if (!(above.norm() > 0.5 && across.norm() > 1e-6))
    throw InputError("up and front must be two directions that differ, such as y and z");
  return {above, across.normalized()};
}

}  // namespace skeletex
