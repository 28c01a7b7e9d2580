// SPDX-License-Identifier: MIT
#pragma once
#include <sys/types.h>

#include <functional>

namespace skeletex::cli {

/// A second process that compiles kernels while this one works, for drivers that compile a kernel at its first launch
/// and keep it for all processes (PoCL): within one process they compile one after the other.
class SecondCompiler {
 public:
  /// Forks at once, as that is only safe while there is one thread and no driver. The other process waits until it is
  /// asked to work. \param compile  runs there, and ends when it is no longer wanted
  explicit SecondCompiler(const std::function<void(const std::function<bool()>& is_wanted)>& compile);
  /// Waits for the other process, which ends after the kernel that it compiles.
  ~SecondCompiler();
  SecondCompiler(const SecondCompiler&) = delete;
  SecondCompiler& operator=(const SecondCompiler&) = delete;

  void start();

 private:
  pid_t process_ = -1;
  int other_ = -1;  ///< a socket to the other process; closed: no longer wanted
};

}  // namespace skeletex::cli
