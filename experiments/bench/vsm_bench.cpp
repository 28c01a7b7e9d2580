// SPDX-License-Identifier: MIT
// Maps of all charts of a model: the device's solver and, in the same run, Eigen's sparse factorization (double precision,
// one thread) of the same number of systems. The factorization is given its matrices; the device's time holds
// everything, from charts to checked maps.
#include <benchmark/benchmark.h>

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <chrono>
#include <map>
#include <string>

#include "skeletex/io/mesh_file.h"
#include "skeletex/io/model_config.h"
#include "skeletex/io/skeleton_file.h"
#include "skeletex/parameterize/vsm.h"
#include "skeletex/segment/segment_mesh.h"

namespace skeletex {
namespace {

ClContext& context() {
  static ClContext instance;
  return instance;
}

const std::vector<Chart>& charts_of(const std::string& name) {
  static std::map<std::string, std::vector<Chart>> models;
  const auto it = models.find(name);
  if (it != models.end()) return it->second;
  const ModelConfig config = read_model_config(SKELETEX_SOURCE_DIR "/configs/models/" + name + ".json");
  const Skeleton skeleton = read_skeleton(config.skeleton);
  const Walls walls(skeleton);
  std::vector<Chart> charts;
  for (const Segment& segment : segment_mesh(context(), build_half_edges(read_mesh(config.mesh).mesh), skeleton).segments)
    charts.push_back(make_chart(segment, skeleton, walls));
  return models[name] = std::move(charts);
}

/// Seconds by model, so that the second of two benchmarks can say how it compares to the first.
std::map<std::string, double>& factorization_seconds() {
  static std::map<std::string, double> kept;
  return kept;
}

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

/// The unit-weight systems of u, scaled to a unit diagonal.
std::vector<Eigen::SparseMatrix<double>> matrices_of(const std::vector<Chart>& charts) {
  std::vector<Eigen::SparseMatrix<double>> matrices;
  for (const Chart& chart : charts) {
    std::vector<int> row(chart.kinds.size(), -1);
    int rows = 0;
    for (std::size_t i = 0; i < row.size(); ++i)
      if (chart.kinds[i] == ChartVertex::kInner) row[i] = rows++;
    Eigen::VectorXd diagonal = Eigen::VectorXd::Zero(rows);
    std::vector<Eigen::Triplet<double>> entries;
    for (const bool is_sum : {true, false})
      for (const Triangle& t : chart.triangles)
        for (int c = 0; c < 3; ++c) {
          const int i = row[t[c]], j = row[t[(c + 1) % 3]];
          if (i < 0) continue;
          if (is_sum)
            diagonal[i] += 1;
          else if (j >= 0)
            entries.emplace_back(i, j, -1 / std::sqrt(diagonal[i] * diagonal[j]));
        }
    for (int i = 0; i < rows; ++i) entries.emplace_back(i, i, 1);
    matrices.emplace_back(rows, rows);
    matrices.back().setFromTriplets(entries.begin(), entries.end());
  }
  return matrices;
}

void factorize(benchmark::State& state, const std::string& name) {
  const auto matrices = matrices_of(charts_of(name));
  const int solves = VsmOptions().iterations + 1;
  const double start = now();
  for (auto _ : state)
    for (const auto& matrix : matrices) {
      Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver;
      solver.analyzePattern(matrix);
      const Eigen::MatrixX2d right = Eigen::MatrixX2d::Ones(matrix.rows(), 2);
      for (int k = 0; k < solves; ++k) {
        solver.factorize(matrix);
        benchmark::DoNotOptimize(Eigen::MatrixX2d(solver.solve(right)).sum());
      }
    }
  factorization_seconds()[name] = (now() - start) / static_cast<double>(state.iterations());
}

void solve(benchmark::State& state, const std::string& name) {
  const std::vector<Chart>& charts = charts_of(name);
  std::vector<Chart> warm = charts;
  solve_vsm(context(), warm);
  double seconds = 0;
  std::vector<VsmReport> reports;
  for (auto _ : state) {
    std::vector<Chart> copy = charts;
    const double start = now();
    reports = solve_vsm(context(), copy);
    const double elapsed = now() - start;
    state.SetIterationTime(elapsed);
    seconds += elapsed;
  }
  double vertices = 0, steps = 0;
  int most = 0;
  for (std::size_t k = 0; k < charts.size(); ++k) {
    const double count = static_cast<double>(charts[k].positions.size());
    vertices += count;
    steps += reports[k].solver_steps * count;
    most = std::max(most, reports[k].solver_steps);
  }
  state.counters["vertices"] = vertices;
  state.counters["steps_mean"] = steps / vertices;
  state.counters["steps_max"] = most;
  if (const auto it = factorization_seconds().find(name); it != factorization_seconds().end())
    state.counters["faster_than_factorization"] = it->second / (seconds / static_cast<double>(state.iterations()));
}

const int registered = [] {
  for (const char* name : {"bunny00", "armadillo", "bear", "man"}) {
    benchmark::RegisterBenchmark((std::string("vsm/factorization/") + name).c_str(), [name](benchmark::State& s) { factorize(s, name); })
        ->Unit(benchmark::kMillisecond)->UseRealTime();
    benchmark::RegisterBenchmark((std::string("vsm/device/") + name).c_str(), [name](benchmark::State& s) { solve(s, name); })
        ->Unit(benchmark::kMillisecond)->UseManualTime();
  }
  return 0;
}();

}  // namespace
}  // namespace skeletex

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  benchmark::AddCustomContext("device", skeletex::context().device().name + ", " + skeletex::context().device().driver);
  benchmark::RunSpecifiedBenchmarks();
}
