// SPDX-License-Identifier: MIT
// Times of the reconstruction: the displacement kernel next to a device copy of as many bytes, and the whole way from a
// model to a mesh. Device time from profiling events; "of_copy" is the copy's time divided by the kernel's.
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <cmath>
#include <ctime>
#include <string>
#include <vector>

#include "skeletex/model/frame.h"
#include "skeletex/pack/pack_atlas.h"
#include "skeletex/reconstruct/displace.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex {
namespace {

ClContext& device() {
  static ClContext context;
  return context;
}

/// A bent row of 12 bones with a wavy surface; the rectangles are those of a real atlas.
SkeletexModel wavy_chain(int size) {
  constexpr int kBones = 12;
  SkeletexModel model;
  for (int i = 0; i <= kBones; ++i)
    model.skeleton.nodes.push_back({fmt::format("n{}", i), Vec3(0.5 * i, 0.3 * std::sin(i), 0.2 * std::cos(2 * i))});
  for (int i = 0; i < kBones; ++i) model.skeleton.bones.push_back({fmt::format("b{}", i), i, i + 1, {}});
  model.origin = Vec3(0.25 * kBones, 0, 0);
  model.diagonal = 0.5 * kBones;
  std::vector<PatchDemand> demands;
  for (int i = 0; i < kBones; ++i) demands.push_back({1.0 + i % 5, 0.5 + 0.4 * (i % 4)});
  const AtlasLayout layout = pack_atlas(demands, size, size);
  model.texture.width = model.texture.height = size;
  for (auto* plane : {&model.texture.along, &model.texture.around, &model.texture.out}) plane->assign(static_cast<std::size_t>(size) * size, 0.0f);
  model.ends.resize(kBones);
  for (int i = 0; i < kBones; ++i) {
    Patch patch;
    patch.rectangle = layout.rectangles[i];
    patch.topology = i == 0 || i + 1 == kBones ? SegmentTopology::kDisk : SegmentTopology::kAnnulus;
    const auto [x, y, width, height] = patch.rectangle;
    for (int r = 0; r < height; ++r) {
      patch.row_u.push_back(static_cast<double>(r) / (height - 1));
      for (int j = 0; j < width; ++j) {
        const std::size_t at = static_cast<std::size_t>(y + r) * size + x + j;
        model.texture.along[at] = 0.01f * std::sin(0.07f * static_cast<float>(r));
        model.texture.around[at] = 0.01f * std::cos(0.05f * static_cast<float>(j));
        model.texture.out[at] = 0.2f + 0.01f * std::sin(0.03f * static_cast<float>(r + j));
      }
    }
    model.patches.push_back(std::move(patch));
    if (i == 0) continue;
    SeamArc arc{i, {i - 1, i}, {-1, -1}, {}};
    const int samples = std::max(layout.rectangles[i - 1].width, layout.rectangles[i].width);
    for (int k = 0; k < samples; ++k) arc.samples.push_back({(k + 0.5) / samples, 0.2});
    model.ends[i - 1][1].arcs.push_back({i - 1, false});
    model.ends[i][0].arcs.push_back({i - 1, false});
    model.arcs.push_back(std::move(arc));
  }
  return model;
}

double event_seconds(const ::cl::Event& event) {
  event.wait();
  return 1e-9 * static_cast<double>(event.getProfilingInfo<CL_PROFILING_COMMAND_END>() - event.getProfilingInfo<CL_PROFILING_COMMAND_START>());
}

void copy_planes(benchmark::State& state) {
  const auto size = static_cast<std::size_t>(state.range(0) * state.range(0));
  const DevicePlanes from = allocate_planes(device(), size), to = allocate_planes(device(), size);
  for (auto _ : state) {
    double seconds = 0;
    for (const auto& [a, b] : {std::pair{&from.x, &to.x}, {&from.y, &to.y}, {&from.z, &to.z}}) {
      ::cl::Event event;
      device().queue().enqueueCopyBuffer(a->memory, b->memory, 0, 0, size * sizeof(float), nullptr, &event);
      seconds += event_seconds(event);
    }
    state.SetIterationTime(seconds);
  }
  state.counters["GB/s"] = benchmark::Counter(24e-9 * static_cast<double>(size), benchmark::Counter::kIsIterationInvariantRate);
}

void displace_kernel(benchmark::State& state) {
  const int size = static_cast<int>(state.range(0));
  const SkeletexModel model = wavy_chain(size);
  const Walls walls(model.skeleton);
  const DeviceLattice lattice =
      upload_lattice(device(), frame_tables(model.skeleton, walls, model.patches, model.origin), model.patches, model.texture, RowChoice::kInner);
  DevicePlanes points = allocate_planes(device(), lattice.vertex_count);
  // The floor: as many bytes read and written by the driver's own copy.
  DevicePlanes copy = allocate_planes(device(), lattice.vertex_count);
  double copy_seconds = 1e9;
  for (int repeat = 0; repeat < 20; ++repeat) {
    double seconds = 0;
    for (const auto& [a, b] : {std::pair{&points.x, &copy.x}, {&points.y, &copy.y}, {&points.z, &copy.z}}) {
      ::cl::Event event;
      device().queue().enqueueCopyBuffer(a->memory, b->memory, 0, 0, lattice.vertex_count * sizeof(float), nullptr, &event);
      seconds += event_seconds(event);
    }
    copy_seconds = std::min(copy_seconds, seconds);
  }
  displace(device(), lattice, points);
  device().finish();
  double best = 1e9;
  const std::clock_t begin = std::clock();
  for (auto _ : state) {
    device().reset_profile();
    displace(device(), lattice, points);
    const double seconds = 1e-3 * device().profile().front().milliseconds;
    best = std::min(best, seconds);
    state.SetIterationTime(seconds);
  }
  state.counters["GB/s"] = benchmark::Counter(24e-9 * static_cast<double>(lattice.vertex_count), benchmark::Counter::kIsIterationInvariantRate);
  state.counters["texels/s"] = benchmark::Counter(static_cast<double>(lattice.vertex_count), benchmark::Counter::kIsIterationInvariantRate);
  state.counters["best_ms"] = 1e3 * best;
  // Processor time of all threads: what remains comparable on a busy machine, when the device is the CPU.
  state.counters["cpu_ms"] = benchmark::Counter(1e3 * static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC, benchmark::Counter::kAvgIterations);
  state.counters["copy_ms"] = 1e3 * copy_seconds;
  state.counters["of_copy"] = copy_seconds / best;
}

void whole_mesh(benchmark::State& state) {
  const SkeletexModel model = wavy_chain(static_cast<int>(state.range(0)));
  for (auto _ : state) benchmark::DoNotOptimize(reconstruct_mesh(device(), model).positions.data());
}

void resample(benchmark::State& state) {
  const SkeletexModel model = wavy_chain(static_cast<int>(state.range(0)));
  for (auto _ : state) benchmark::DoNotOptimize(resample_model(device(), model, static_cast<int>(state.range(1))).texture.out.data());
}

BENCHMARK(copy_planes)->Arg(512)->Arg(2048)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK(displace_kernel)->Arg(512)->Arg(2048)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK(whole_mesh)->Arg(128)->Arg(512)->Arg(2048)->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK(resample)->Args({512, 128})->Args({2048, 512})->Args({2048, 32})->Args({512, 1024})->UseRealTime()->Unit(benchmark::kMillisecond);

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
