// SPDX-License-Identifier: MIT
#include "skeletex/model/texture.h"

namespace skeletex {

const char* to_string(SegmentTopology topology) {
  switch (topology) {
    case SegmentTopology::kAnnulus: return "annulus";
    case SegmentTopology::kDisk: return "disk";
    case SegmentTopology::kSphere: return "sphere";
  }
  return "";
}

}  // namespace skeletex
