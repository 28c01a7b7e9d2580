// SPDX-License-Identifier: MIT
#pragma once

namespace skeletex::cli {

/// To be called before there are threads: PoCL's stay on processors of their own, and it is noted whether other
/// programs leave processors idle.
void prepare_device_threads();

/// Threads that a driver starts while this lives do not interrupt whoever gives them work, where processors are idle:
/// PoCL's, woken for the first of several launches, take the processor on which the others are made ready. Where other
/// programs run they would wait for these at each launch.
class LoadingDevice {
 public:
  LoadingDevice();
  ~LoadingDevice();
  LoadingDevice(const LoadingDevice&) = delete;
  LoadingDevice& operator=(const LoadingDevice&) = delete;

 private:
  bool has_policy_ = false;
};

}  // namespace skeletex::cli
