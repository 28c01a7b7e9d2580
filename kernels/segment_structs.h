// SPDX-License-Identifier: MIT
// Structs that the host and segment.cl share.
#ifndef SKELETEX_SEGMENT_STRUCTS_H
#define SKELETEX_SEGMENT_STRUCTS_H

#ifndef __OPENCL_C_VERSION__
namespace skeletex {
#endif

typedef struct ClassifyParameters {
  int point_count, node_count;
} ClassifyParameters;

#ifndef __OPENCL_C_VERSION__
}  // namespace skeletex
#endif
#endif
