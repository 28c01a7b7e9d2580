// SPDX-License-Identifier: MIT
#include "device_threads.h"

#ifdef __linux__
#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#endif

namespace skeletex::cli {
namespace {

#ifdef __linux__

/// Left to Linux, two of PoCL's threads share a processor for milliseconds while the other is idle. Only where
/// this process may use all processors and the number of threads is PoCL's own choice: its n-th thread takes the n-th
/// processor, or it aborts.
void keep_device_threads_apart() {
  for (const char* number_of_threads : {"POCL_MAX_PTHREAD_COUNT", "POCL_CPU_MAX_CU_COUNT"})
    if (std::getenv(number_of_threads)) return;
  const long processors = sysconf(_SC_NPROCESSORS_CONF);
  cpu_set_t allowed, last;
  if (processors < 2 || processors > CPU_SETSIZE || sched_getaffinity(0, sizeof allowed, &allowed) != 0) return;
  for (long i = 0; i < processors; ++i)
    if (!CPU_ISSET(i, &allowed)) return;
  // Whether a thread may choose at all.
  CPU_ZERO(&last);
  CPU_SET(processors - 1, &last);
  if (sched_setaffinity(0, sizeof last, &last) == 0 && sched_setaffinity(0, sizeof allowed, &allowed) == 0)
    setenv("POCL_AFFINITY", "1", 0);
}

/// Of the threads that want to run now, this one among them, there is no more than one for every two processors.
bool are_processors_idle() {
  int running = 0, read = 0;
  if (std::FILE* load = std::fopen("/proc/loadavg", "r")) {
    read = std::fscanf(load, "%*f %*f %*f %d", &running);
    std::fclose(load);
  }
  return read == 1 && running <= std::max(1L, sysconf(_SC_NPROCESSORS_ONLN) / 2);
}

bool had_idle_processors = false;

void set_policy(int policy) {
  const sched_param parameters{};
  sched_setscheduler(0, policy, &parameters);
}

#endif

}  // namespace

#ifdef __linux__
void prepare_device_threads() {
  keep_device_threads_apart();
  had_idle_processors = are_processors_idle();
}
LoadingDevice::LoadingDevice() : has_policy_(had_idle_processors && sched_getscheduler(0) == SCHED_OTHER) {
  if (has_policy_) set_policy(SCHED_BATCH);
}
LoadingDevice::~LoadingDevice() {
  if (has_policy_) set_policy(SCHED_OTHER);
}
#else
void prepare_device_threads() {}
LoadingDevice::LoadingDevice() = default;
LoadingDevice::~LoadingDevice() = default;
#endif

}  // namespace skeletex::cli
