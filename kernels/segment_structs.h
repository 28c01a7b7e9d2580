// SPDX-License-Identifier: MIT
// Structs that the host and segment.cl share.
#ifndef SKELETEX_SEGMENT_STRUCTS_H
#define SKELETEX_SEGMENT_STRUCTS_H

#ifdef __OPENCL_C_VERSION__
#define SKELETEX_INT int
#else
#include <cstdint>
#define SKELETEX_INT std::int32_t
namespace skeletex {
#endif

typedef struct ClassifyParameters {
  SKELETEX_INT point_count, node_count;
} ClassifyParameters;

#ifndef __OPENCL_C_VERSION__
}  // namespace skeletex
#endif
#undef SKELETEX_INT
#endif
