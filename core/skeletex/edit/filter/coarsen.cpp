// SPDX-License-Identifier: MIT
#include "skeletex/edit/filter/coarsen.h"

#include <algorithm>
#include <cmath>

#include "skeletex/reconstruct/seam_strip.h"
#include "skeletex/skeleton/separation_planes.h"

namespace skeletex {
namespace {

/// `kept` + 1 of `count` + 1 steps: the first, the last, and evenly spaced ones between them.
std::vector<int> spaced_steps(int count, int kept) {
  std::vector<int> steps;
  for (int i = 0; i <= kept; ++i) steps.push_back(static_cast<int>(std::lround(static_cast<double>(i) * count / kept)));
  return steps;
}

int half(int count, int least) { return std::min(count, std::max(least, (count + 1) / 2)); }

/// Where a step of the finer lattice lies between the kept ones.
struct Place {
  int before;    ///< number of the kept step before it
  double share;  ///< of the way to the next one
};
std::vector<Place> places_between(const std::vector<int>& steps) {
  std::vector<Place> places;
  for (int i = 0; i + 1 < static_cast<int>(steps.size()); ++i)
    for (int step = steps[i]; step < steps[i + 1]; ++step)
      places.push_back({i, static_cast<double>(step - steps[i]) / (steps[i + 1] - steps[i])});
  places.push_back({static_cast<int>(steps.size()) - 1, 0});
  return places;
}

/// A value as a sum of at most four others.
struct Mix {
  std::array<int, 4> sources{0, 0, 0, 0};
  std::array<float, 4> shares{0, 0, 0, 0};
  int count = 0;
  Mix() = default;
  explicit Mix(int source) { add(source, 1); }
  void add(int source, double share) {
    if (share == 0) return;
    sources[count] = source;
    shares[count++] = static_cast<float>(share);
  }
};

/// The two vertices of a seam's loop on both sides of each column.
std::vector<Mix> loop_at_columns(const CoarseLattice& coarse, const SeparationPlanes& separation, BoneIndex bone,
                                 BoneEnd end, int columns) {
  const std::vector<int> loop = end_loop(coarse.model, coarse.lattice, bone, end);
  const int count = static_cast<int>(loop.size());
  std::vector<Vec3> points;
  std::vector<double> angles;
  for (const VertexIndex vertex : loop) {
    points.push_back(coarse.positions[vertex]);
    angles.push_back(separation.turn_of(bone, points.back() - end_position(coarse.model.skeleton, bone, end)));
  }
  std::vector<double> turns = seam_turns(points, angles);
  turns.push_back(turns[0] + 1);
  std::vector<Mix> mixes(columns);
  for (int j = 0; j < columns; ++j) {
    double turn = static_cast<double>(j) / columns;
    if (turn < turns[0]) turn += 1;
    const int i = std::clamp(static_cast<int>(std::upper_bound(turns.begin(), turns.end(), turn) - turns.begin()) - 1,
                             0, count - 1);
    const double width = turns[i + 1] - turns[i],
                 share = width > 0 ? std::clamp((turn - turns[i]) / width, 0.0, 1.0) : 0;
    mixes[j].add(loop[i], 1 - share);
    mixes[j].add(loop[(i + 1) % count], share);
  }
  return mixes;
}

/// Makes a coarser lattice of a finer one.
class Coarsening {
 public:
  Coarsening(const SkeletexModel& model, const Lattice& lattice)
      : model_(model),
        lattice_(lattice),
        bones_(static_cast<int>(model.patches.size())),
        rows_(bones_),
        columns_(bones_),
        samples_(model.arcs.size()) {}

  CoarseLattice run(const std::vector<Vec3>& positions) {
    choose_steps();
    pick_vertices();
    for (const VertexIndex vertex : coarse_.picks) coarse_.positions.push_back(positions[vertex]);
    coarse_.sources.resize(lattice_.vertex_count);
    coarse_.shares.resize(lattice_.vertex_count);
    const SeparationPlanes separation(model_.skeleton);
    for (BoneIndex bone = 0; bone < bones_; ++bone) mix_patch(separation, bone);
    for (std::size_t a = 0; a < model_.arcs.size(); ++a) mix_arc(a);
    for (int c = 0; c < static_cast<int>(model_.corners.size()); ++c)
      set(lattice_.first_corner + c, Mix(coarse_.lattice.first_corner + c));
    return std::move(coarse_);
  }

 private:
  /// Chooses the rows, columns and samples that are kept, and makes a model of them.
  void choose_steps() {
    SkeletexModel& coarse = coarse_.model;
    coarse.skeleton = model_.skeleton;
    coarse.origin = model_.origin;
    coarse.patches = model_.patches;
    coarse.ends = model_.ends;
    coarse.arcs = model_.arcs;
    coarse.corners = model_.corners;
    for (BoneIndex bone = 0; bone < bones_; ++bone) {
      Rectangle& rectangle = coarse.patches[bone].rectangle;
      rows_[bone] = spaced_steps(rectangle.height - 1, half(rectangle.height, 4) - 1);
      columns_[bone] = spaced_steps(rectangle.width, half(rectangle.width, 4));
      rectangle.width = static_cast<int>(columns_[bone].size()) - 1;
      rectangle.height = static_cast<int>(rows_[bone].size());
    }
    for (std::size_t a = 0; a < model_.arcs.size(); ++a) {
      // Steps of an open arc run from corner to corner, of a closed one from its first sample to its first.
      const int count = static_cast<int>(model_.arcs[a].samples.size());
      const bool is_closed = model_.arcs[a].is_closed();
      samples_[a] = is_closed ? spaced_steps(count, half(count, 3)) : spaced_steps(count + 1, half(count, 1) + 1);
      coarse.arcs[a].samples.resize(samples_[a].size() - (is_closed ? 1 : 2));
    }
    coarse_.lattice = number_lattice(coarse);
  }

  void pick_vertices() {
    std::vector<int>& picks = coarse_.picks;
    picks.resize(coarse_.lattice.vertex_count);
    for (BoneIndex bone = 0; bone < bones_; ++bone) {
      const auto [x, y, width, height] = coarse_.model.patches[bone].rectangle;
      for (int row = 1; row + 1 < height; ++row)
        for (int j = 0; j < width; ++j)
          picks[coarse_.lattice.first_inner[bone] + (row - 1) * width + j] =
              lattice_.first_inner[bone] + (rows_[bone][row] - 1) * model_.patches[bone].rectangle.width +
              columns_[bone][j];
      for (const int end : {0, 1})
        if (lattice_.poles[bone][end] >= 0) picks[coarse_.lattice.poles[bone][end]] = lattice_.poles[bone][end];
    }
    for (std::size_t a = 0; a < model_.arcs.size(); ++a)
      for (int i = 0; i < static_cast<int>(coarse_.model.arcs[a].samples.size()); ++i) {
        const int step = model_.arcs[a].is_closed() ? samples_[a][i] : samples_[a][i + 1] - 1;
        picks[coarse_.lattice.first_sample[a] + i] = lattice_.first_sample[a] + step;
        coarse_.model.arcs[a].samples[i] = model_.arcs[a].samples[step];
      }
    for (int c = 0; c < static_cast<int>(model_.corners.size()); ++c)
      picks[coarse_.lattice.first_corner + c] = lattice_.first_corner + c;
  }

  void set(VertexIndex vertex, const Mix& mix) {
    coarse_.sources[vertex] = mix.sources;
    coarse_.shares[vertex] = mix.shares;
  }

  /// The inner rows and the poles of a patch.
  void mix_patch(const SeparationPlanes& separation, BoneIndex bone) {
    const Rectangle &fine = model_.patches[bone].rectangle, &coarse = coarse_.model.patches[bone].rectangle;
    const std::vector<Place> rows = places_between(rows_[bone]), columns = places_between(columns_[bone]);
    std::array<std::vector<Mix>, 2> ends;
    for (const int end : {0, 1}) {
      const int pole = coarse_.lattice.poles[bone][end];
      if (pole >= 0) set(lattice_.poles[bone][end], Mix(pole));
      ends[end] = pole >= 0 ? std::vector<Mix>(fine.width, Mix(pole))
                            : loop_at_columns(coarse_, separation, bone, static_cast<BoneEnd>(end), fine.width);
    }
    // Adds a coarse row's values at a column.
    const auto add_row = [&](int row, int j, double share, Mix& mix) {
      if (share == 0) return;
      if (row == 0 || row + 1 == coarse.height) {
        const Mix& end = ends[row == 0 ? 0 : 1][j];
        for (int i = 0; i < end.count; ++i) mix.add(end.sources[i], share * static_cast<double>(end.shares[i]));
        return;
      }
      const int first = coarse_.lattice.first_inner[bone] + (row - 1) * coarse.width, left = columns[j].before;
      mix.add(first + left, share * (1 - columns[j].share));
      mix.add(first + (left + 1) % coarse.width, share * columns[j].share);
    };
    for (int row = 1; row + 1 < fine.height; ++row)
      for (int j = 0; j < fine.width; ++j) {
        Mix mix;
        add_row(rows[row].before, j, 1 - rows[row].share, mix);
        add_row(rows[row].before + 1, j, rows[row].share, mix);
        set(lattice_.first_inner[bone] + (row - 1) * fine.width + j, mix);
      }
  }

  void mix_arc(std::size_t a) {
    const SeamArc& arc = model_.arcs[a];
    const std::vector<Place> places = places_between(samples_[a]);
    const int kept = static_cast<int>(samples_[a].size()) - 1;
    const auto vertex_at = [&](int i) {
      if (arc.is_closed()) return coarse_.lattice.first_sample[a] + i % kept;
      return i == 0      ? coarse_.lattice.first_corner + arc.corners[0]
             : i == kept ? coarse_.lattice.first_corner + arc.corners[1]
                         : coarse_.lattice.first_sample[a] + i - 1;
    };
    for (int i = 0; i < static_cast<int>(arc.samples.size()); ++i) {
      const Place& place = places[arc.is_closed() ? i : i + 1];
      Mix mix;
      mix.add(vertex_at(place.before), 1 - place.share);
      mix.add(vertex_at(place.before + 1), place.share);
      set(lattice_.first_sample[a] + i, mix);
    }
  }

  const SkeletexModel& model_;
  const Lattice& lattice_;
  int bones_;
  std::vector<std::vector<int>> rows_, columns_;  ///< per bone, the steps that are kept
  std::vector<std::vector<int>> samples_;         ///< per arc
  CoarseLattice coarse_;
};

}  // namespace

CoarseLattice coarsen(const SkeletexModel& model, const Lattice& lattice, const std::vector<Vec3>& positions) {
  return Coarsening(model, lattice).run(positions);
}

}  // namespace skeletex
