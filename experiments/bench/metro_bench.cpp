// SPDX-License-Identifier: MIT
// Closest points on the device, beside Embree's point queries on all processors in the same run. Queries come along a
// Hilbert curve for both.
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <cmath>

#include "skeletex/analysis/manifold.h"
#include "skeletex/geometry/triangle_tree.h"
#include "stage_benchmarks.h"

namespace skeletex {
namespace {

void report_triangles(benchmark::State& state, const MeshInput& input) {
  state.counters["triangles/s"] = benchmark::Counter(static_cast<double>(input.mesh.triangles.size()),
                                                     benchmark::Counter::kIsIterationInvariantRate);
}

void tree(benchmark::State& state, const std::string& name) {
  const MeshInputPointer input = bench_mesh(name);
  for (auto _ : state) benchmark::DoNotOptimize(build_triangle_tree(input->mesh).order.data());
  report_triangles(state, *input);
}

void manifold(benchmark::State& state, const std::string& name) {
  const MeshInputPointer input = bench_mesh(name);
  for (auto _ : state) benchmark::DoNotOptimize(measure_manifold(input->mesh).genus);
  report_triangles(state, *input);
}

}  // namespace

void register_all() {
  for (const std::string name : {"bunny00", "armadillo", "armadillo_fine"}) {
    // The last part of the name is the points' distance from the surface: 10^-n diagonals.
    for (const int digits : {1, 3, 5})
      register_stage(fmt::format("metro/{}/{}", name, digits),
                     [=] { return metro_stage(bench_device(), bench_mesh(name), std::pow(10, -digits)); });
    benchmark::RegisterBenchmark(fmt::format("tree/{}", name).c_str(), tree, name)
        ->UseRealTime()
        ->Unit(benchmark::kMillisecond);
    benchmark::RegisterBenchmark(fmt::format("manifold/{}", name).c_str(), manifold, name)
        ->UseRealTime()
        ->Unit(benchmark::kMillisecond);
  }
}

}  // namespace skeletex
