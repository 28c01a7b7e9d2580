// SPDX-License-Identifier: MIT
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>

#include "charts.h"
#include "skeletex/convert/parameterize/vsm.h"
#include "skeletex/geometry/parallel.h"
#include "stages.h"

namespace skeletex {
namespace {

using Matrix = Eigen::SparseMatrix<double>;

/// The unit-weight systems of u, scaled to a unit diagonal; the largest first, so that threads end together.
// NOLINTNEXTLINE(readability-function-cognitive-complexity): a twin, kept as plain as the formula
std::vector<Matrix> matrices_of(const std::vector<Chart>& charts) {
  std::vector<Matrix> matrices;
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
  std::sort(matrices.begin(), matrices.end(), [](const Matrix& a, const Matrix& b) { return a.rows() > b.rows(); });
  return matrices;
}

double solve_directly(const Matrix& matrix, int solves) {
  Eigen::SimplicialLDLT<Matrix> solver;
  solver.analyzePattern(matrix);
  const Eigen::MatrixX2d right = Eigen::MatrixX2d::Ones(matrix.rows(), 2);
  double sum = 0;
  for (int k = 0; k < solves; ++k) {
    solver.factorize(matrix);
    sum += Eigen::MatrixX2d(solver.solve(right)).sum();
  }
  return sum;
}

}  // namespace

Stage vsm_stage(ClContext& context, MeshInputPointer input, int threads) {
  Stage stage;
  stage.name = "vsm";
  stage.model = input->name;
  stage.size = static_cast<int>(input->mesh.triangles.size());
  stage.reference = threads == 1 ? "Eigen's SimplicialLDLT on one thread" : "Eigen's SimplicialLDLT on all threads";
  const auto charts = std::make_shared<const std::vector<Chart>>(charts_of(context, *input).charts);
  const auto matrices = std::make_shared<const std::vector<Matrix>>(matrices_of(*charts));
  const auto reports = std::make_shared<std::vector<MapReport>>();
  // Charts keep all but their maps, which are restored.
  stage.run = [&context, charts, reports, mapped = std::make_shared<std::vector<Chart>>(*charts)] {
    for (std::size_t k = 0; k < mapped->size(); ++k) (*mapped)[k].u = (*charts)[k].u, (*mapped)[k].v = (*charts)[k].v;
    *reports = solve_vsm(context, *mapped);
  };
  stage.run_reference = [matrices, threads] {
    const int solves = VsmOptions().iterations + 1;
    std::vector<double> sums(matrices->size());
    const auto solve = [&](std::size_t i) { sums[i] = solve_directly((*matrices)[i], solves); };
    return wall_ms([&] {
      if (threads == 1)
        for (std::size_t i = 0; i < matrices->size(); ++i) solve(i);
      else
        for_each_index(matrices->size(), solve);
    });
  };
  stage.details = [charts, reports] {
    double vertices = 0, steps = 0, direct = 0;
    for (std::size_t k = 0; k < reports->size(); ++k) {
      const auto count = static_cast<double>((*charts)[k].positions.size());
      vertices += count;
      steps += (*reports)[k].solver_steps * count;
      direct += (*reports)[k].used_direct_solver;
    }
    return std::vector<std::pair<std::string, double>>{
        {"vertices", vertices}, {"steps", steps / vertices}, {"direct_solves", direct}};
  };
  return stage;
}

}  // namespace skeletex
