// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/convert/parameterize/chart.h"

namespace skeletex {

/// The map of vsm.cl once more by a sparse factorization in double precision on the host: for charts that single
/// precision does not do. Fills u and v of all inner vertices. Of a lone bone, whose v is free to turn, any turn will
/// do.
/// \param iterations, alpha  see VsmOptions
/// \return the reweightings of the map: fewer than asked for where a further one would flip more triangles
int map_directly(Chart& chart, int iterations, double alpha);

}  // namespace skeletex
