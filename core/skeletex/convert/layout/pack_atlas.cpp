// SPDX-License-Identifier: MIT
#include "skeletex/convert/layout/pack_atlas.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <random>

#include "skeletex/math/portable.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

constexpr int kMinSide = 4;
// The effort of the search: about 15 ms for 40 patches, less for fewer.
constexpr int kSteps = 14000;
constexpr int kStepsPerStart = 3500;

/// A node of the kd-tree. Leaves are 0 .. n-1 and carry the patch of the same index; n .. 2n-2 are splits.
struct KdNode {
  std::int16_t parent = -1;
  std::int16_t children[2] = {-1, -1};
  bool splits_width = true;
};

/// The requests in the form that the search needs.
struct Wanted {
  int width = 0, height = 0;
  std::vector<double> share;       // sums to 1, none below the smallest rectangle's
  std::vector<double> log_area;    // of the rectangle, in texels
  std::vector<double> log_aspect;  // columns / rows
  std::vector<double> weight;
  std::vector<double> log_of;  // logarithms of 0 .. max(width, height), so that the search calls none

  int count() const { return static_cast<int>(share.size()); }
};

class KdTree {
 public:
  explicit KdTree(const Wanted& wanted)
      : wanted_(&wanted), leaves_(wanted.count()), nodes_(2 * leaves_ - 1), measures_(nodes_.size()) {}

  /// Rows of leaves in the given order: feasible whenever any tree is.
  void build_rows(const std::vector<int>& order) {
    const int per_row_limit = wanted_->width / kMinSide;
    const int row_limit = wanted_->height / kMinSide;
    const int rows = std::clamp(
        static_cast<int>(std::lround(std::sqrt(static_cast<double>(leaves_) * wanted_->height / wanted_->width))),
        (leaves_ + per_row_limit - 1) / per_row_limit, std::min(row_limit, leaves_));
    next_ = leaves_;
    std::vector<int> row_roots;
    for (int r = 0, begin = 0; r < rows; ++r) {
      const int end = static_cast<int>(static_cast<long>(leaves_) * (r + 1) / rows);
      row_roots.push_back(build_balanced({order.begin() + begin, order.begin() + end}, true));
      begin = end;
    }
    root_ = build_balanced(row_roots, false);
    nodes_[root_].parent = -1;
  }

  /// Sum over the patches of the squared logarithms of how far side ratio and area are off; infinite when a rectangle
  /// would be too small.
  double cost() {
    measure(root_);
    const Measure& all = measures_[root_];
    if (all.min_width > wanted_->width || all.min_height > wanted_->height)
      return std::numeric_limits<double>::infinity();
    return place(root_, {0, 0, wanted_->width, wanted_->height}, nullptr);
  }

  std::vector<Rectangle> rectangles() {
    std::vector<Rectangle> found(leaves_);
    measure(root_);
    place(root_, {0, 0, wanted_->width, wanted_->height}, &found);
    return found;
  }

  /// A random change: the cut's direction, two subtrees, or the place of one subtree.
  void mutate(std::mt19937& random) {
    if (leaves_ < 2) return;
    const unsigned kind = random() % 8;
    if (kind < 2) {
      KdNode& node = nodes_[leaves_ + pick(random, leaves_ - 1)];
      node.splits_width = !node.splits_width;
      return;
    }
    const int a = pick(random, static_cast<int>(nodes_.size())), b = pick(random, static_cast<int>(nodes_.size()));
    if (is_above(a, b) || is_above(b, a)) return;
    if (kind < 5)
      swap_subtrees(a, b);
    else
      move_subtree(a, b, random() % 2 == 0);
  }

 private:
  struct Measure {
    double share = 0;
    int min_width = 0, min_height = 0;
  };

  static int pick(std::mt19937& random, int count) { return static_cast<int>(random() % static_cast<unsigned>(count)); }

  void link(int parent, int side, int child) {
    nodes_[parent].children[side] = static_cast<std::int16_t>(child);
    nodes_[child].parent = static_cast<std::int16_t>(parent);
  }

  int build_balanced(const std::vector<int>& items, bool splits_width) {
    if (items.size() == 1) return items[0];
    const int node = next_++;
    const auto middle = items.begin() + static_cast<long>(items.size() / 2);
    nodes_[node].splits_width = splits_width;
    link(node, 0, build_balanced({items.begin(), middle}, splits_width));
    link(node, 1, build_balanced({middle, items.end()}, splits_width));
    return node;
  }

  bool is_above(int a, int b) const {
    for (int node = b; node >= 0; node = nodes_[node].parent)
      if (node == a) return true;
    return false;
  }

  int side_of(int node) const { return nodes_[nodes_[node].parent].children[1] == node ? 1 : 0; }

  void swap_subtrees(int a, int b) {
    const int parent_a = nodes_[a].parent, parent_b = nodes_[b].parent;
    const int side_a = side_of(a), side_b = side_of(b);
    link(parent_a, side_a, b);
    link(parent_b, side_b, a);
  }

  void move_subtree(int moved, int target, bool splits_width) {
    const int joint = nodes_[moved].parent;
    const int sibling = nodes_[joint].children[1 - side_of(moved)];
    if (target == sibling) return;
    const int above = nodes_[joint].parent;
    if (above < 0) {
      root_ = sibling;
      nodes_[sibling].parent = -1;
    } else {
      link(above, side_of(joint), sibling);
    }
    const int new_above = nodes_[target].parent;
    if (new_above < 0) {
      root_ = joint;
      nodes_[joint].parent = -1;
    } else {
      link(new_above, side_of(target), joint);
    }
    nodes_[joint].splits_width = splits_width;
    link(joint, 0, target);
    link(joint, 1, moved);
  }

  const Measure& measure(int node) {
    Measure& m = measures_[node];
    if (node < leaves_) {
      m = {wanted_->share[node], kMinSide, kMinSide};
      return m;
    }
    const Measure& a = measure(nodes_[node].children[0]);
    const Measure& b = measure(nodes_[node].children[1]);
    m.share = a.share + b.share;
    m.min_width = nodes_[node].splits_width ? a.min_width + b.min_width : std::max(a.min_width, b.min_width);
    m.min_height = nodes_[node].splits_width ? std::max(a.min_height, b.min_height) : a.min_height + b.min_height;
    return m;
  }

  static int cut(int side, double share, int minimum, int minimum_of_rest) {
    return std::clamp(static_cast<int>(static_cast<double>(side) * share + 0.5), minimum, side - minimum_of_rest);
  }

  double place(int node, const Rectangle& at, std::vector<Rectangle>* rectangles) const {
    if (node < leaves_) {
      if (rectangles) (*rectangles)[node] = at;
      const double log_width = wanted_->log_of[at.width], log_height = wanted_->log_of[at.height];
      const double aspect = log_width - log_height - wanted_->log_aspect[node];
      const double area = log_width + log_height - wanted_->log_area[node];
      return wanted_->weight[node] * (aspect * aspect + area * area);
    }
    const int a = nodes_[node].children[0], b = nodes_[node].children[1];
    const double share = measures_[a].share / measures_[node].share;
    Rectangle first = at, second = at;
    if (nodes_[node].splits_width) {
      first.width = cut(at.width, share, measures_[a].min_width, measures_[b].min_width);
      second.x += first.width;
      second.width -= first.width;
    } else {
      first.height = cut(at.height, share, measures_[a].min_height, measures_[b].min_height);
      second.y += first.height;
      second.height -= first.height;
    }
    return place(a, first, rectangles) + place(b, second, rectangles);
  }

  const Wanted* wanted_;
  int leaves_;
  int root_ = 0;
  int next_ = 0;
  std::vector<KdNode> nodes_;
  std::vector<Measure> measures_;
};

/// Shares that sum to 1 with none below that of the smallest rectangle: what the small ones gain the others lose.
std::vector<double> raised_shares(std::span<const PatchRequest> requests, double smallest) {
  const int count = static_cast<int>(requests.size());
  std::vector<double> shares(count);
  std::vector<bool> is_raised(count, false);
  for (;;) {
    double left = 1, sum = 0;
    for (int i = 0; i < count; ++i) (is_raised[i] ? left : sum) += is_raised[i] ? -smallest : requests[i].share;
    bool is_settled = true;
    for (int i = 0; i < count; ++i) {
      shares[i] = is_raised[i] ? smallest : requests[i].share / sum * left;
      if (!is_raised[i] && shares[i] < smallest) {
        is_raised[i] = true;
        is_settled = false;
      }
    }
    if (is_settled) return shares;
  }
}

Wanted wanted_from(std::span<const PatchRequest> requests, int width, int height) {
  Wanted wanted;
  wanted.width = width;
  wanted.height = height;
  const double texels = static_cast<double>(width) * height;
  wanted.share =
      raised_shares(requests, std::min(kMinSide * kMinSide / texels, 1.0 / static_cast<double>(requests.size())));
  for (int i = 0; i < wanted.count(); ++i) {
    wanted.log_area.push_back(portable::log(wanted.share[i] * texels));
    wanted.log_aspect.push_back(portable::log(requests[i].columns_per_row));
    // Large patches matter most, but no small one shall be ruined for them.
    wanted.weight.push_back(0.8 * wanted.share[i] + 0.2 / wanted.count());
  }
  wanted.log_of.resize(std::max(width, height) + 1, 0);
  for (std::size_t i = 1; i < wanted.log_of.size(); ++i) wanted.log_of[i] = portable::log(static_cast<double>(i));
  return wanted;
}

int fitting_patches(int width, int height) { return (width / kMinSide) * (height / kMinSide); }

void check_input(std::span<const PatchRequest> requests, int width, int height) {
  const int count = static_cast<int>(requests.size());
  if (count == 0) throw InputError("there is no bone to give texels to; the skeleton needs at least one bone");
  for (int i = 0; i < count; ++i)
    if (!(requests[i].share > 0 && requests[i].columns_per_row > 0) || !std::isfinite(requests[i].share) ||
        !std::isfinite(requests[i].columns_per_row))
      throw InputError(fmt::format("patch {} asks for a share of {} and a side ratio of {}; both must be positive", i,
                                   requests[i].share, requests[i].columns_per_row));
  if (width >= 1 && height >= 1 && fitting_patches(width, height) >= count) return;
  // The smallest texture of the same proportions that holds them.
  const double ratio = width >= 1 && height >= 1 ? static_cast<double>(height) / width : 1;
  int fit_width = kMinSide, fit_height = kMinSide;
  const auto fits = [&] { return fitting_patches(fit_width, fit_height) >= count; };
  if (ratio <= 1) {
    for (; (fit_height = std::max(kMinSide, static_cast<int>(std::ceil(fit_width * ratio)))), !fits(); ++fit_width) {
    }
  } else {
    for (; (fit_width = std::max(kMinSide, static_cast<int>(std::ceil(fit_height / ratio)))), !fits(); ++fit_height) {
    }
  }
  throw InputError(
      fmt::format("a texture of {} x {} texels is too small for {} bones, which need at least {} x {} texels each; use "
                  "{} x {} or more",
                  width, height, count, kMinSide, kMinSide, fit_width, fit_height));
}

}  // namespace

AtlasLayout pack_atlas(std::span<const PatchRequest> requests, int width, int height) {
  check_input(requests, width, height);
  const Wanted wanted = wanted_from(requests, width, height);
  const int count = wanted.count();

  std::vector<int> order(count);
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return wanted.log_aspect[a] < wanted.log_aspect[b]; });

  KdTree best(wanted);
  best.build_rows(order);
  double best_cost = best.cost();
  // Threshold accepting (a simulated annealing without logarithms) from a few starts. The generator's raw numbers are
  // the same everywhere, so the layout is, too.
  std::mt19937 random(1);
  const int restarts = std::clamp(40 / count, 1, kSteps / kStepsPerStart);
  const int steps = kSteps / restarts;
  for (int restart = 0; restart < restarts && count > 1; ++restart) {
    KdTree tree(wanted), changed(wanted);
    if (restart > 0)
      for (int i = count - 1; i > 0; --i) std::swap(order[i], order[random() % static_cast<unsigned>(i + 1)]);
    tree.build_rows(order);
    double cost = tree.cost();
    for (int step = 0; step < steps; ++step) {
      const double cooling = 1 - static_cast<double>(step) / steps;
      const double threshold = 2.0 / count * cooling * cooling * cooling;
      changed = tree;
      changed.mutate(random);
      const double changed_cost = changed.cost();
      if (changed_cost > cost + threshold) continue;
      std::swap(tree, changed);
      cost = changed_cost;
      if (cost < best_cost) {
        best = tree;
        best_cost = cost;
      }
    }
  }

  AtlasLayout layout{best.rectangles(), 0};
  double used = 0;
  for (const Rectangle& r : layout.rectangles) used += static_cast<double>(r.width) * r.height;
  layout.used_fraction = used / (static_cast<double>(width) * height);
  return layout;
}

}  // namespace skeletex
