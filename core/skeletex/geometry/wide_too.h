// SPDX-License-Identifier: MIT
#pragma once

/// Of a function whose loops are vector instructions: a compiler that can makes it once more for processors with wider
/// ones, without fused multiply-add, so that results are the same on all.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define SKELETEX_WIDE_TOO __attribute__((target_clones("avx2", "default")))
#else
#define SKELETEX_WIDE_TOO
#endif
