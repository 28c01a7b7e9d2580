// SPDX-License-Identifier: MIT
#include "fuzz.h"
#include "runner/experiment.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace skeletex;
  const fuzz::MemoryFile file(fuzz::text_of(data, size));
  return fuzz::read_or_refuse([&] {
    const Experiment experiment = read_experiment(file.path());
    for (const Item& item : plan_items(experiment))
      for (const Step& step : experiment.steps) fill_arguments(experiment, item, step.run, {});
  });
}
