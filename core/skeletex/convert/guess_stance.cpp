// SPDX-License-Identifier: MIT
#include "skeletex/convert/guess_stance.h"

#include "skeletex/model/error.h"

namespace skeletex {

Stance guess_stance(const TriangleMesh& mesh, const Skeleton& skeleton) {
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
