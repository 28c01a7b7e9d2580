// SPDX-License-Identifier: MIT
#include <cstdio>

#include "skeletex/convert/layout/pack_atlas.h"
#include "skeletex/device/context.h"
#include "skeletex/io/skeleton_file.h"
#include "skeletex/skeleton/separation_planes.h"

int main(int, char** arguments) {
  skeletex::ClContext context;
  const skeletex::Skeleton skeleton = skeletex::read_skeleton(arguments[1]);
  const skeletex::SeparationPlanes separation(skeleton);
  const auto atlas = skeletex::pack_atlas(std::vector<skeletex::PatchRequest>(skeleton.bones.size()), 256, 256);
  std::printf("%zu bones, %.0f %% of 256 x 256 texels, on %s\n", separation.bases().size(), 100 * atlas.used_fraction,
              context.device().name.c_str());
}
