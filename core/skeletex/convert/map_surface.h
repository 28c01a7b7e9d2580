// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/convert/layout/patch_requests.h"
#include "skeletex/convert/layout/row_profile.h"
#include "skeletex/convert/parameterize/method.h"

namespace skeletex {

/// The surface by bones, and its maps.
struct MappedSurface {
  Segmentation segmentation;
  std::vector<Chart> charts;
  std::vector<double> unseen;  ///< share of each bone's area that its rays do not see
  std::vector<Method> methods;
  std::vector<MapReport> reports;
  std::vector<RowProfile> profiles;   ///< of bones with a map
  std::vector<ExpectedError> errors;  ///< likewise
};

struct MapSurfaceOptions {
  VsmOptions vsm;
  /// Bones of which VSM squeezes a part, such as a tail on a thigh, are reweighted further, see reweight_squeezed.
  bool reweights_squeezed = true;
  bool has_uniform_rows = false;  ///< rows are even in u
};

/// Makes the charts of all bones and maps them, each by its method.
/// \throw TopologyError
MappedSurface map_surface(ClContext& context, Segmentation segmentation, std::vector<Method> methods,
                          const Skeleton& skeleton, const SeparationPlanes& separation,
                          const MapSurfaceOptions& options);

}  // namespace skeletex
