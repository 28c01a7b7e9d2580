// SPDX-License-Identifier: MIT
// Without the care for NaN of fmin and fmax, which takes three instructions instead of one.
#ifndef EXTREMES_H
#define EXTREMES_H

__attribute__((always_inline)) float lesser(float a, float b) { return a < b ? a : b; }
__attribute__((always_inline)) float greater(float a, float b) { return a > b ? a : b; }

#endif
