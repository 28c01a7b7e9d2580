// SPDX-License-Identifier: MIT
// Rays of the separation planes' map, all charts of a model, beside Embree's packets of eight coherent rays on all
// processors, in the same run and with the same rays; and the share of the surface that rays do not see.
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include "skeletex/convert/parameterize/spd.h"
#include "stage_benchmarks.h"
#include "stages/charts.h"

namespace skeletex {
namespace {

void unseen(benchmark::State& state, const std::string& name) {
  const MeshInputPointer input = bench_mesh(name);
  const std::vector<Chart> charts = charts_of(bench_device(), *input).charts;
  const SeparationPlanes separation(input->skeleton);
  for (auto _ : state) benchmark::DoNotOptimize(unseen_area_fractions(input->skeleton, separation, charts).data());
  state.counters["triangles/s"] = benchmark::Counter(static_cast<double>(input->mesh.triangles.size()),
                                                     benchmark::Counter::kIsIterationInvariantRate);
}

}  // namespace

void register_all() {
  for (const std::string name : {"bunny00", "armadillo", "bear", "armadillo_fine"}) {
    for (const int size : {512, 2048})
      register_stage(fmt::format("spd_rays/{}/{}", name, size),
                     [=] { return spd_rays_stage(bench_device(), bench_mesh(name), size); });
    benchmark::RegisterBenchmark(fmt::format("unseen/{}", name).c_str(), unseen, name)
        ->UseRealTime()
        ->Unit(benchmark::kMillisecond);
  }
}

}  // namespace skeletex
