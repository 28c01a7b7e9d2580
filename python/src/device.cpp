// SPDX-License-Identifier: MIT
#include <mutex>

#include "bind.h"

namespace skeletex::python {
namespace {

/// Never destroyed: drivers have gone by the time that static objects are.
struct Device {
  std::mutex mutex;
  std::string selector;
  std::unique_ptr<ClContext> context;
};
Device& device() {
  static auto* const instance = new Device;
  return *instance;
}

}  // namespace

DeviceLock::DeviceLock() { device().mutex.lock(); }

DeviceLock::~DeviceLock() {
  try {
    if (device().context) device().context->reset_profile();  // the record of all launches would grow for ever
  } catch (const Error&) {
    device().context.reset();  // a device that is lost: the next call starts anew
  }
  device().mutex.unlock();
}

ClContext& DeviceLock::context() {
  if (!device().context) device().context = std::make_unique<ClContext>(device().selector);
  return *device().context;
}

void choose_device(const std::string& selector) {
  const py::gil_scoped_release released;
  auto context = std::make_unique<ClContext>(selector);  // throws before anything has changed
  const std::lock_guard lock(device().mutex);
  device().selector = selector;
  device().context = std::move(context);
}

bool Progress::is_wanted(const std::string& stage, double done) {
  const py::gil_scoped_acquire acquired;
  try {
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    if (callback_.is_none()) return true;
    const py::object answer = callback_(stage, done);
    is_cancelled_ = answer.is(py::bool_(false));
    return !is_cancelled_;
  } catch (const py::error_already_set&) {
    raised_ = std::current_exception();
    return false;
  }
}

std::function<bool(const std::string&, double)> Progress::function() {
  return [this](const std::string& stage, double done) { return is_wanted(stage, done); };
}

void Progress::rethrow() const {
  if (raised_) std::rethrow_exception(raised_);
  if (is_cancelled_) throw Cancelled("cancelled: the progress function has returned False");
}

}  // namespace skeletex::python
