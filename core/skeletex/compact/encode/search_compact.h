// SPDX-License-Identifier: MIT
#pragma once
#include <optional>
#include <string>

#include "skeletex/compact/encode/encode_compact.h"
#include "skeletex/device/context.h"

namespace skeletex {

/// What a compact file must reach; without anything, an error of 1e-4.
struct CompactGoal {
  std::optional<double> max_error;       ///< symmetric surface mean over the diagonal
  std::optional<std::size_t> max_bytes;  ///< of the file
  std::optional<double> quality;         ///< 0 to 100: the step is 10^-(2 + quality / 25) diagonals
  /// About the side of the texture that the file decodes to; without, 512, or twice or four times that where an error
  /// asks for it.
  std::optional<int> size;
  int layer_steps = 64;  ///< steps of a layer's range; 0: layers and bone weights are left out
};

struct CompactResult {
  std::string bytes;            ///< of the file
  std::size_t layer_bytes = 0;  ///< of them, those that a file without layers would lack
  CompactOptions options;
  double mean = 0, max = 0;  ///< symmetric surface mean, and the largest distance of both directions, over the diagonal
  int trials = 0;
};

/// The file with the fewest bytes that is found for a wanted error, or with the smallest error for a number of bytes.
/// \param model      its surface is what the file describes
/// \param reference  what errors are measured against, in the frame of in_unit_frame(model); null: the model's own mesh
/// \throw InputError when the goal is out of reach, with the nearest that was found
CompactResult search_compact(ClContext& context, const SkeletexModel& model, const TriangleMesh* reference,
                             const CompactGoal& goal);

}  // namespace skeletex
