// SPDX-License-Identifier: MIT
// Filters on the device, next to a copy of as many floats: one application of the surface's operator, and whole filters.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "skeletex/edit/differential.h"
#include "skeletex/edit/filter.h"

namespace skeletex {
namespace {

ClContext& device() {
  static ClContext context;
  return context;
}

/// One bone in a wavy capsule: one rectangle, two poles.
SkeletexModel wavy_capsule(int size) {
  SkeletexModel model;
  model.skeleton.nodes = {{"low", Vec3(0, 0, -1)}, {"high", Vec3(0, 0, 1)}};
  model.skeleton.bones = {{"bone", 0, 1, Vec3(1, 0, 0)}};
  model.diagonal = 3;
  model.texture = {size, size, {}, {}, {}};
  Patch patch{{0, 0, size, size}, Method::kSpd, SegmentTopology::kSphere, {}};
  for (int row = 0; row < size; ++row) {
    patch.row_u.push_back(static_cast<double>(row) / (size - 1));
    const bool is_pole = row == 0 || row + 1 == size;
    for (int column = 0; column < size; ++column) {
      const double turn = static_cast<double>(column) / size, u = patch.row_u.back();
      const double wave = is_pole ? 0 : 0.02 * std::sin(40 * u) * std::cos(2 * std::numbers::pi * 8 * turn);
      model.texture.along.push_back(0);
      model.texture.around.push_back(0);
      model.texture.out.push_back(static_cast<float>(0.4 + wave));
    }
  }
  model.patches.push_back(std::move(patch));
  model.ends.resize(1);
  return model;
}

double last_seconds() {
  double ms = 0;
  for (const ClProfileEntry& entry : device().profile()) ms += entry.milliseconds;
  return 1e-3 * ms;
}

/// (M + t L) x of three components, and what copying those takes.
void apply(benchmark::State& state) {
  const SkeletexModel model = wavy_capsule(static_cast<int>(state.range(0)));
  const ModelSurface surface = upload_surface(device(), model);
  const SurfaceOperator laplace = make_surface_operator(device(), surface.neighbours, surface.points);
  const auto everywhere = device().upload(std::vector<float>(surface.neighbours.vertex_count, 1.f));
  const auto copy = device().allocate<float>(surface.points.values.size);
  double copy_seconds = 1e9, best = 1e9;
  for (int repeat = 0; repeat < 20; ++repeat) {
    ::cl::Event event;
    device().queue().enqueueCopyBuffer(surface.points.values.memory, copy.memory, 0, 0, copy.size * sizeof(float), nullptr, &event);
    event.wait();
    copy_seconds = std::min(copy_seconds, 1e-9 * static_cast<double>(event.getProfilingInfo<CL_PROFILING_COMMAND_END>() -
                                                                     event.getProfilingInfo<CL_PROFILING_COMMAND_START>()));
  }
  for (auto _ : state) {
    device().reset_profile();
    benchmark::DoNotOptimize(apply_operator(device(), laplace, 1, 1e-4f, everywhere, surface.points).values.size);
    const double seconds = last_seconds();
    best = std::min(best, seconds);
    state.SetIterationTime(seconds);
  }
  state.counters["copy_ms"] = 1e3 * copy_seconds;
  state.counters["times_copy"] = best / copy_seconds;
}

void smooth(benchmark::State& state) {
  const SkeletexModel model = wavy_capsule(static_cast<int>(state.range(0)));
  int steps = 0;
  for (auto _ : state) steps = smooth_model(device(), model).report.solver.steps;
  state.counters["steps"] = steps;
}

void noise(benchmark::State& state) {
  const SkeletexModel model = wavy_capsule(static_cast<int>(state.range(0)));
  for (auto _ : state) benchmark::DoNotOptimize(add_noise(device(), model).report.largest_move);
}

BENCHMARK(apply)->Arg(512)->Arg(2048)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK(smooth)->Arg(512)->Arg(2048)->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK(noise)->Arg(512)->Arg(2048)->UseRealTime()->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace skeletex

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  const skeletex::ClDeviceInfo& info = skeletex::device().device();
  benchmark::AddCustomContext("device", info.name);
  benchmark::AddCustomContext("driver", info.driver);
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
