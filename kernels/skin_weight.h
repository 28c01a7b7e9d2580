// SPDX-License-Identifier: MIT
// The weights of smooth posing, for kernels and for the host in double precision (REAL).
#ifndef SKELETEX_SKIN_WEIGHT_H
#define SKELETEX_SKIN_WEIGHT_H

// How fast potentials grow, per girth: weights of a straight joint fall by e over 0.6 girths. Chosen on the poses of
// configs/poses/evaluation.
#define SKIN_STEEPNESS 0.8f
// How much farther away a place beyond the seams around a joint counts.
#define SKIN_EXCESS 2.0f
// Weights below this share of the largest are 0.
#define SKIN_CUT 0.002f

// What crossing a joint adds to the potential. `height` is the point's height over the separation plane, (P -
// N).(d_from - d_to), and `excess` its distance beyond the seams around the joint, both in girths. Through the seam
// itself the sum is linear, so that weights are smooth there. Where a bone's surface goes on behind the plane but away
// from the seam, the square brings the potential up again.
#define SKIN_CROSSING(height, excess) \
  (SKIN_STEEPNESS * ((height) + ((height) < 0.0f ? (height) * (height) : 0.0f) + SKIN_EXCESS * (excess) * (excess)))

#endif
