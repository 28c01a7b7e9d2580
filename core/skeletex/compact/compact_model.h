// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "skeletex/model/texture.h"
#include "skeletex/skeleton/skeleton.h"

namespace skeletex {

/// The integers of the points that one refinement step adds (refine.h), in the order of their rows and columns.
struct StepResiduals {
  std::vector<int> normal;        ///< in steps of q; empty: the step is its prediction alone
  std::vector<int> side, across;  ///< in tangential steps; both empty: all are 0
};

/// A layer as it is coded: a value is offset + step times an integer. The first three planes of colours are the roots
/// of red, green and blue, less that of green for red and blue.
struct CompactLayer {
  std::string name;
  int planes = 1;                ///< 1: numbers; 3, 4: colours; of weights one per bone
  bool is_bone_weights = false;  ///< the model's painted weights, not one of its layers
  double offset = 0, step = 1;
  bool is_colour() const { return !is_bone_weights && planes >= 3; }
};

/// One plane of a layer in a patch.
struct CompactPlane {
  std::vector<int> base;  ///< of the coarse grid with its ends, row by row, in steps; empty: 0 all over the patch
  std::vector<std::vector<int>> steps;  ///< per step of the patch the residuals of its new values; empty: all are 0
};

/// One bone's points: a coarse grid, and the steps that double its columns or the intervals between its rows.
struct CompactPatch {
  int columns = 4, intervals = 3;  ///< of the coarse grid; rows are vertex-centred, so it has one row more
  std::uint32_t row_steps = 0;     ///< bit i: step i doubles the intervals between rows, else the columns
  int step_count = 0;
  int base_exponent = 0;                       ///< tangential step of the coarse grid: q 2^base_exponent
  std::array<int, 3> row_knots{64, 128, 192};  ///< u at 1/4, 1/2, 3/4 of the rows, in 256ths, increasing
  std::array<std::array<int, 3>, 2> poles{};   ///< at free ends: offset from the node along s, b, o in steps of q
  std::vector<int> base;                       ///< inner points of the coarse grid: out, around, along each
  std::vector<StepResiduals> steps;            ///< as many as have residuals, at most step_count
  std::vector<CompactPlane> planes;            ///< of all layers, one after the other
};

/// A point where three or more bones meet.
struct CompactCorner {
  NodeIndex node;
  std::vector<BoneIndex> bones;
  int turn = 0;      ///< about bones[0], in 65536ths
  int distance = 0;  ///< in steps of the seams
};

/// The shared boundary of two patches, as a curve in the separation plane.
struct CompactArc {
  NodeIndex node;
  std::array<BoneIndex, 2> bones{-1, -1};
  std::array<int, 2> corners{-1, -1};
  int step_count = 0;     ///< each step doubles the intervals: an open arc begins with 1, a closed one with 4
  std::vector<int> base;  ///< closed arcs: four points in the plane, two coordinates each, in steps
  std::vector<StepResiduals> steps;  ///< as many as have residuals
  bool is_closed() const { return corners[0] < 0; }
};

/// Weights of the offsets of the left, upper, upper left and upper right neighbour in the prediction of an offset, in
/// 64ths.
using OffsetWeights = std::array<int, 4>;

/// A model as a compact file holds it (docs/compact.md).
struct CompactModel {
  Skeleton skeleton;    ///< as it is decoded: rounded, every bone with its s
  double step = 1e-4;   ///< q: of offsets along the normal, in the unit frame
  int bare_levels = 0;  ///< finest steps of every patch that have no residuals
  /// Of steps that double columns, and of those that double rows.
  std::array<OffsetWeights, 2> weights{};
  std::vector<CompactPatch> patches;  ///< one per bone
  std::vector<CompactCorner> corners;
  std::vector<CompactArc> arcs;
  std::vector<CompactLayer> layers;
  std::optional<Stance> stance;  ///< none: not known
};

}  // namespace skeletex
