// SPDX-License-Identifier: MIT
#pragma once
#include "progress_bar.h"
#include "skeletex/device/context.h"

namespace skeletex::cli {

/// Has the driver compile the kernels of all commands, by running each stage once on a small mesh: some drivers (PoCL)
/// compile a kernel at its first launch.
/// \param metro_context  another one for the same device: `metro` has a program of its own where no other has come
/// first
void compile_kernels(ClContext& context, ClContext& metro_context, ProgressBar& bar);

}  // namespace skeletex::cli
