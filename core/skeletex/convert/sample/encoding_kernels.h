// SPDX-License-Identifier: MIT
#pragma once
#include <vector>

#include "skeletex/convert/encode_model.h"
#include "skeletex/device/context.h"

namespace skeletex {

/// A kernel, and the range that it is compiled for.
struct KernelVariant {
  ClKernelName name;
  ClRange range;
};

/// The kernels of encode_model on a CPU in the order of their first launches, for ClContext::compile: without VSM's for
/// charts that are too large for one work-item, and with those for snapping, unless options exclude it, though whether
/// texels snap depends on the mesh as well.
std::vector<KernelVariant> encoding_kernels(const ClContext& context, const EncodeOptions& options = {});

}  // namespace skeletex
