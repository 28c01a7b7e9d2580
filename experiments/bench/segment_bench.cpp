// SPDX-License-Identifier: MIT
// Half edges and cuts, beside one pass of OpenMesh over the same faces; and the half edges alone.
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include "skeletex/geometry/half_edge.h"
#include "stage_benchmarks.h"

namespace skeletex {
namespace {

void half_edges(benchmark::State& state, const std::string& name) {
  const MeshInputPointer input = bench_mesh(name);
  for (auto _ : state) benchmark::DoNotOptimize(build_half_edges(input->mesh).n_edges());
}

}  // namespace

void register_all() {
  for (const std::string name : {"bunny00", "armadillo", "armadillo_fine"}) {
    register_stage(fmt::format("segment/{}", name), [=] { return segment_stage(bench_device(), bench_mesh(name)); });
    benchmark::RegisterBenchmark(fmt::format("half_edges/{}", name).c_str(), half_edges, name)
        ->UseRealTime()
        ->Unit(benchmark::kMillisecond);
  }
}

}  // namespace skeletex
