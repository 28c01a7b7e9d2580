// SPDX-License-Identifier: MIT
#include "skeletex/convert/resample/levels.h"

#include <algorithm>

#include "skeletex/convert/resample/resample.h"
#include "skeletex/model/error.h"

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
