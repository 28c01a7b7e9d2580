// SPDX-License-Identifier: MIT
#include "skeletex/convert/parameterize/elimination.h"

#include <gtest/gtest.h>

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <bit>
#include <cmath>
#include <map>
#include <random>

namespace skeletex {
namespace {

enum class Kind { kUnknown, kFixed, kFixedForFirst };  ///< the last acts on the first right side only

/// A weighted graph and the values of its fixed vertices, for two right sides.
struct Problem {
  std::vector<Vec3> positions;
  std::vector<int> begin{0}, targets;
  std::vector<double> weights;  ///< per target; the same in both directions
  std::vector<Kind> kinds;
  std::vector<std::array<double, 2>> values;

  bool acts(int vertex, int axis) const { return axis == 0 || kinds[vertex] != Kind::kFixedForFirst; }
  template <class Visit>
  void visit(int vertex, int axis, const Visit& act) const {
    for (int k = begin[vertex]; k < begin[vertex + 1]; ++k)
      if (acts(targets[k], axis)) act(targets[k], weights[k]);
  }
};

/// A grid with diagonals, fixed at its two short sides, and one vertex inside that acts on the first right side only.
/// Weights spread over many orders of magnitude.
Problem make_grid(int width, int height, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(0, 1);
  Problem p;
  std::map<std::pair<int, int>, double> weights;
  const auto inside = [&](int x, int y) { return x >= 0 && y >= 0 && x < width && y < height; };
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const int v = y * width + x;
      p.positions.push_back({x + 0.3 * unit(random), y + 0.3 * unit(random), 0.2 * unit(random)});
      p.kinds.push_back(x == 0 || x == width - 1            ? Kind::kFixed
                        : x == width / 2 && y == height / 2 ? Kind::kFixedForFirst
                                                            : Kind::kUnknown);
      p.values.push_back({unit(random), 2 * unit(random) - 1});
      for (const auto& [dx, dy] : {std::pair{1, 0}, {0, 1}, {1, 1}, {-1, 0}, {0, -1}, {-1, -1}}) {
        if (!inside(x + dx, y + dy)) continue;
        const int w = v + dy * width + dx;
        const auto edge = std::minmax(v, w);
        p.targets.push_back(w);
        p.weights.push_back(
            weights.try_emplace({edge.first, edge.second}, std::pow(10, -4 * unit(random))).first->second);
      }
      p.begin.push_back(static_cast<int>(p.targets.size()));
    }
  return p;
}

/// Where every unknown is the weighted mean of its neighbours, in double precision.
std::vector<double> solve_with_eigen(const Problem& p, int axis) {
  const int count = static_cast<int>(p.kinds.size());
  std::vector<Eigen::Triplet<double>> entries;
  Eigen::VectorXd right = Eigen::VectorXd::Zero(count);
  for (int v = 0; v < count; ++v) {
    if (p.kinds[v] != Kind::kUnknown) {
      entries.emplace_back(v, v, 1);
      continue;
    }
    p.visit(v, axis, [&](int w, double weight) {
      entries.emplace_back(v, v, weight);
      if (p.kinds[w] == Kind::kUnknown)
        entries.emplace_back(v, w, -weight);
      else
        right[v] += weight * p.values[w][axis];
    });
  }
  Eigen::SparseMatrix<double> matrix(count, count);
  matrix.setFromTriplets(entries.begin(), entries.end());
  const Eigen::VectorXd solution = Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>(matrix).solve(right);
  return {solution.begin(), solution.end()};
}

OrderedGraph order_graph(const Problem& p, int first_row) {
  OrderedGraph ordered{{p.positions, p.begin, p.targets, {}, {}}, {}, first_row};
  for (std::size_t v = 0; v < p.kinds.size(); ++v) {
    ordered.graph.is_unknown.push_back(p.kinds[v] == Kind::kUnknown);
    bool is_last = false;
    for (const int w : ordered.graph.neighbours(static_cast<int>(v))) is_last |= p.kinds[w] == Kind::kFixedForFirst;
    ordered.graph.is_last.push_back(is_last);
  }
  ordered.dissection = dissect(ordered.graph);
  return ordered;
}

/// The scaled matrix and the residuals of unknowns that are all 0.
void write_system(const Problem& p, const OrderedGraph& ordered, std::span<const int> row_begin,
                  const EliminationLayout& at, std::vector<float>& system) {
  const Dissection& d = ordered.dissection;
  const auto sum_at = [&](int v) {
    double sum = 0;
    p.visit(v, 0, [&](int, double weight) { sum += weight; });
    return sum;
  };
  for (std::size_t i = 0; i < d.order.size(); ++i) {
    const int v = d.order[i], row = ordered.first_row + static_cast<int>(i);
    const double root = std::sqrt(sum_at(v));
    int place = row_begin[row];
    p.visit(v, 0, [&](int w, double weight) {
      if (d.number[w] > d.number[v]) system[place++] = static_cast<float>(weight / (root * std::sqrt(sum_at(w))));
    });
    EXPECT_EQ(place, row_begin[row + 1]);
    system[at.roots + row] = static_cast<float>(root);
    for (const int axis : {0, 1}) {
      double fixed = 0, right = 0;
      p.visit(v, axis, [&](int w, double weight) {
        if (p.kinds[w] == Kind::kUnknown) return;
        fixed += weight;
        right += weight * p.values[w][axis];
      });
      system[at.fixed + axis * at.rows + row] = static_cast<float>(fixed / (root * root));
      system[at.residual + 2 * row + axis] = static_cast<float>(right / root);
    }
  }
}

class EliminationOf : public testing::TestWithParam<int> {};

TEST_P(EliminationOf, ManySystemsAgreesWithEigen) {
  const int group_size = GetParam();
  ClContext context;
  const std::vector<Problem> problems{make_grid(7, 5, 1), make_grid(90, 70, 2), make_grid(12, 40, 3)};
  std::vector<OrderedGraph> systems;
  int rows = 0;
  for (const Problem& problem : problems) {
    systems.push_back(order_graph(problem, rows));
    rows += static_cast<int>(problem.kinds.size());  // more than there are unknowns
  }
  EliminationTables tables = make_elimination_tables(systems, rows);
  const std::vector<int> row_begin = tables.row_begin;
  const bool needs_barriers = group_size > 1 && context.row_items() == 1;
  Elimination elimination(context, std::move(tables), rows, group_size, needs_barriers ? "-DGROUP_BARRIERS" : "");
  std::vector<float> values(elimination.system().size, 0);
  for (std::size_t i = 0; i < systems.size(); ++i)
    write_system(problems[i], systems[i], row_begin, elimination.layout(), values);
  context.write(elimination.system(), values);

  const int kLeftOut = 2;  // its ratio is not above the tolerance
  std::vector<int> ratios(systems.size(), std::bit_cast<int>(1.0f));
  ratios[kLeftOut] = std::bit_cast<int>(0.25f);
  auto unknowns = context.allocate<float>(4 * static_cast<std::size_t>(rows));
  context.fill(unknowns, 0.0f);
  elimination.solve(true, 0.5f, context.upload(ratios), unknowns);
  const std::vector<float> found = context.download(unknowns);
  for (int i = 0; i < static_cast<int>(systems.size()); ++i)
    for (const int axis : {0, 1}) {
      SCOPED_TRACE("system " + std::to_string(i) + ", right side " + std::to_string(axis));
      const std::vector<double> expected = solve_with_eigen(problems[i], axis);
      double largest = 0;
      for (std::size_t k = 0; k < systems[i].dissection.order.size(); ++k) {
        const float* at = &found[4 * (systems[i].first_row + k) + axis];
        const double value = static_cast<double>(at[0]) + static_cast<double>(at[2]);
        largest = std::max(largest, std::abs(value - (i == kLeftOut ? 0 : expected[systems[i].dissection.order[k]])));
      }
      EXPECT_LT(largest, i == kLeftOut ? 1e-30 : 1e-5);
    }
}

INSTANTIATE_TEST_SUITE_P(GroupSizes, EliminationOf, testing::Values(1, 8));

}  // namespace
}  // namespace skeletex
