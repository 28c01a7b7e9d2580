// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace skeletex {

struct EmbeddedKernelFile {
  std::string_view name;  ///< "vsm.cl"
  std::string_view text;
};

/// The files of `kernels/` as they were when the library was built.
std::span<const EmbeddedKernelFile> embedded_kernel_files();

/// The sets of kernel files with this one that make one program each, the one to be built where none is there first. A
/// program costs PoCL 30 ms at every start and 120 ms at the first, whatever is in it, and each further file 2 and 40:
/// so there is one for each part of the work.
std::vector<std::vector<std::string_view>> programs_with(std::string_view file);

/// Text of kernel files, one after the other: each from the folder that SKELETEX_KERNEL_DIR names when it is set, else
/// the embedded copy. Lines `#include "x.h"` are replaced by the file x.h (in turn), the first time, so that a program
/// is one text on every driver; `#line` keeps the files' own line numbers.
/// \throw DeviceError when the file does not
/// exist, or includes itself
std::string kernel_source(std::span<const std::string_view> files);

/// A driver's build log with the kernel file's own line below each message that names a file and a line, where the
/// driver does not print it itself. Cut after some 100 lines.
std::string quote_kernel_lines(std::string_view build_log);

}  // namespace skeletex
