// SPDX-License-Identifier: MIT
#include "stage.h"

#include <algorithm>
#include <chrono>
#include <memory>

namespace skeletex {
namespace {

std::vector<double> sorted(const std::vector<StageSample>& samples, double StageSample::*value) {
  std::vector<double> values;
  for (const StageSample& sample : samples) values.push_back(sample.*value);
  std::sort(values.begin(), values.end());
  return values;
}

}  // namespace

double StageSamples::median(double StageSample::*value) const { return sorted(samples, value)[samples.size() / 2]; }
double StageSamples::least(double StageSample::*value) const { return sorted(samples, value).front(); }
double StageSamples::most(double StageSample::*value) const { return sorted(samples, value).back(); }

StageSample run_once(ClContext& context, const Stage& stage) {
  StageSample sample;
  sample.reference_ms = stage.run_reference();
  context.reset_profile();
  sample.wall_ms = wall_ms([&] {
    stage.run();
    context.finish();
  });
  for (const ClProfileEntry& entry : context.profile()) {
    sample.device_ms += entry.milliseconds;
    sample.launches += entry.launches;
  }
  sample.ms = stage.counted_ms ? stage.counted_ms() : stage.is_device_time ? sample.device_ms : sample.wall_ms;
  return sample;
}

StageSamples measure(ClContext& context, const Stage& stage, const Repeats& repeats,
                     const std::function<void(double)>& after_each) {
  StageSamples measured;
  const int total = repeats.warm_ups + repeats.most;
  double spent = 0;
  for (int i = 0; i < total && (i < repeats.warm_ups + repeats.least || spent < 1000 * repeats.seconds); ++i) {
    const StageSample sample = run_once(context, stage);
    spent += sample.wall_ms + sample.reference_ms;
    if (i >= repeats.warm_ups) measured.samples.push_back(sample);
    if (after_each)
      after_each(std::max(static_cast<double>(i + 1) / total, std::min(1.0, spent / (1000 * repeats.seconds))));
  }
  return measured;
}

double wall_ms(const std::function<void()>& work) {
  const auto begin = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
}

std::function<double()> device_copy(ClContext& context, std::size_t floats) {
  // A copy reads and writes: half as many floats make the traffic.
  const std::size_t size = (floats + 1) / 2;
  return [&context, from = context.allocate<float>(size), to = context.allocate<float>(size)]() mutable {
    context.reset_profile();
    context.copy(from, to);
    return context.profile().front().milliseconds;
  };
}

}  // namespace skeletex
