// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/resample.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "skeletex/convert/layout/pack_atlas.h"
#include "skeletex/model/encoder_settings.h"
#include "skeletex/reconstruct/displace.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/skeleton/frame.h"

namespace skeletex {
namespace {

/// The surface between old samples, along one axis: linear where the lattice gets coarser; where it gets finer, a cubic
/// of Mitchell and Netravali's family on the Keys line, which passes through P + B / 6 * (second difference of P).
struct Interpolant {
  bool is_cubic = false;
  double softness = 0;  // B / 6

  /// Weights of the samples floor(x) - 1 .. floor(x) + 2.
  std::array<double, 4> weights(double fraction) const {
    if (!is_cubic) return {0, 1 - fraction, fraction, 0};
    const double b = 6 * softness, c = (1 - b) / 2;
    const auto kernel = [b, c](double x) {
      x = std::abs(x);
      return x < 1 ? ((12 - 9 * b - 6 * c) * x * x * x + (-18 + 12 * b + 6 * c) * x * x + (6 - 2 * b)) / 6
                   : ((-b - 6 * c) * x * x * x + (6 * b + 30 * c) * x * x + (-12 * b - 48 * c) * x + (8 * b + 24 * c)) /
                         6;
    };
    return {kernel(1 + fraction), kernel(fraction), kernel(1 - fraction), kernel(2 - fraction)};
  }
};

/// Weights over consecutive samples of an axis that runs on past its ends.
struct OpenWeights {
  int first = 0;
  std::vector<double> values;

  void add(int index, double weight) {
    if (values.empty()) first = index;
    if (index < first) {
      values.insert(values.begin(), first - index, 0.0);
      first = index;
    }
    if (index >= first + static_cast<int>(values.size())) values.resize(index - first + 1, 0.0);
    values[index - first] += weight;
  }
  void add_at(const Interpolant& interpolant, double x, double weight) {
    const int cell = static_cast<int>(std::floor(x));
    const std::array<double, 4> w = interpolant.weights(x - cell);
    for (int k = 0; k < 4; ++k)
      if (w[k] != 0) add(cell - 1 + k, weight * w[k]);
  }
  /// Adds `weight` times the mean over the tent of half-width h around x: exact, by Gauss' rule between the kinks.
  void add_tent(const Interpolant& interpolant, double x, double h, double weight) {
    static const std::array<double, 3> nodes{-std::sqrt(0.6), 0.0, std::sqrt(0.6)}, gauss{5.0 / 9, 8.0 / 9, 5.0 / 9};
    for (double a = x - h; a < x + h - 1e-12 * h;) {
      double b = std::min(x + h, std::floor(a + 1e-9) + 1);
      if (a < x - 1e-9 * h) b = std::min(b, x);
      for (int k = 0; k < 3; ++k) {
        const double at = 0.5 * (a + b) + 0.5 * (b - a) * nodes[k];
        add_at(interpolant, at, weight * 0.5 * (b - a) * gauss[k] * (1 - std::abs(at - x) / h) / h);
      }
      a = b;
    }
  }
};

/// Folds weights of an axis that runs on past its ends back onto its samples: round the period, or by reflection in
/// the end point, p(-x) = 2 p(0) - p(x), which keeps the end and straight lines.
void append_folded(const OpenWeights& open, int count, bool is_periodic, FilterTaps& taps) {
  int first = 0, last = -1;
  std::vector<double> folded;
  const int size = static_cast<int>(open.values.size());
  if (is_periodic && size < count) {
    first = (open.first % count + count) % count;
    folded = open.values;
  } else if (is_periodic) {
    folded.assign(count, 0.0);
    for (int k = 0; k < size; ++k) folded[((open.first + k) % count + count) % count] += open.values[k];
  } else {
    std::vector<double> all(count, 0.0);
    first = count;
    const auto add = [&](int index, double weight) {
      all[index] += weight;
      first = std::min(first, index);
      last = std::max(last, index);
    };
    for (int k = 0; k < size; ++k) {
      int index = open.first + k;
      double weight = open.values[k];
      while (index < 0 || index >= count) {
        const int end = index < 0 ? 0 : count - 1;
        add(end, 2 * weight);
        index = 2 * end - index;
        weight = -weight;
      }
      add(index, weight);
    }
    folded.assign(all.begin() + first, all.begin() + last + 1);
  }
  double sum = 0;
  for (const double weight : folded) sum += weight;
  taps.taps.push_back({first, static_cast<int>(folded.size()), static_cast<int>(taps.weights.size()), 0});
  for (const double weight : folded) taps.weights.push_back(static_cast<float>(weight / sum));
}

/// Inverse of the mass matrix of linear elements, [1 4 1] / 6: g(k) = sqrt(3) z^|k|, z = sqrt(3) - 2.
constexpr int kProjectionReach = 7;
double inverse_mass(int k) { return std::numbers::sqrt3 * std::pow(std::numbers::sqrt3 - 2, std::abs(k)); }

}  // namespace

FilterTaps filter_taps(int old_count, int new_count, bool is_periodic, ResampleFilter filter, double softness) {
  FilterTaps taps;
  const double spacing =
      is_periodic ? static_cast<double>(old_count) / new_count : static_cast<double>(old_count - 1) / (new_count - 1);
  const Interpolant interpolant{spacing < 1, softness};
  for (int i = 0; i < new_count; ++i) {
    OpenWeights open;
    const double x = is_periodic || i + 1 < new_count ? i * spacing : old_count - 1;
    if (!is_periodic && (i == 0 || i + 1 == new_count)) {
      open.add(i == 0 ? 0 : old_count - 1, 1);
    } else if (filter == ResampleFilter::kSample) {
      open.add_at(interpolant, x, 1);
    } else if (filter == ResampleFilter::kAverage) {
      open.add_tent(interpolant, x, spacing, 1);
    } else {
      for (int k = -kProjectionReach; k <= kProjectionReach; ++k)
        open.add_tent(interpolant, x + k * spacing, spacing, inverse_mass(k));
    }
    append_folded(open, old_count, is_periodic, taps);
  }
  return taps;
}

std::vector<Vec3> resample_polyline(const std::vector<Vec3>& points, bool is_closed, int cells, ResampleFilter filter) {
  const int edges = static_cast<int>(points.size()) - (is_closed ? 0 : 1);
  const auto point = [&](int i) -> const Vec3& { return points[i % points.size()]; };
  std::vector<double> reached{0.0};  // length up to each point
  for (int i = 0; i < edges; ++i) reached.push_back(reached.back() + (point(i + 1) - point(i)).norm());
  const double total = reached.back();
  const int count = is_closed ? cells : cells + 1;
  if (!(total > 0)) return std::vector<Vec3>(count, points[0]);
  const auto read = [&](int edge, double at) {
    const double length = reached[edge + 1] - reached[edge];
    const double share = length > 0 ? std::clamp((at - reached[edge]) / length, 0.0, 1.0) : 0;
    return Vec3((1 - share) * point(edge) + share * point(edge + 1));
  };

  const double spacing = total / cells;
  std::vector<Vec3> samples(count), averages(count, Vec3::Zero());
  int edge = 0;
  for (int i = 0; i < cells; ++i) {
    const double begin = i * spacing, end = (i + 1) * spacing;
    while (edge + 1 < edges && reached[edge + 1] <= begin) ++edge;
    samples[i] = read(edge, begin);
    // Integrals of the old polyline times the two tents of this cell; quadratic between its points: Simpson is exact.
    const int next = (i + 1) % count;
    double a = begin;
    for (int k = edge; a < end && k < edges; ++k) {
      const double b = k + 1 < edges ? std::min(end, reached[k + 1]) : end;
      for (int s = 0; s < 3; ++s) {
        const double at = a + 0.5 * s * (b - a);
        const double share = (at - begin) / spacing;
        const Vec3 value = (s == 1 ? 4 : 1) * (b - a) / (6 * spacing) * read(k, at);
        averages[i] += (1 - share) * value;
        averages[next] += share * value;
      }
      a = b;
    }
  }
  if (!is_closed) samples[cells] = points.back();
  if (filter == ResampleFilter::kSample) return samples;
  const int first = is_closed ? 0 : 1, last = is_closed ? cells : cells - 1;
  std::vector<Vec3> result = samples;
  if (filter == ResampleFilter::kAverage) {
    std::copy(averages.begin() + first, averages.begin() + last + (is_closed ? 0 : 1), result.begin() + first);
    if (!is_closed) result[cells] = points.back();
    return result;
  }
  // [1 4 1] / 6 c = averages; Gauss-Seidel gains more than a factor 4 per sweep.
  for (int sweep = 0; sweep < 40; ++sweep)
    for (int i = first; i < (is_closed ? cells : cells); ++i)
      result[i] = (6 * averages[i] - result[(i + count - 1) % count] - result[(i + 1) % count]) / 4;
  return result;
}

std::vector<Rectangle> scale_rectangles(const std::vector<Patch>& patches, int width, int height, int new_width,
                                        int new_height) {
  const auto scale = [](int edge, int from, int to) {
    return static_cast<int>(std::lround(static_cast<double>(edge) * to / from));
  };
  std::vector<Rectangle> scaled;
  for (const Patch& patch : patches) {
    const Rectangle& old = patch.rectangle;
    Rectangle rectangle;
    rectangle.x = scale(old.x, width, new_width);
    rectangle.y = scale(old.y, height, new_height);
    rectangle.width = scale(old.x + old.width, width, new_width) - rectangle.x;
    rectangle.height = scale(old.y + old.height, height, new_height) - rectangle.y;
    if (rectangle.width < 4 || rectangle.height < 4) return {};
    scaled.push_back(rectangle);
  }
  return scaled;
}

namespace {

/// Fitted points keep within this share of an edge from the sampled ones (see limit_fit in kernels/reconstruct.cl).
constexpr float kLargestFit = 0.25f;
/// The encoder's prefilter moves texels by -1/16 of their second differences.
constexpr double kPrefilter = 1.0 / 16;

/// Rows of the new rectangle at the same share of the way between the old ones.
std::vector<double> scale_row_u(const std::vector<double>& row_u, int height) {
  const int last = static_cast<int>(row_u.size()) - 1;
  std::vector<double> scaled(height);
  for (int r = 0; r < height; ++r) {
    const double at = static_cast<double>(r) * last / (height - 1);
    const int below = std::min(static_cast<int>(at), last - 1);
    scaled[r] = row_u[below] + (at - below) * (row_u[below + 1] - row_u[below]);
  }
  scaled[0] = row_u.front();
  scaled[height - 1] = row_u.back();
  return scaled;
}

std::vector<Patch> scale_patches(const SkeletexModel& model, int width, int height) {
  std::vector<Rectangle> rectangles =
      scale_rectangles(model.patches, model.texture.width, model.texture.height, width, height);
  if (rectangles.empty()) {
    std::vector<PatchRequest> requests;
    for (const Patch& patch : model.patches)
      requests.push_back({static_cast<double>(patch.rectangle.width) * patch.rectangle.height,
                         static_cast<double>(patch.rectangle.width) / patch.rectangle.height});
    rectangles = pack_atlas(requests, width, height).rectangles;
  }
  std::vector<Patch> patches = model.patches;
  for (std::size_t i = 0; i < patches.size(); ++i) {
    patches[i].rectangle = rectangles[i];
    patches[i].row_u = scale_row_u(model.patches[i].row_u, rectangles[i].height);
  }
  return patches;
}

/// The taps of one axis for all patches behind each other.
void append_taps(const FilterTaps& more, FilterTaps& taps) {
  for (std::array<int, 4> tap : more.taps) {
    tap[2] += static_cast<int>(taps.weights.size());
    taps.taps.push_back(tap);
  }
  taps.weights.insert(taps.weights.end(), more.weights.begin(), more.weights.end());
}

/// Taps of both axes for all patches.
struct LatticeTaps {
  FilterTaps rows, columns;
};
LatticeTaps lattice_taps(const SkeletexModel& model, const std::vector<Patch>& patches, ResampleFilter filter) {
  const double softness = parsed_encoder_settings(model)["prefilter"] == true ? kPrefilter : 0;
  LatticeTaps taps;
  for (std::size_t bone = 0; bone < patches.size(); ++bone) {
    const Rectangle &from = model.patches[bone].rectangle, &to = patches[bone].rectangle;
    append_taps(filter_taps(from.height, to.height, false, filter, softness), taps.rows);
    append_taps(filter_taps(from.width, to.width, true, filter, softness), taps.columns);
  }
  return taps;
}

void resample_texels(ClContext& context, const SkeletexModel& model, const SeparationPlanes& separation,
                     SkeletexModel& result) {
  const int count = static_cast<int>(model.patches.size());
  std::vector<int> widths, first_old, first_middle;  // of the old lattice, and of the one with new rows and old columns
  std::vector<Patch> middle = result.patches;
  int old_size = 0, middle_size = 0, new_size = 0;
  for (int bone = 0; bone < count; ++bone) {
    const Rectangle &from = model.patches[bone].rectangle, &to = result.patches[bone].rectangle;
    middle[bone].rectangle.width = from.width;
    widths.push_back(from.width);
    first_old.push_back(old_size);
    first_middle.push_back(middle_size);
    old_size += from.width * from.height;
    middle_size += from.width * to.height;
    new_size += to.width * to.height;
  }

  const FrameTables tables = in_bone_axes(frame_tables(model.skeleton, separation, result.patches, model.origin));
  const DeviceTables device_tables = upload_tables(context, tables);
  const auto old_widths = context.upload(widths), from_old = context.upload(first_old),
             from_middle = context.upload(first_middle);
  const std::vector<LatticeRow> rows = lattice_rows(result.patches, RowChoice::kAll),
                                middle_rows = lattice_rows(middle, RowChoice::kAll);
  const auto device_rows = context.upload(rows), device_middle_rows = context.upload(middle_rows);
  const int row_count = static_cast<int>(rows.size());
  const ClRange range = row_range(context, rows.size());

  DevicePlanes old_points = allocate_planes(context, old_size);
  {
    const FrameTables old_tables = in_bone_axes(frame_tables(model.skeleton, separation, model.patches, model.origin));
    displace(context, upload_lattice(context, old_tables, model.patches, model.texture, RowChoice::kAll), old_points);
  }
  const auto filtered = [&](ResampleFilter filter) {
    const LatticeTaps taps = lattice_taps(model, result.patches, filter);
    DevicePlanes between = allocate_planes(context, middle_size), points = allocate_planes(context, new_size);
    context.launch({"reconstruct.cl", "filter_rows"}, range, row_count, device_middle_rows, device_tables.patches,
                   old_widths, from_old, context.upload(taps.rows.taps), context.upload(taps.rows.weights),
                   old_points.x, old_points.y, old_points.z, between.x, between.y, between.z);
    context.launch({"reconstruct.cl", "filter_columns"}, range, row_count, device_rows, device_tables.patches,
                   old_widths, from_middle, context.upload(taps.columns.taps), context.upload(taps.columns.weights),
                   between.x, between.y, between.z, points.x, points.y, points.z);
    return points;
  };
  DevicePlanes points = filtered(ResampleFilter::kProject);
  {
    const DevicePlanes sampled = filtered(ResampleFilter::kSample);
    context.launch({"reconstruct.cl", "limit_fit"}, range, row_count, kLargestFit, device_rows, device_tables.patches,
                   sampled.x, sampled.y, sampled.z, points.x, points.y, points.z);
    context.finish();
  }

  const std::size_t area = static_cast<std::size_t>(result.texture.width) * result.texture.height;
  DevicePlanes texels = allocate_planes(context, area);
  for (ClBuffer<float>* plane : {&texels.x, &texels.y, &texels.z}) context.fill(*plane, 0);
  context.launch({"reconstruct.cl", "enter_tangent_space"}, range, row_count, result.texture.width,
                 device_tables.column_count, device_rows, device_tables.patches, device_tables.rows,
                 device_tables.columns, points.x, points.y, points.z, texels.x, texels.y, texels.z);
  result.texture.along = context.download(texels.x);
  result.texture.around = context.download(texels.y);
  result.texture.out = context.download(texels.z);
}

BoneEnd end_at(const Skeleton& skeleton, int bone, int node) {
  return skeleton.bones[bone].head == node ? BoneEnd::kHead : BoneEnd::kTail;
}

SeamArc resample_arc(const SkeletexModel& model, const SeparationPlanes& separation, const SeamArc& arc, int cells) {
  const int bone = arc.bones[0];
  const BoneEnd end = end_at(model.skeleton, bone, arc.node);
  const Vec3& node = model.skeleton.nodes[arc.node].position;
  const auto corner_point = [&](int corner) {
    const SeamCorner& c = model.corners[corner];
    return separation.seam_point(c.bones[0], end_at(model.skeleton, c.bones[0], c.node), c.sample.turn,
                                 c.sample.distance);
  };
  std::vector<Vec3> points;
  if (!arc.is_closed()) points.push_back(corner_point(arc.corners[0]));
  for (const SeamSample& sample : arc.samples)
    points.push_back(separation.seam_point(bone, end, sample.turn, sample.distance));
  if (!arc.is_closed()) points.push_back(corner_point(arc.corners[1]));

  const std::vector<Vec3> fitted = resample_polyline(points, arc.is_closed(), cells, ResampleFilter::kProject);
  const std::vector<Vec3> sampled = resample_polyline(points, arc.is_closed(), cells, ResampleFilter::kSample);
  SeamArc result = arc;
  result.samples.clear();
  for (int i = arc.is_closed() ? 0 : 1; i < cells; ++i) {
    // A fitted point that leaves the separation plane's interval would be restored on another separation plane.
    const bool is_inside = separation.neighbour(bone, end, separation.turn_of(bone, fitted[i] - node)) == arc.bones[1];
    const Vec3& point = is_inside ? fitted[i] : sampled[i];
    result.samples.push_back({separation.turn_of(bone, point - node), separation.half_line_distance(bone, end, point)});
  }
  return result;
}

/// A plane of one value per texel at another size, linear between texels of the same patch.
std::vector<float> resample_plane(const std::vector<float>& values, const SkeletexModel& model,
                                  const SkeletexModel& result) {
  std::vector<float> resampled(static_cast<std::size_t>(result.texture.width) * result.texture.height, 0.f);
  for (std::size_t bone = 0; bone < model.patches.size(); ++bone) {
    const Rectangle &from = model.patches[bone].rectangle, &to = result.patches[bone].rectangle;
    const auto value = [&](int row, int column) {
      return values[static_cast<std::size_t>(from.y + row) * model.texture.width + from.x + column % from.width];
    };
    for (int row = 0; row < to.height; ++row)
      for (int column = 0; column < to.width; ++column) {
        const double y = static_cast<double>(row) * (from.height - 1) / (to.height - 1),
                     x = static_cast<double>(column) * from.width / to.width;
        const int r = std::min(static_cast<int>(y), from.height - 2), c = static_cast<int>(x);
        const double v = y - r, u = x - c;
        resampled[static_cast<std::size_t>(to.y + row) * result.texture.width + to.x + column] =
            static_cast<float>((1 - v) * ((1 - u) * value(r, c) + u * value(r, c + 1)) +
                               v * ((1 - u) * value(r + 1, c) + u * value(r + 1, c + 1)));
      }
  }
  return resampled;
}

}  // namespace

SkeletexModel resample_model(ClContext& context, const SkeletexModel& model, int size) {
  const int longer = std::max(model.texture.width, model.texture.height);
  const auto side = [&](int old) { return static_cast<int>(std::lround(static_cast<double>(old) * size / longer)); };
  const int width = side(model.texture.width), height = side(model.texture.height);
  if (width == model.texture.width && height == model.texture.height) return model;

  const SeparationPlanes separation(model.skeleton);
  SkeletexModel result = model;
  result.texture = {};
  result.texture.width = width;
  result.texture.height = height;
  result.patches = scale_patches(model, width, height);
  result.diagonals = DiagonalRule::kNearest;  // new texels lie evenly
  resample_texels(context, model, separation, result);
  for (std::vector<float>& weights : result.bone_weights) weights = resample_plane(weights, model, result);
  for (SeamArc& arc : result.arcs) {
    double ratio = 0;
    for (const int bone : arc.bones)
      ratio = std::max(ratio,
                       static_cast<double>(result.patches[bone].rectangle.width) / model.patches[bone].rectangle.width);
    const int old_cells = static_cast<int>(arc.samples.size()) + (arc.is_closed() ? 0 : 1);
    arc = resample_arc(model, separation, arc,
                       std::max(arc.is_closed() ? 3 : 2, static_cast<int>(std::lround(old_cells * ratio))));
  }
  // For the record, and because a fit straddles the surface as prefiltered texels do.
  nlohmann::json settings = parsed_encoder_settings(model);
  settings["prefilter"] = true;
  settings["snap"] = settings["fit"] = false;
  settings["resampled_from"] = {model.texture.width, model.texture.height};
  result.encoder_settings = settings.dump();
  return result;
}

}  // namespace skeletex
