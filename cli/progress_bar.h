// SPDX-License-Identifier: MIT
#pragma once
#include <chrono>
#include <string>

#include "skeletex/device/context.h"

namespace skeletex::cli {

/// A bar on standard error while a command works; nothing at all when that is no terminal. Gone when destroyed.
class ProgressBar {
 public:
  ProgressBar();
  /// Says as well that kernels are compiled, when that takes long. The context must outlive the bar.
  explicit ProgressBar(ClContext& context);
  ~ProgressBar();
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;
  /// \param done  share of all the work, 0 to 1
  void show(const std::string& stage, double done);

 private:
  void draw(const std::string& text);

  bool is_terminal_;
  bool is_drawn_ = false;
  std::chrono::steady_clock::time_point last_{};
  std::string stage_;
  double done_ = 0;
  ClContext* context_ = nullptr;
};

}  // namespace skeletex::cli
