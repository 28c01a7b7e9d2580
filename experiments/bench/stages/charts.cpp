// SPDX-License-Identifier: MIT
#include "charts.h"

#include "skeletex/convert/segment/segment_mesh.h"

namespace skeletex {

ChartSet charts_of(ClContext& context, const MeshInput& input) {
  const SeparationPlanes separation(input.skeleton);
  ChartSet set;
  for (const Segment& segment : segment_mesh(context, input.mesh, input.skeleton).segments) {
    set.charts.push_back(make_chart(segment, input.skeleton, separation));
    set.areas.push_back(surface_area(segment.mesh));
  }
  return set;
}

}  // namespace skeletex
