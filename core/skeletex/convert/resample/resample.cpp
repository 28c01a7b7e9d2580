// SPDX-License-Identifier: MIT
#include "skeletex/convert/resample/resample.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "reconstruct_structs.h"
#include "skeletex/convert/layers/read_layers.h"
#include "skeletex/convert/layout/pack_atlas.h"
#include "skeletex/convert/resample/resample_layers.h"
#include "skeletex/convert/resample/resample_snapped.h"
#include "skeletex/model/encoder_settings.h"
#include "skeletex/model/frame.h"
#include "skeletex/model/memory.h"
#include "skeletex/reconstruct/displace.h"
#include "skeletex/reconstruct/layers/layer_values.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex {
namespace {

/// A polyline by its length; a closed one does not repeat its first point.
class Polyline {
 public:
  Polyline(const std::vector<Vec3>& points, bool is_closed)
      : points_(points), edges_(static_cast<int>(points.size()) - (is_closed ? 0 : 1)) {
    for (int i = 0; i < edges_; ++i) lengths_.push_back(lengths_.back() + (point(i + 1) - point(i)).norm());
  }
  double total() const { return lengths_.back(); }

  /// Points at equal steps along it, and the integrals of the polyline times the tent around each of them, over a step.
  /// \param count  of points: cells + 1 of an open one, whose last entries are not complete
  void sample(int cells, int count, std::vector<Vec3>& samples, std::vector<Vec3>& averages) const {
    const double spacing = total() / cells;
    samples.assign(count, Vec3::Zero()), averages.assign(count, Vec3::Zero());
    int edge = 0;
    for (int i = 0; i < cells; ++i) {
      const double begin = i * spacing, end = (i + 1) * spacing;
      while (edge + 1 < edges_ && lengths_[edge + 1] <= begin) ++edge;
      samples[i] = read(edge, begin);
      add_cell(edge, begin, end, spacing, averages[i], averages[(i + 1) % count]);
    }
  }

 private:
  const Vec3& point(int i) const { return points_[i % points_.size()]; }
  Vec3 read(int edge, double at) const {
    const double length = lengths_[edge + 1] - lengths_[edge];
    const double share = length > 0 ? std::clamp((at - lengths_[edge]) / length, 0.0, 1.0) : 0;
    return (1 - share) * point(edge) + share * point(edge + 1);
  }
  /// The integrals are quadratic between the polyline's points: Simpson's rule is exact.
  void add_cell(int edge, double begin, double end, double spacing, Vec3& here, Vec3& next) const {
    double a = begin;
    for (int k = edge; a < end && k < edges_; ++k) {
      const double b = k + 1 < edges_ ? std::min(end, lengths_[k + 1]) : end;
      for (int s = 0; s < 3; ++s) {
        const double at = a + 0.5 * s * (b - a);
        const double share = (at - begin) / spacing;
        const Vec3 value = (s == 1 ? 4 : 1) * (b - a) / (6 * spacing) * read(k, at);
        here += (1 - share) * value;
        next += share * value;
      }
      a = b;
    }
  }

  const std::vector<Vec3>& points_;
  int edges_;
  std::vector<double> lengths_{0.0};  ///< up to each point
};

}  // namespace

std::vector<Vec3> resample_polyline(const std::vector<Vec3>& points, bool is_closed, int cells, ResampleFilter filter) {
  const Polyline polyline(points, is_closed);
  const int count = is_closed ? cells : cells + 1;
  if (!(polyline.total() > 0)) return std::vector<Vec3>(count, points[0]);
  std::vector<Vec3> samples, averages;
  polyline.sample(cells, count, samples, averages);
  if (!is_closed) samples[cells] = points.back();
  if (filter == ResampleFilter::kSample || filter == ResampleFilter::kLinear) return samples;
  const int first = is_closed ? 0 : 1;
  std::vector<Vec3> result = samples;
  if (filter == ResampleFilter::kAverage) {
    std::copy(averages.begin() + first, averages.begin() + cells, result.begin() + first);
    return result;
  }
  // [1 4 1] / 6 c = averages; Gauss-Seidel gains more than a factor 4 per sweep.
  for (int sweep = 0; sweep < 40; ++sweep)
    for (int i = first; i < cells; ++i)
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
  const double softness = model.sampling.is_prefiltered ? kPrefilter : 0;
  LatticeTaps taps;
  for (std::size_t bone = 0; bone < patches.size(); ++bone) {
    const Rectangle &from = model.patches[bone].rectangle, &to = patches[bone].rectangle;
    append_taps(filter_taps(from.height, to.height, false, filter, softness), taps.rows);
    append_taps(filter_taps(from.width, to.width, true, filter, softness), taps.columns);
  }
  return taps;
}

/// The two steps of a resampling on the device: first along the bones, then around them.
class TexelResampling {
 public:
  TexelResampling(ClContext& context, const PreparedModel& from, const SkeletexModel& to)
      : context_(context),
        from_(from),
        to_(to),
        tables_(upload_tables(
            context, in_bone_axes(frame_tables(from.model.skeleton, from.separation, to.patches, from.model.origin)))),
        rows_(context.upload(lattice_rows(to.patches, RowChoice::kAll))),
        old_points_(points_in_bone_axes(context, from)) {
    std::vector<int> widths, first_old, first_middle;
    std::vector<Patch> middle = to.patches;  // new rows, old columns
    int old_size = 0;
    for (std::size_t bone = 0; bone < middle.size(); ++bone) {
      const Rectangle &old = from.model.patches[bone].rectangle, &made = to.patches[bone].rectangle;
      middle[bone].rectangle.width = old.width;
      widths.push_back(old.width);
      first_old.push_back(old_size);
      first_middle.push_back(middle_size_);
      old_size += old.width * old.height;
      middle_size_ += old.width * made.height;
      new_size_ += made.width * made.height;
    }
    middle_rows_ = context.upload(lattice_rows(middle, RowChoice::kAll));
    widths_ = context.upload(widths);
    first_old_ = context.upload(first_old), first_middle_ = context.upload(first_middle);
  }

  /// The texels of the new texture.
  void run(DisplacementTexture& texture) {
    DevicePlanes points = filtered(ResampleFilter::kProject);
    const DevicePlanes sampled = filtered(ResampleFilter::kSample);
    context_.launch({"reconstruct.cl", "limit_fit"}, row_range(context_, rows_.size), parameters(sampled, points),
                    rows_, tables_.patches, sampled.values, points.values);
    DevicePlanes texels = allocate_planes(context_, static_cast<std::size_t>(texture.width) * texture.height);
    context_.fill(texels.values, 0);
    enter_tangent_space(context_, tables_, rows_, texture.width, points, texels);
    download_texels(context_, texels, texture);
  }

 private:
  ResampleParameters parameters(const DevicePlanes& in, const DevicePlanes& out) const {
    return {static_cast<int>(rows_.size), static_cast<int>(in.count), static_cast<int>(out.count), kLargestFit};
  }

  /// The points of all new rows.
  DevicePlanes filtered(ResampleFilter filter) {
    const LatticeTaps taps = lattice_taps(from_.model, to_.patches, filter);
    const ClRange range = row_range(context_, rows_.size);
    DevicePlanes between = allocate_planes(context_, middle_size_), points = allocate_planes(context_, new_size_);
    context_.launch({"reconstruct.cl", "filter_rows"}, range, parameters(old_points_, between), middle_rows_,
                    tables_.patches, widths_, first_old_, context_.upload(taps.rows.taps),
                    context_.upload(taps.rows.weights), old_points_.values, between.values);
    context_.launch({"reconstruct.cl", "filter_columns"}, range, parameters(between, points), rows_, tables_.patches,
                    widths_, first_middle_, context_.upload(taps.columns.taps), context_.upload(taps.columns.weights),
                    between.values, points.values);
    return points;
  }

  ClContext& context_;
  const PreparedModel& from_;
  const SkeletexModel& to_;
  DeviceTables tables_;  ///< of the new patches
  ClBuffer<LatticeRow> rows_, middle_rows_;
  DevicePlanes old_points_;
  ClBuffer<int> widths_;                    ///< of the old patches
  ClBuffer<int> first_old_, first_middle_;  ///< points of each patch
  int middle_size_ = 0, new_size_ = 0;
};

SeamArc resample_arc(const SkeletexModel& model, const SeparationPlanes& separation, const SeamArc& arc, int cells) {
  const BoneIndex bone = arc.bones[0];
  const BoneEnd end = end_at(model.skeleton, bone, arc.node);
  const Vec3& node = model.skeleton.nodes[arc.node].position;
  const std::vector<Vec3> points = arc_points(model, separation, arc);
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

/// An arc with samples as the patches at it have columns.
/// \param keeps_samples  each of the old ones is one of the new ones
SeamArc resample_arc(const PreparedModel& prepared, const SkeletexModel& result, const SeamArc& arc,
                     bool keeps_samples) {
  const SkeletexModel& model = prepared.model;
  double ratio = 0;
  for (const BoneIndex bone : arc.bones)
    ratio = std::max(ratio,
                     static_cast<double>(result.patches[bone].rectangle.width) / model.patches[bone].rectangle.width);
  if (keeps_samples)
    return divide_arc(model, prepared.separation, arc, std::max(1, static_cast<int>(std::lround(ratio))));
  const int old_cells = static_cast<int>(arc.samples.size()) + (arc.is_closed() ? 0 : 1);
  return resample_arc(model, prepared.separation, arc,
                      std::max(arc.is_closed() ? 3 : 2, static_cast<int>(std::lround(old_cells * ratio))));
}

/// A plane of one value per texel at a size that keeps all texels, linear between texels of the same patch.
std::vector<float> refine_plane(const std::vector<float>& values, const PreparedModel& prepared,
                                const SkeletexModel& result) {
  const SkeletexModel& model = prepared.model;
  std::vector<float> refined(static_cast<std::size_t>(result.texture.width) * result.texture.height, 0.f);
  for (std::size_t bone = 0; bone < model.patches.size(); ++bone) {
    const Rectangle &from = model.patches[bone].rectangle, &to = result.patches[bone].rectangle;
    const auto value = [&](int row, int column) {
      return values[static_cast<std::size_t>(from.y + row) * model.texture.width + from.x + column % from.width];
    };
    const std::vector<double> rows = rows_of_finer(prepared, static_cast<int>(bone), to.height),
                              columns = columns_of_finer(from.width, to.width);
    for (int row = 0; row < to.height; ++row)
      for (int column = 0; column < to.width; ++column) {
        const int r = std::min(static_cast<int>(rows[row]), from.height - 2), c = static_cast<int>(columns[column]);
        const double v = rows[row] - r, u = columns[column] - c;
        refined[static_cast<std::size_t>(to.y + row) * result.texture.width + to.x + column] =
            static_cast<float>((1 - v) * ((1 - u) * value(r, c) + u * value(r, c + 1)) +
                               v * ((1 - u) * value(r + 1, c) + u * value(r + 1, c + 1)));
      }
  }
  return refined;
}

}  // namespace

SkeletexModel resample_model(ClContext& context, const PreparedModel& prepared, int size) {
  const SkeletexModel& model = prepared.model;
  const int longer = std::max(model.texture.width, model.texture.height);
  const auto side = [&](int old) { return static_cast<int>(std::lround(static_cast<double>(old) * size / longer)); };
  const int width = side(model.texture.width), height = side(model.texture.height);
  if (width == model.texture.width && height == model.texture.height) return model;

  constexpr double kBytesPerTexel = 75;
  require_memory(kBytesPerTexel * width * height, fmt::format("a model of {} x {} texels", width, height));
  SkeletexModel result = model;
  result.texture = {};
  result.texture.width = width;
  result.texture.height = height;
  result.patches = scale_patches(model, width, height);
  const bool has_own_places = model.sampling.is_snapped || model.sampling.is_fitted,
             keeps_texels = has_own_places && is_finer(model, result.patches);
  for (SeamArc& arc : result.arcs) arc = resample_arc(prepared, result, arc, keeps_texels);
  if (keeps_texels) {
    refine_texels(context, prepared, result);
  } else if (has_own_places) {
    const TriangleMesh mesh = reconstruct_bind_mesh(context, prepared).mesh;
    snap_again(context, prepared, mesh, charts_of_mesh(prepared, mesh), result);
  } else {
    result.diagonals = DiagonalRule::kNearest;  // new texels lie evenly
    TexelResampling(context, prepared, result).run(result.texture);
    // The filter fits the surface between texels, which leaves them off it as the prefilter does.
    result.sampling = {.is_prefiltered = true, .is_snapped = false, .is_fitted = false};
  }
  for (std::vector<float>& weights : result.bone_weights)
    weights = keeps_texels ? refine_plane(weights, prepared, result) : resample_plane(weights, model, result);
  if (has_own_places)
    result.layers = read_layers_of(context, model, result);
  else if (!result.layers.empty())
    resample_layers(prepared, result);
  record_setting(result, "resampled_from", {model.texture.width, model.texture.height});
  return result;
}

}  // namespace skeletex
