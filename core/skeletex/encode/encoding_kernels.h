// SPDX-License-Identifier: MIT
#pragma once
#include <vector>

#include "skeletex/cl/context.h"
#include "skeletex/encode/encode_model.h"

namespace skeletex {

/// A kernel, and the range that it is compiled for.
struct KernelVariant {
  ClKernelName name;
  ClRange range;
};

/// The kernels of encode_model on a CPU in the order of their first launches, for ClContext::compile. Whether texels snap depends on the mesh as well,
/// unless options tell; their kernels are listed where they can.
std::vector<KernelVariant> encoding_kernels(const ClContext& context, const EncodeOptions& options = {});

}  // namespace skeletex
