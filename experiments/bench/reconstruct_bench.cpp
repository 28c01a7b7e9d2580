// SPDX-License-Identifier: MIT
// Frames: bind pose and a pose, beside a device copy of as many bytes; and the whole way from a model to a mesh, or to
// another size.
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include "skeletex/convert/resample/resample.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "stage_benchmarks.h"

namespace skeletex {
namespace {

void whole_mesh(benchmark::State& state, const std::string& name, int size) {
  const TextureInputPointer input = bench_texture(name, size);
  for (auto _ : state) benchmark::DoNotOptimize(reconstruct_mesh(bench_device(), input->model).positions.data());
}

void resample(benchmark::State& state, const std::string& name, int size, int new_size) {
  const TextureInputPointer input = bench_texture(name, size);
  for (auto _ : state)
    benchmark::DoNotOptimize(resample_model(bench_device(), input->model, new_size).texture.out.data());
}

}  // namespace

void register_all() {
  for (const std::string name : {"bunny00", "armadillo", "armadillo_fine"})
    for (const int size : {256, 512, 1024, 2048, 4096}) {
      register_stage(fmt::format("reconstruct/{}/{}", name, size),
                     [=] { return reconstruct_stage(bench_device(), bench_texture(name, size)); });
      register_stage(fmt::format("pose/{}/{}", name, size),
                     [=] { return pose_stage(bench_device(), bench_texture(name, size)); });
    }
  for (const int size : {512, 2048})
    benchmark::RegisterBenchmark(fmt::format("mesh/armadillo/{}", size).c_str(), whole_mesh, "armadillo", size)
        ->UseRealTime()
        ->Unit(benchmark::kMillisecond);
  for (const auto& [size, new_size] : {std::pair{512, 128}, {2048, 512}, {2048, 64}, {512, 1024}})
    benchmark::RegisterBenchmark(fmt::format("resample/armadillo/{}/{}", size, new_size).c_str(), resample, "armadillo",
                                 size, new_size)
        ->UseRealTime()
        ->Unit(benchmark::kMillisecond);
}

}  // namespace skeletex
