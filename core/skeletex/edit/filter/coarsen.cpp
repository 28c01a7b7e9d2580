// SPDX-License-Identifier: MIT
#include "skeletex/edit/filter/coarsen.h"

#include <algorithm>
#include <cmath>

#include "skeletex/reconstruct/seam_strip.h"
#include "skeletex/skeleton/separation_planes.h"

namespace skeletex {
namespace {

/// Of `count` + 1 steps those that stay, `kept` + 1 of them: the first, the last, and evenly between.
std::vector<int> evenly(int count, int kept) {
  std::vector<int> steps;
  for (int i = 0; i <= kept; ++i) steps.push_back(static_cast<int>(std::lround(static_cast<double>(i) * count / kept)));
  return steps;
}

int half(int count, int least) { return std::min(count, std::max(least, (count + 1) / 2)); }

/// Where a step lies between those that stay.
struct Place {
  int before;    ///< number among those that stay
  double share;  ///< of the way to the next
};
std::vector<Place> places_between(const std::vector<int>& steps) {
  std::vector<Place> places;
  for (int i = 0; i + 1 < static_cast<int>(steps.size()); ++i)
    for (int step = steps[i]; step < steps[i + 1]; ++step)
      places.push_back({i, static_cast<double>(step - steps[i]) / (steps[i + 1] - steps[i])});
  places.push_back({static_cast<int>(steps.size()) - 1, 0});
  return places;
}

/// A value as a sum of at most four others'.
struct Mix {
  std::array<int, 4> sources{0, 0, 0, 0};
  std::array<float, 4> shares{0, 0, 0, 0};
  int count = 0;
  void add(int source, double share) {
    if (share == 0) return;
    sources[count] = source;
    shares[count++] = static_cast<float>(share);
  }
};

/// The two vertices of a seam's loop on both sides of each column.
std::vector<Mix> loop_at_columns(const CoarseLattice& coarse, const SeparationPlanes& separation, int bone, BoneEnd end,
                                 int columns) {
  const std::vector<int> loop = end_loop(coarse.model, coarse.lattice, bone, end);
  const int count = static_cast<int>(loop.size());
  std::vector<Vec3> points;
  std::vector<double> angles;
  for (const int vertex : loop) {
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

}  // namespace

CoarseLattice coarsen(const SkeletexModel& model, const Lattice& lattice, const std::vector<Vec3>& positions) {
  CoarseLattice coarse;
  coarse.model.skeleton = model.skeleton;
  coarse.model.origin = model.origin;
  coarse.model.patches = model.patches;
  coarse.model.ends = model.ends;
  coarse.model.arcs = model.arcs;
  coarse.model.corners = model.corners;

  const int bones = static_cast<int>(model.patches.size());
  std::vector<std::vector<int>> rows(bones), columns(bones), samples(model.arcs.size());
  for (int bone = 0; bone < bones; ++bone) {
    Rectangle& rectangle = coarse.model.patches[bone].rectangle;
    rows[bone] = evenly(rectangle.height - 1, half(rectangle.height, 4) - 1);
    columns[bone] = evenly(rectangle.width, half(rectangle.width, 4));
    rectangle.width = static_cast<int>(columns[bone].size()) - 1;
    rectangle.height = static_cast<int>(rows[bone].size());
  }
  for (std::size_t a = 0; a < model.arcs.size(); ++a) {
    // Steps of an open arc run from corner to corner, of a closed one from its first sample to its first.
    const int count = static_cast<int>(model.arcs[a].samples.size());
    const bool is_closed = model.arcs[a].is_closed();
    samples[a] = is_closed ? evenly(count, half(count, 3)) : evenly(count + 1, half(count, 1) + 1);
    coarse.model.arcs[a].samples.resize(samples[a].size() - (is_closed ? 1 : 2));
  }
  coarse.lattice = number_lattice(coarse.model);

  coarse.picks.resize(coarse.lattice.vertex_count);
  for (int bone = 0; bone < bones; ++bone) {
    const int width = coarse.model.patches[bone].rectangle.width, height = coarse.model.patches[bone].rectangle.height;
    for (int row = 1; row + 1 < height; ++row)
      for (int j = 0; j < width; ++j)
        coarse.picks[coarse.lattice.first_inner[bone] + (row - 1) * width + j] =
            lattice.first_inner[bone] + (rows[bone][row] - 1) * model.patches[bone].rectangle.width + columns[bone][j];
    for (const int end : {0, 1})
      if (lattice.poles[bone][end] >= 0) coarse.picks[coarse.lattice.poles[bone][end]] = lattice.poles[bone][end];
  }
  for (std::size_t a = 0; a < model.arcs.size(); ++a)
    for (int i = 0; i < static_cast<int>(coarse.model.arcs[a].samples.size()); ++i) {
      const int step = model.arcs[a].is_closed() ? samples[a][i] : samples[a][i + 1] - 1;
      coarse.picks[coarse.lattice.first_sample[a] + i] = lattice.first_sample[a] + step;
      coarse.model.arcs[a].samples[i] = model.arcs[a].samples[step];
    }
  for (std::size_t c = 0; c < model.corners.size(); ++c)
    coarse.picks[coarse.lattice.first_corner + static_cast<int>(c)] = lattice.first_corner + static_cast<int>(c);
  for (const int vertex : coarse.picks) coarse.positions.push_back(positions[vertex]);

  coarse.sources.resize(lattice.vertex_count);
  coarse.shares.resize(lattice.vertex_count);
  const auto set = [&](int vertex, const Mix& mix) {
    coarse.sources[vertex] = mix.sources;
    coarse.shares[vertex] = mix.shares;
  };
  const SeparationPlanes separation(model.skeleton);
  for (int bone = 0; bone < bones; ++bone) {
    const Rectangle &fine = model.patches[bone].rectangle, &here = coarse.model.patches[bone].rectangle;
    const std::vector<Place> row_places = places_between(rows[bone]), column_places = places_between(columns[bone]);
    std::array<std::vector<Mix>, 2> ends;
    for (const int end : {0, 1}) {
      const int pole = coarse.lattice.poles[bone][end];
      if (pole < 0) {
        ends[end] = loop_at_columns(coarse, separation, bone, static_cast<BoneEnd>(end), fine.width);
        continue;
      }
      ends[end].resize(fine.width);
      for (Mix& mix : ends[end]) mix.add(pole, 1);
      Mix mix;
      mix.add(pole, 1);
      set(lattice.poles[bone][end], mix);
    }
    for (int row = 1; row + 1 < fine.height; ++row)
      for (int j = 0; j < fine.width; ++j) {
        Mix mix;
        for (const int side : {0, 1}) {
          const int coarse_row = row_places[row].before + side;
          const double row_share = side == 0 ? 1 - row_places[row].share : row_places[row].share;
          if (row_share == 0) continue;
          if (coarse_row == 0 || coarse_row + 1 == here.height) {
            const Mix& end = ends[coarse_row == 0 ? 0 : 1][j];
            for (int i = 0; i < end.count; ++i) mix.add(end.sources[i], row_share * static_cast<double>(end.shares[i]));
            continue;
          }
          const int first = coarse.lattice.first_inner[bone] + (coarse_row - 1) * here.width,
                    left = column_places[j].before;
          mix.add(first + left, row_share * (1 - column_places[j].share));
          mix.add(first + (left + 1) % here.width, row_share * column_places[j].share);
        }
        set(lattice.first_inner[bone] + (row - 1) * fine.width + j, mix);
      }
  }
  for (std::size_t a = 0; a < model.arcs.size(); ++a) {
    const SeamArc& arc = model.arcs[a];
    const std::vector<Place> places = places_between(samples[a]);
    const int kept = static_cast<int>(samples[a].size()) - 1;
    const auto vertex_at = [&](int i) {
      if (arc.is_closed()) return coarse.lattice.first_sample[a] + i % kept;
      return i == 0      ? coarse.lattice.first_corner + arc.corners[0]
             : i == kept ? coarse.lattice.first_corner + arc.corners[1]
                         : coarse.lattice.first_sample[a] + i - 1;
    };
    for (int i = 0; i < static_cast<int>(arc.samples.size()); ++i) {
      const Place& place = places[arc.is_closed() ? i : i + 1];
      Mix mix;
      mix.add(vertex_at(place.before), 1 - place.share);
      mix.add(vertex_at(place.before + 1), place.share);
      set(lattice.first_sample[a] + i, mix);
    }
  }
  for (std::size_t c = 0; c < model.corners.size(); ++c) {
    Mix mix;
    mix.add(coarse.lattice.first_corner + static_cast<int>(c), 1);
    set(lattice.first_corner + static_cast<int>(c), mix);
  }
  return coarse;
}

}  // namespace skeletex
