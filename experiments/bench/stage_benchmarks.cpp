// SPDX-License-Identifier: MIT
#include "stage_benchmarks.h"

#include <benchmark/benchmark.h>

#include <map>
#include <optional>

#include "runner/record.h"

namespace skeletex {

ClContext& bench_device() {
  static ClContext context;
  return context;
}

MeshInputPointer bench_mesh(const std::string& name) {
  static std::map<std::string, MeshInputPointer> kept;
  MeshInputPointer& input = kept[name];
  constexpr int kTwice = 2;  // 52 000 triangles become 832 000
  if (!input) input = name == "armadillo_fine" ? find_mesh_input("armadillo", kTwice) : find_mesh_input(name);
  return input;
}

TextureInputPointer bench_texture(const std::string& name, int size) {
  static std::map<std::pair<std::string, int>, TextureInputPointer> kept;
  TextureInputPointer& input = kept[{name, size}];
  if (!input) input = encode_input(bench_device(), *bench_mesh(name), size);
  return input;
}

void register_stage(const std::string& name, std::function<Stage()> make) {
  // Google Benchmark calls a function several times until it knows how often to repeat; only the stage of the moment is
  // kept.
  static std::optional<Stage> stage;
  static std::string stage_name;
  const auto run = [name, make = std::move(make)](benchmark::State& state) {
    if (stage_name != name) {
      stage.reset();
      stage = make();
      stage_name = name;
      run_once(bench_device(), *stage);
    }
    StageSamples measured;
    for (auto _ : state) {
      measured.samples.push_back(run_once(bench_device(), *stage));
      state.SetIterationTime(1e-3 * measured.samples.back().ms);
    }
    state.SetLabel(stage->reference);
    state.counters["ratio"] = measured.ratio();
    state.counters["reference_ms"] = measured.median(&StageSample::reference_ms);
    state.counters["wall_ms"] = measured.median(&StageSample::wall_ms);
    state.counters["device_ms"] = measured.median(&StageSample::device_ms);
    state.counters["launches"] = measured.median(&StageSample::launches);
    if (stage->details)
      for (const auto& [detail, value] : stage->details()) state.counters[detail] = value;
  };
  benchmark::RegisterBenchmark(name.c_str(), run)->UseManualTime()->Unit(benchmark::kMillisecond);
}

}  // namespace skeletex

int main(int argc, char** argv) {
  skeletex::register_all();
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  const skeletex::OrderedJson record = skeletex::describe_build_and_machine("");
  for (const char* key : {"name", "driver"})
    benchmark::AddCustomContext(std::string("device_") + key, record.at("device").at(key).get<std::string>());
  benchmark::AddCustomContext("compiler", record.at("compiler").get<std::string>());
  benchmark::AddCustomContext("git", skeletex::describe_checkout().dump());
  benchmark::RunSpecifiedBenchmarks();
}
