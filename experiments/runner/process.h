// SPDX-License-Identifier: MIT
#pragma once
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace skeletex {

struct ProcessResult {
  int exit_code = -1;  ///< 128 + the signal's number when a signal ended it
  double seconds = 0;  ///< wall clock
  double peak_memory_mb = 0;
  bool is_out_of_time = false;  ///< it was ended because of its limit
  std::string errors;           ///< the end of its standard error
};

/// What a program may take; 0: anything.
struct ProcessLimits {
  double seconds = 0;    ///< wall clock; then it and what it has started is killed
  double memory_mb = 0;  ///< addresses (ulimit -v)
};

/// Runs a program to its end; standard output goes nowhere. Where this process ends before, by a signal too, so does
/// the program.
/// \param environment  set on top of this process's own
/// \throw IoError when it cannot be started
ProcessResult run_process(const std::string& program, const std::vector<std::string>& arguments,
                          const std::map<std::string, std::string>& environment,
                          const std::filesystem::path& error_file, const ProcessLimits& limits = {});

}  // namespace skeletex
