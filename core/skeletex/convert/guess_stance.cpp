// SPDX-License-Identifier: MIT
#include "skeletex/convert/guess_stance.h"

#include <Eigen/Geometry>
#include <cctype>
#include <map>
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
  if (left.dot(stance.up.cross(stance.front)) < -0.5 * left.norm()) stance.front = -stance.front;
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
