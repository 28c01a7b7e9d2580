// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/levels.h"

#include <algorithm>

#include "skeletex/model/error.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex {

std::vector<SkeletexModel> make_levels(ClContext& context, const SkeletexModel& model, int smallest) {
  std::vector<SkeletexModel> levels{model};
  for (int size = std::max(model.texture.width, model.texture.height) / 2; size >= std::max(4, smallest); size /= 2) {
    try {
      levels.push_back(resample_model(context, model, size));
    } catch (const InputError&) {
      break;  // too small for the number of bones
    }
  }
  return levels;
}

}  // namespace skeletex
