// SPDX-License-Identifier: MIT
#include "progress_bar.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

#include "skeletex/model/error.h"

namespace skeletex::cli {

ProgressBar::ProgressBar() : is_terminal_(::isatty(STDERR_FILENO) != 0) {}

ProgressBar::ProgressBar(ClContext& context) : ProgressBar() {
  if (!is_terminal_) return;
  context_ = &context;
  context.watch_compiling([this](double seconds) {
    constexpr double kLong = 0.5;  // more than it takes to load all kernels from a driver's cache
    if (seconds > kLong) draw(stage_ + " (compiling kernels, once)");
  });
}

ProgressBar::~ProgressBar() {
  if (context_) context_->watch_compiling({});
  if (is_drawn_) std::fputs("\r\033[K", stderr);
}

void ProgressBar::show(const std::string& stage, double done) {
  if (!is_terminal_) return;
  const auto now = std::chrono::steady_clock::now();
  if (stage == stage_ && now - last_ < std::chrono::milliseconds(50)) return;
  stage_ = stage;
  done_ = std::clamp(done, 0.0, 1.0);
  last_ = now;
  draw(stage);
}

void ProgressBar::draw(const std::string& text) {
  constexpr int kWidth = 32;
  const int filled = static_cast<int>(done_ * kWidth);
  fmt::print(stderr, "\r\033[K[{}{}] {:3.0f} % {}", std::string(filled, '#'), std::string(kWidth - filled, '.'),
             100 * done_, printable(text));
  std::fflush(stderr);
  is_drawn_ = true;
}

}  // namespace skeletex::cli
