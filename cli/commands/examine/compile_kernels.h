// SPDX-License-Identifier: MIT
#pragma once
#include "progress_bar.h"
#include "skeletex/device/context.h"

namespace skeletex::cli {

/// Has the driver compile the kernels of all commands, by running each stage once on a small mesh: some drivers (PoCL)
/// compile a kernel at its first launch.
void compile_kernels(ClContext& context, ProgressBar& bar);

}  // namespace skeletex::cli
