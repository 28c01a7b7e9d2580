// SPDX-License-Identifier: MIT
#include "skeletex/skeletonize/body/curve_graph.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "skeletex/geometry/union_find.h"
#include "skeletex/math/portable.h"

namespace skeletex {
namespace {

/// Follows thinned voxels from node to node.
class Tracer {
 public:
  Tracer(const VoxelBody& body, const std::vector<char>& is_left) : body_(body), node_of_(body.size(), -1) {
    neighbours_.resize(body.size());
    for (int v = 0; v < body.size(); ++v) {
      if (!is_left[v]) continue;
      voxels_.push_back(v);
      for (const int other : body.neighbours[v])
        if (other >= 0 && other != v && is_left[other]) neighbours_[v].push_back(other);
    }
  }

  CurveGraph run() {
    make_nodes();
    is_seen_.assign(body_.size(), 0);
    for (const int v : voxels_)
      if (node_of_[v] >= 0) trace_from(v);
    trace_loops();
    return std::move(graph_);
  }

 private:
  void make_nodes() {
    UnionFind clusters(body_.size());
    const auto is_branching = [&](int v) { return neighbours_[v].size() >= 3; };
    for (const int v : voxels_)
      for (const int other : neighbours_[v])
        if (is_branching(v) && is_branching(other)) clusters.unite(v, other);
    std::vector<int> node_of_cluster(body_.size(), -1), deepest;
    for (const int v : voxels_) {
      if (neighbours_[v].size() == 2) continue;
      int& node = node_of_cluster[clusters.find(v)];
      if (node < 0) node = static_cast<int>(deepest.size()), deepest.push_back(v);
      if (body_.radii[v] > body_.radii[deepest[node]]) deepest[node] = v;
      node_of_[v] = node;
    }
    for (const int v : deepest) graph_.nodes.push_back(body_.centres[v]);
  }

  void trace_from(int start) {
    for (const int first : neighbours_[start]) {
      if (node_of_[first] >= 0) {
        if (node_of_[first] != node_of_[start] && start < first)
          graph_.branches.push_back(
              {node_of_[start], node_of_[first], {graph_.nodes[node_of_[start]], graph_.nodes[node_of_[first]]}});
        continue;
      }
      if (!is_seen_[first]) trace(start, first);
    }
  }

  void trace(int start, int first) {
    Branch branch{node_of_[start], -1, {graph_.nodes[node_of_[start]]}};
    if (body_.centres[start] != branch.points[0]) branch.points.push_back(body_.centres[start]);
    int before = start, at = first;
    while (node_of_[at] < 0) {
      is_seen_[at] = 1;
      branch.points.push_back(body_.centres[at]);
      const int next = neighbours_[at][0] == before ? neighbours_[at][1] : neighbours_[at][0];
      before = at;
      at = next;
    }
    branch.to = node_of_[at];
    if (body_.centres[at] != graph_.nodes[branch.to]) branch.points.push_back(body_.centres[at]);
    branch.points.push_back(graph_.nodes[branch.to]);
    graph_.branches.push_back(std::move(branch));
  }

  /// Closed curves without a node get one, at their deepest voxel.
  void trace_loops() {
    std::vector<int> order = voxels_;
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return body_.radii[a] > body_.radii[b]; });
    for (const int v : order) {
      if (is_seen_[v] || node_of_[v] >= 0) continue;
      node_of_[v] = static_cast<int>(graph_.nodes.size());
      graph_.nodes.push_back(body_.centres[v]);
      trace(v, neighbours_[v][0]);
    }
  }

  const VoxelBody& body_;
  std::vector<int> voxels_;
  std::vector<std::vector<int>> neighbours_;
  std::vector<int> node_of_;
  std::vector<char> is_seen_;
  CurveGraph graph_;
};

/// Removes nodes that no branch ends at.
void drop_unused_nodes(CurveGraph& graph) {
  const std::vector<int> degree = graph.degrees();
  std::vector<int> number(graph.nodes.size(), -1);
  std::vector<Vec3> nodes;
  for (std::size_t n = 0; n < number.size(); ++n)
    if (degree[n] > 0) number[n] = static_cast<int>(nodes.size()), nodes.push_back(graph.nodes[n]);
  for (Branch& branch : graph.branches) branch.from = number[branch.from], branch.to = number[branch.to];
  graph.nodes = std::move(nodes);
}

double length_of(const Branch& branch) {
  double length = 0;
  for (std::size_t i = 1; i < branch.points.size(); ++i) length += (branch.points[i] - branch.points[i - 1]).norm();
  return length;
}

void reverse(Branch& branch) {
  std::swap(branch.from, branch.to);
  std::reverse(branch.points.begin(), branch.points.end());
}

/// The place across a curve, within some distance of a point, that is deepest among a few.
Vec3 deepest_across(const Surface& surface, const Vec3& point, const Vec3& along, double distance) {
  constexpr int kAngles = 8;
  const Vec3 e = along.unitOrthogonal(), f = along.cross(e).normalized();
  Vec3 best = point;
  double radius = surface.radius(point);
  for (double step = distance; step > 0.2 * distance; step *= 0.6)
    for (int i = 0; i < kAngles; ++i) {
      const double angle = 2 * std::numbers::pi * i / kAngles;
      const Vec3 place = best + step * (portable::cos(angle) * e + portable::sin(angle) * f);
      if ((place - point).norm() > 1.5 * distance) continue;
      const double there = surface.radius(place);
      if (there > radius && !surface.is_between(best, place)) radius = there, best = place;
    }
  return best;
}

/// Smooths a curve; its ends stay.
void smooth(std::vector<Vec3>& points) {
  constexpr int kRounds = 12;
  for (int round = 0; round < kRounds; ++round) {
    Vec3 before = points[0];
    for (std::size_t i = 1; i + 1 < points.size(); ++i) {
      const Vec3 now = points[i];
      points[i] = 0.25 * before + 0.5 * now + 0.25 * points[i + 1];
      before = now;
    }
  }
}

/// The branch between two hubs of which one's ball holds the other, the nearest such; no loop, nor beside another one.
/// \return the number of branches where there is none
std::size_t find_bridge(const CurveGraph& graph, const std::vector<double>& radii) {
  const std::vector<int> degree = graph.degrees();
  std::size_t nearest = graph.branches.size();
  double least = 1;
  for (std::size_t b = 0; b < graph.branches.size(); ++b) {
    const Branch& branch = graph.branches[b];
    if (branch.from == branch.to || degree[branch.from] < 3 || degree[branch.to] < 3) continue;
    const auto is_parallel = [&](const Branch& other) {
      return &other != &branch && std::minmax(other.from, other.to) == std::minmax(branch.from, branch.to);
    };
    if (std::any_of(graph.branches.begin(), graph.branches.end(), is_parallel)) continue;
    const double near =
        (graph.nodes[branch.from] - graph.nodes[branch.to]).norm() / std::max(radii[branch.from], radii[branch.to]);
    if (near < least) least = near, nearest = b;
  }
  return nearest;
}

}  // namespace

std::vector<int> CurveGraph::degrees() const {
  std::vector<int> degree(nodes.size(), 0);
  for (const Branch& branch : branches) ++degree[branch.from], ++degree[branch.to];
  return degree;
}

CurveGraph make_curve_graph(const VoxelBody& body, const std::vector<char>& is_left) {
  return Tracer(body, is_left).run();
}

void limit_cycles(const Surface& surface, int cycles, CurveGraph& graph) {
  if (graph.cycles() <= cycles) return;
  struct Width {
    std::size_t branch;
    double least, length;
  };
  std::vector<Width> widths;
  for (std::size_t b = 0; b < graph.branches.size(); ++b) {
    const Branch& branch = graph.branches[b];
    double least = surface.diagonal;
    for (const Vec3& p : branch.points) least = std::min(least, surface.radius(p));
    widths.push_back({b, least, length_of(branch)});
  }
  std::stable_sort(widths.begin(), widths.end(), [](const Width& a, const Width& b) { return a.least > b.least; });
  UnionFind sets(static_cast<int>(graph.nodes.size()));
  std::vector<char> is_kept(graph.branches.size(), 0);
  std::vector<Width> others;
  for (const Width& width : widths) {
    const Branch& branch = graph.branches[width.branch];
    if (sets.find(branch.from) == sets.find(branch.to)) {
      others.push_back(width);
      continue;
    }
    sets.unite(branch.from, branch.to);
    is_kept[width.branch] = 1;
  }
  // A loop that is short for its place is a fault of the voxels, not a handle.
  std::stable_sort(others.begin(), others.end(),
                   [](const Width& a, const Width& b) { return (a.length > 6 * a.least) > (b.length > 6 * b.least); });
  for (int c = 0; c < cycles && c < static_cast<int>(others.size()); ++c) is_kept[others[c].branch] = 1;
  std::vector<Branch> kept;
  for (std::size_t b = 0; b < graph.branches.size(); ++b)
    if (is_kept[b]) kept.push_back(std::move(graph.branches[b]));
  graph.branches = std::move(kept);
  join_branches(graph);
}

void join_branches(CurveGraph& graph) {
  for (std::size_t n = 0; n < graph.nodes.size(); ++n) {
    std::vector<std::size_t> at;
    for (std::size_t b = 0; b < graph.branches.size(); ++b) {
      if (graph.branches[b].from == static_cast<int>(n)) at.push_back(b);
      if (graph.branches[b].to == static_cast<int>(n)) at.push_back(b);
    }
    if (at.size() != 2 || at[0] == at[1]) continue;
    Branch &first = graph.branches[at[0]], &second = graph.branches[at[1]];
    if (first.to != static_cast<int>(n)) reverse(first);
    if (second.from != static_cast<int>(n)) reverse(second);
    first.points.insert(first.points.end(), second.points.begin() + 1, second.points.end());
    first.to = second.to;
    graph.branches.erase(graph.branches.begin() + static_cast<std::ptrdiff_t>(at[1]));
  }
  drop_unused_nodes(graph);
}

void smooth_branches(const Surface& surface, double voxel_side, CurveGraph& graph) {
  constexpr double kThin = 2;  // radii below so many voxels are centred
  for (Branch& branch : graph.branches) {
    const std::vector<Vec3> original = branch.points;
    std::vector<Vec3>& points = branch.points;
    smooth(points);
    for (std::size_t i = 1; i + 1 < points.size(); ++i) {
      const Vec3 along = points[i + 1] - points[i - 1];
      if (along.norm() > 0 && surface.radius(points[i]) < kThin * voxel_side &&
          !surface.is_between(original[i], points[i]))
        points[i] = deepest_across(surface, points[i], along, voxel_side);
    }
    // Where it leaves the body, the voxels' centres come back.
    for (int round = 0; round < 3; ++round)
      for (std::size_t i = 0; i + 1 < points.size(); ++i)
        if (surface.is_between(points[i], points[i + 1])) points[i] = original[i], points[i + 1] = original[i + 1];
    for (std::size_t i = 0; i + 1 < points.size(); ++i)
      if (surface.is_between(points[i], points[i + 1])) {
        points = original;
        break;
      }
  }
}

void merge_hubs(const Surface& surface, CurveGraph& graph) {
  for (;;) {
    std::vector<double> radii;
    for (const Vec3& node : graph.nodes) radii.push_back(surface.radius(node));
    const std::size_t nearest = find_bridge(graph, radii);
    if (nearest == graph.branches.size()) return;
    Branch bridge = std::move(graph.branches[nearest]);
    graph.branches.erase(graph.branches.begin() + static_cast<std::ptrdiff_t>(nearest));
    if (radii[bridge.from] < radii[bridge.to]) reverse(bridge);  // `from` stays
    for (Branch& branch : graph.branches)
      for (int side = 0; side < 2; ++side) {
        if (branch.from == bridge.to) {
          branch.points.insert(branch.points.begin(), bridge.points.begin(), bridge.points.end() - 1);
          branch.from = bridge.from;
        }
        reverse(branch);
      }
    drop_unused_nodes(graph);
  }
}

}  // namespace skeletex
