// SPDX-License-Identifier: MIT
// Poses of a skeleton of three bones.
#include "fuzz.h"
#include "skeletex/io/json_file.h"
#include "skeletex/io/pose_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace skeletex;
  static const Skeleton skeleton{
      {{"hip", Vec3(0, 0, 0)}, {"knee", Vec3(0, 0, 1)}, {"foot", Vec3(0, 0.2, 2)}, {"toe", Vec3(0, 1, 2)}},
      {{"thigh", 0, 1, {}}, {"shin", 1, 2, {}}, {"sole", 2, 3, {}}}};
  return fuzz::read_or_refuse([&] {
    const PoseAnimation animation =
        animation_from_json(parse_json(fuzz::text_of(data, size), "input"), skeleton, "input");
    animation_from_json(parse_json(animation_to_json(animation, skeleton).dump(), "again"), skeleton, "again");
  });
}
