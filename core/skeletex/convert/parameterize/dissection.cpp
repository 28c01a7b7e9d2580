// SPDX-License-Identifier: MIT
#include "skeletex/convert/parameterize/dissection.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <span>

namespace skeletex {
namespace {

constexpr std::size_t kLeaf = 32;  // up to so many vertices are not divided

/// A vertex as it is sorted.
struct Item {
  std::array<float, 3> at;
  float longest_edge;  ///< at this vertex
  int vertex;
};

class Dissector {
 public:
  Dissector(const SparseGraph& graph, Dissection& result)
      : graph_(graph), d_(result), side_(graph.positions.size(), 0) {
    items_.reserve(d_.order.size());
    for (const int v : d_.order) {
      double longest2 = 0;
      for (const int w : graph.neighbours(v))
        longest2 = std::max(longest2, (graph.positions[w] - graph.positions[v]).squaredNorm());
      const Eigen::Vector3f p = graph.positions[v].cast<float>();
      // More than rounding can take away.
      items_.push_back({{p.x(), p.y(), p.z()},
                        1.0001f * static_cast<float>(std::sqrt(longest2)) + 1e-6f * p.cwiseAbs().maxCoeff(),
                        v});
    }
  }

  /// Orders the first `end` vertices; the rest is one more front.
  void run(int end) {
    std::vector<int> roots = divide(0, end);
    if (const int all = static_cast<int>(d_.order.size()); end < all)
      d_.fronts[add_front(end, all, std::move(roots))].is_last = true;
    for (std::size_t i = 0; i < items_.size(); ++i) d_.order[i] = items_[i].vertex;
    find_boundaries();
  }

 private:
  static constexpr signed char kLeft = 1, kRight = 2, kSeparator = 4;

  /// Orders items_[begin] to items_[end - 1].
  /// \return the fronts that have no parent yet
  std::vector<int> divide(int begin, int end) {
    if (begin == end) return {};
    const std::span<Item> all = std::span(items_).subspan(begin, end - begin);
    if (all.size() <= kLeaf) return {add_front(begin, end, {})};
    const auto middle = all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2);
    const int axis = longest_axis(all);
    std::nth_element(all.begin(), middle, all.end(),
                     [&](const Item& a, const Item& b) { return a.at[axis] < b.at[axis]; });
    const float border = middle->at[axis];
    // Only vertices with an edge that is long enough can have a neighbour beyond the border.
    near_.clear();
    for (auto item = all.begin(); item != all.end(); ++item)
      if (std::abs(item->at[axis] - border) <= item->longest_edge) {
        side_[item->vertex] = item < middle ? kLeft : kRight;
        near_.push_back(item->vertex);
      }
    const auto is_at_cut = [&](int v) {
      const std::span<const int> near = graph_.neighbours(v);
      return std::any_of(near.begin(), near.end(), [&](int w) { return side_[w] == kLeft + kRight - side_[v]; });
    };
    // The half that has fewer vertices at the cut gives them.
    for (std::vector<int>& cut : cuts_) cut.clear();
    for (const int v : near_)
      if (is_at_cut(v)) cuts_[side_[v] == kRight].push_back(v);
    const bool is_right = cuts_[1].size() < cuts_[0].size();
    const std::vector<int>& separator = cuts_[is_right];
    for (const int v : separator) side_[v] = kSeparator;
    const auto is_kept = [&](const Item& item) { return side_[item.vertex] != kSeparator; };
    auto left_end = middle, right_end = all.end();
    if (is_right) {
      right_end = std::stable_partition(middle, all.end(), is_kept);
    } else {
      left_end = std::stable_partition(all.begin(), middle, is_kept);
      right_end = std::rotate(left_end, middle, all.end());
    }
    for (const int v : near_) side_[v] = 0;
    const int left = begin + static_cast<int>(left_end - all.begin()),
              right = begin + static_cast<int>(right_end - all.begin());
    std::vector<int> children = divide(begin, left);
    for (const int child : divide(left, right)) children.push_back(child);
    if (right == end) return children;
    return {add_front(right, end, std::move(children))};
  }

  void find_boundaries() {
    const int count = static_cast<int>(d_.order.size());
    d_.number.assign(side_.size(), -1);
    for (int i = 0; i < count; ++i) d_.number[d_.order[i]] = i;
    std::vector<int> seen(count, -1);
    for (int f = 0; f < static_cast<int>(d_.fronts.size()); ++f) {
      Front& front = d_.fronts[f];
      const int after = front.first + front.pivots;
      const auto take = [&](int number) {
        if (number < after || seen[number] == f) return;
        seen[number] = f;
        front.boundary.push_back(number);
      };
      for (int i = front.first; i < after; ++i)
        for (const int v : graph_.neighbours(d_.order[i])) take(d_.number[v]);
      for (const int child : front.children)
        for (const int number : d_.fronts[child].boundary) take(number);
      std::sort(front.boundary.begin(), front.boundary.end());
    }
  }

  static int longest_axis(std::span<const Item> all) {
    std::array<float, 3> low = all.front().at, high = low;
    for (const Item& item : all)
      for (int k = 0; k < 3; ++k) {
        low[k] = std::min(low[k], item.at[k]);
        high[k] = std::max(high[k], item.at[k]);
      }
    int axis = 0;
    for (const int k : {1, 2})
      if (high[k] - low[k] > high[axis] - low[axis]) axis = k;
    return axis;
  }

  int add_front(int begin, int end, std::vector<int> children) {
    const int id = static_cast<int>(d_.fronts.size());
    Front front;
    front.first = begin;
    front.pivots = front.size = end - begin;
    front.subtree = children.empty() ? id : d_.fronts[children.front()].subtree;
    for (const int child : children) {
      d_.fronts[child].parent = id;
      front.size += d_.fronts[child].size;
    }
    front.children = std::move(children);
    d_.fronts.push_back(std::move(front));
    return id;
  }

  const SparseGraph& graph_;
  Dissection& d_;
  std::vector<Item> items_;
  std::vector<signed char> side_;
  std::vector<int> near_;
  std::array<std::vector<int>, 2> cuts_;
};

}  // namespace

Dissection dissect(const SparseGraph& graph) {
  Dissection d;
  for (int v = 0; v < static_cast<int>(graph.positions.size()); ++v)
    if (graph.is_unknown[v]) d.order.push_back(v);
  const auto last = std::stable_partition(d.order.begin(), d.order.end(), [&](int v) { return graph.is_last[v] == 0; });
  Dissector(graph, d).run(static_cast<int>(last - d.order.begin()));
  return d;
}

}  // namespace skeletex
