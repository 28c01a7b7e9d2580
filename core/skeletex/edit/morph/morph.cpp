// SPDX-License-Identifier: MIT
#include "skeletex/edit/morph/morph.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <deque>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <numeric>

#include "skeletex/edit/morph/orientation.h"
#include "skeletex/edit/morph/seam_network.h"
#include "skeletex/edit/morph/surface_map.h"
#include "skeletex/edit/regular_grid.h"
#include "skeletex/edit/transfer/blend.h"
#include "skeletex/geometry/best_rotation.h"
#include "skeletex/model/encoder_settings.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/reconstruct/seam_strip.h"

namespace skeletex {
namespace {

constexpr double kNoWidth = 1e-9;  // turns
constexpr double kNoMove = 1e-6;   // diagonals; seams are stored no more exactly

/// Each bone's s: the models' own, carried to the mean skeleton, turned about the bone to their mean angle, counted
/// from that of the layout.
void set_mean_s(Skeleton& skeleton, const std::deque<Overlay>& overlays, std::span<const double> weights,
                const Overlay& layout) {
  for (int bone = 0; bone < static_cast<int>(skeleton.bones.size()); ++bone) {
    const Vec3 o =
        (end_position(skeleton, bone, BoneEnd::kTail) - end_position(skeleton, bone, BoneEnd::kHead)).normalized();
    const Vec3& s = layout.carried_s(bone);
    double angle = 0;
    for (std::size_t m = 0; m < overlays.size(); ++m) {
      const Vec3& other = overlays[m].carried_s(bone);
      const double turned = std::atan2(other.dot(o.cross(s)), other.dot(s));
      // Half a turn goes the same way whatever its rounding.
      angle += weights[m] * (turned < 1e-6 - std::numbers::pi ? turned + 2 * std::numbers::pi : turned);
    }
    skeleton.bones[bone].s = angle == 0 ? s : Vec3(Eigen::AngleAxisd(angle, o) * s);
  }
}

std::vector<Patch> mean_patches(const std::deque<Overlay>& overlays, std::span<const double> weights,
                                const SkeletexModel& layout) {
  std::vector<Patch> patches = layout.patches;
  for (int bone = 0; bone < static_cast<int>(patches.size()); ++bone) {
    Patch& patch = patches[bone];
    const int height = patch.rectangle.height;
    std::fill(patch.row_u.begin(), patch.row_u.end(), 0.0);
    patch.method = Method::kSpd;
    for (std::size_t m = 0; m < overlays.size(); ++m) {
      if (weights[m] == 0) continue;
      const Patch& from = overlays[m].model().patches[overlays[m].model_bone(bone)];
      const bool is_reversed = overlays[m].is_reversed(bone);
      if (!is_height_field(from.method)) patch.method = from.method;
      for (int r = 0; r < height; ++r) {
        const double u = u_at_row(from, row_at_same_share(r, height, from.rectangle.height, is_reversed));
        patch.row_u[r] += weights[m] * (is_reversed ? 1 - u : u);
      }
    }
    patch.row_u.front() = 0;
    patch.row_u.back() = 1;
  }
  return patches;
}

/// Angle of an arc's point about its other bone.
double turn_from_other_side(const SeparationPlanes& separation, const SeamArc& arc, BoneEnd end, double turn) {
  const BoneBasis& basis = separation.bases()[arc.bones[0]];
  return separation.turn_of(
      arc.bones[1], separation.radial(arc.bones[0], turn) + separation.slope(arc.bones[0], end, turn) * basis.o);
}

/// The seams around the mean skeleton: corners first, then arcs between them, then the ends of the rows. Bones that
/// meet may read the models at places that differ a little (around slivers); each step takes the mean, and what comes
/// before holds: what an arc misses at its corners fades out along it.
class SeamMean {
 public:
  SeamMean(const SkeletexModel& result, const SeparationPlanes& separation, const std::deque<Overlay>& overlays,
           std::span<const double> weights, const Overlay& layout)
      : skeleton_(result.skeleton),
        patches_(result.patches),
        separation_(separation),
        overlays_(overlays),
        weights_(weights),
        layout_(layout) {}

  void fill(SeamNetwork& network) {
    for (std::size_t c = 0; c < network.corners.size(); ++c) {
      SeamCorner& corner = network.corners[c];
      for (const int bone : corner.bones)
        corner.sample.distance +=
            mean_at(bone, end_at(bone, corner.node), separation_.turn_of(bone, network.directions[c])).distance /
            static_cast<double>(corner.bones.size());
    }
    for (SeamArc& arc : network.arcs) fill_arc(network, arc);
  }

  /// An end's seam as the rows follow it. Empty at a free end. \pre fill
  std::vector<Overlay::LoopPoint> loop(const SeamNetwork& network, int bone, BoneEnd end) const {
    std::vector<Overlay::LoopPoint> points;
    std::vector<Vec3> positions;
    std::vector<double> angles;
    const auto add = [&](int owner, const SeamSample& sample, int node, double turn) {
      positions.push_back(separation_.seam_point(owner, end_at(owner, node), sample.turn, sample.distance));
      angles.push_back(owner == bone ? sample.turn
                                     : separation_.turn_of(bone, positions.back() - skeleton_.nodes[node].position));
      if (!points.empty()) turn = std::max(points.back().turn, turn - std::floor(turn - points.back().turn + kNoWidth));
      const double offset = angles.back() - turn;
      points.push_back({turn, 0, offset - std::round(offset), sample.distance});
    };
    for (const ArcUse use : network.ends[bone][static_cast<int>(end)].arcs) {
      const SeamArc& arc = network.arcs[use.arc];
      if (!arc.is_closed()) {
        const int corner = arc.corners[use.is_reversed ? 1 : 0];
        add(network.corners[corner].bones[0], network.corners[corner].sample, arc.node,
            separation_.turn_of(bone, network.directions[corner]));
      }
      for (std::size_t i = 0; i < arc.samples.size(); ++i) {
        const std::size_t at = use.is_reversed ? arc.samples.size() - 1 - i : i;
        const double turn = turns_.at(use.arc)[at];
        add(arc.bones[0], arc.samples[at], arc.node,
            arc.bones[0] == bone ? turn : turn_from_other_side(separation_, arc, end_at(arc.bones[0], arc.node), turn));
      }
    }
    if (points.empty()) return points;
    const std::vector<double> v = seam_turns(positions, angles);
    double ahead = 0;
    for (std::size_t i = 0; i < points.size(); ++i)
      ahead += (points[i].turn - v[i]) / static_cast<double>(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) points[i].v = v[i] + std::round(ahead);
    return points;
  }

 private:
  BoneEnd end_at(int bone, int node) const { return skeletex::end_at(skeleton_, bone, node); }

  Overlay::SeamPoint mean_at(int bone, BoneEnd end, double turn) const {
    Overlay::SeamPoint mean;
    for (std::size_t m = 0; m < overlays_.size(); ++m) {
      if (weights_[m] == 0) continue;
      const Overlay::SeamPoint read = overlays_[m].seam_at(bone, end, turn);
      mean.turn_offset += weights_[m] * read.turn_offset;
      mean.distance += weights_[m] * read.distance;
    }
    return mean;
  }

  void fill_arc(const SeamNetwork& network, SeamArc& arc) {
    const int bone = arc.bones[0];
    const BoneEnd end = end_at(bone, arc.node), other_end = end_at(arc.bones[1], arc.node);
    double begin = 0, width = 1;
    if (!arc.is_closed()) {
      begin = separation_.turn_of(bone, network.directions[arc.corners[0]]);
      width = separation_.turn_of(bone, network.directions[arc.corners[1]]) - begin;
      width -= std::floor(width + 0.25);  // half a turn at most, and rounding
    }
    std::vector<double> places;
    const int layout_arc = layout_.model_arc(arc.node, bone, arc.bones[1]);
    if (layout_arc >= 0) {
      places = layout_.arc_places(bone, end, layout_arc);
    } else {
      const int intervals =
          std::max(2, static_cast<int>(std::lround(
                          width * std::max(patches_[bone].rectangle.width, patches_[arc.bones[1]].rectangle.width))));
      for (int i = 1; i < intervals; ++i) places.push_back(static_cast<double>(i) / intervals);
    }

    const double sign = end == other_end ? -1 : 1;  // of angles about the other bone
    const auto both_sides_at = [&](double turn) {
      const Overlay::SeamPoint here = mean_at(bone, end, turn),
                               there =
                                   mean_at(arc.bones[1], other_end, turn_from_other_side(separation_, arc, end, turn));
      return Overlay::SeamPoint{(here.turn_offset + sign * there.turn_offset) / 2,
                                (here.distance + there.distance) / 2};
    };
    std::array<Overlay::SeamPoint, 2> missing;
    if (!arc.is_closed())
      for (const int side : {0, 1}) {
        const Overlay::SeamPoint reached = both_sides_at(begin + side * width);
        missing[side] = {-reached.turn_offset, network.corners[arc.corners[side]].sample.distance - reached.distance};
      }
    std::vector<double>& turns = turns_[static_cast<int>(&arc - network.arcs.data())];
    for (const double place : places) {
      const double turn = begin + width * place;
      const Overlay::SeamPoint read = both_sides_at(turn);
      const double angle =
          turn + read.turn_offset + (1 - place) * missing[0].turn_offset + place * missing[1].turn_offset;
      turns.push_back(turn);
      arc.samples.push_back(
          {angle - std::floor(angle), read.distance + (1 - place) * missing[0].distance + place * missing[1].distance});
    }
  }

  const Skeleton& skeleton_;
  const std::vector<Patch>& patches_;
  const SeparationPlanes& separation_;
  const std::deque<Overlay>& overlays_;
  std::span<const double> weights_;
  const Overlay& layout_;
  std::map<int, std::vector<double>> turns_;  ///< per arc and sample, the angle about bones[0] that it is found by
};

/// What rows miss to end on the seams: texels are averaged as vectors, seams by angle and distance.
EndMoves end_moves(const SkeletexModel& result, const SeparationPlanes& separation, const std::deque<Overlay>& overlays,
                   std::span<const double> weights) {
  EndMoves moves;
  for (int bone = 0; bone < static_cast<int>(result.patches.size()); ++bone) {
    const int width = result.patches[bone].rectangle.width;
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail})
      for (int j = 0; j < width; ++j) {
        Vec3 move = Vec3::Zero();
        if (!result.ends[bone][static_cast<int>(end)].arcs.empty()) {
          const double v = static_cast<double>(j) / width;
          move = overlays[0].end_texel_here(result.skeleton, separation, bone, end, v);
          for (std::size_t m = 0; m < overlays.size(); ++m)
            if (weights[m] > 0) move -= weights[m] * overlays[m].end_texel(bone, end, v);
          if (move.norm() < kNoMove * result.diagonal) move.setZero();
        }
        moves.add(end, move);
      }
  }
  return moves;
}

std::vector<double> checked_weights(std::span<const double> weights, std::size_t count) {
  if (weights.size() != count)
    throw InputError(fmt::format("{} weights for {} models; give one per model", weights.size(), count));
  double sum = 0;
  for (const double weight : weights) {
    if (!(weight >= 0)) throw InputError(fmt::format("a weight of {}; weights are 0 or more", weight));
    sum += weight;
  }
  if (!(std::abs(sum - 1) <= 1e-6)) throw InputError(fmt::format("the weights sum to {:.9g}; they must sum to 1", sum));
  std::vector<double> result(weights.begin(), weights.end());
  for (double& weight : result) weight /= sum;
  return result;
}

}  // namespace

std::vector<Vec3> mean_nodes(std::span<const Skeleton* const> skeletons, std::span<const Correspondence> from_layout,
                             std::span<const double> weights, int layout) {
  const std::size_t count = skeletons[layout]->nodes.size();
  std::vector<std::vector<Vec3>> nodes(skeletons.size());
  std::vector<Vec3> centres(skeletons.size(), Vec3::Zero());
  for (std::size_t m = 0; m < skeletons.size(); ++m) {
    for (std::size_t n = 0; n < count; ++n) nodes[m].push_back(skeletons[m]->nodes[from_layout[m].nodes[n]].position);
    if (weights[m] == 1) return nodes[m];
    for (const Vec3& node : nodes[m]) centres[m] += node / static_cast<double>(count);
    for (Vec3& node : nodes[m]) node -= centres[m];
  }
  std::vector<Vec3> mean(count, Vec3::Zero());
  Eigen::Vector4d turn_sum = Eigen::Vector4d::Zero();
  Vec3 centre = Vec3::Zero();
  for (std::size_t m = 0; m < skeletons.size(); ++m) {
    Eigen::Quaterniond turn = best_rotation(nodes[layout], nodes[m]);
    if (turn.w() < 0) turn.coeffs() = -turn.coeffs();
    turn_sum += weights[m] * turn.coeffs();
    centre += weights[m] * centres[m];
    for (std::size_t n = 0; n < count; ++n) mean[n] += weights[m] * (turn.conjugate() * nodes[m][n]);
  }
  const Eigen::Quaterniond turn(Eigen::Vector4d(turn_sum.normalized()));
  for (Vec3& node : mean) node = centre + turn * node;
  return mean;
}

Morph::Morph(ClContext& context, std::vector<SkeletexModel> models, std::span<const Correspondence> from_first,
             const MorphOptions& options)
    : context_(&context), models_(std::move(models)), layout_(options.layout), is_smooth_(options.is_smooth) {
  if (models_.size() < 2) throw InputError("a morph needs two models or more");
  if (from_first.size() + 1 != models_.size())
    throw InputError(fmt::format("{} correspondences for {} models; give one for each but the first", from_first.size(),
                                 models_.size()));
  if (layout_ && (*layout_ < 0 || *layout_ >= static_cast<int>(models_.size())))
    throw InputError(fmt::format("there is no model {} whose layout to take; models are numbered from 0 to {}",
                                 *layout_, models_.size() - 1));
  from_first_.push_back(identity_correspondence(models_[0].skeleton));
  from_first_.insert(from_first_.end(), from_first.begin(), from_first.end());
  int size = options.size;
  for (std::size_t m = 0; m < models_.size(); ++m) {
    if (models_[m].genus != models_[0].genus)
      throw InputError(fmt::format("model {} has genus {}, the first one {}; they cannot become each other", m + 1,
                                   models_[m].genus, models_[0].genus));
    if (options.size == 0) size = std::max({size, models_[m].texture.width, models_[m].texture.height});
  }
  DisplacementTexture all;
  for (SkeletexModel& model : models_) {
    model = resample_model(context, regular_grid(context, model), size);
    traced_seams_.push_back(trace_seams(model));
    texel_begins_.push_back(static_cast<int>(all.out.size()));
    all.along.insert(all.along.end(), model.texture.along.begin(), model.texture.along.end());
    all.around.insert(all.around.end(), model.texture.around.begin(), model.texture.around.end());
    all.out.insert(all.out.end(), model.texture.out.begin(), model.texture.out.end());
  }
  texels_ = upload_texels(context, all);
}

Correspondence Morph::correspondence(int from, int to) const {
  return composed(inverse(from_first_[from]), from_first_[to]);
}

/// A model on the way without its texels, and the models laid over its skeleton.
struct Morph::Between {
  std::vector<double> weights;
  SkeletexModel model;
  std::deque<Overlay> overlays;
  std::optional<SeparationPlanes> separation;  // reads model.skeleton
};

std::unique_ptr<Morph::Between> Morph::between(std::span<const double> given, bool has_loops) const {
  auto between = std::make_unique<Between>();
  auto& [weights, result, overlays, separation_here] = *between;
  weights = checked_weights(given, models_.size());
  const int layout_number = layout_index(weights);
  const SkeletexModel& layout = models_[layout_number];

  result.skeleton = layout.skeleton;
  result.genus = layout.genus;
  result.diagonals = layout.diagonals;
  result.sampling = layout.sampling;
  result.encoder_settings = layout.encoder_settings;
  std::vector<const Skeleton*> skeletons;
  std::vector<Correspondence> from_layout;
  for (std::size_t m = 0; m < models_.size(); ++m) {
    skeletons.push_back(&models_[m].skeleton);
    from_layout.push_back(correspondence(layout_number, static_cast<int>(m)));
    result.origin += weights[m] * models_[m].origin;
    result.diagonal += weights[m] * models_[m].diagonal;
  }
  const std::vector<Vec3> nodes = mean_nodes(skeletons, from_layout, weights, layout_number);
  for (std::size_t n = 0; n < nodes.size(); ++n) result.skeleton.nodes[n].position = nodes[n];
  for (int bone = 0; bone < static_cast<int>(result.skeleton.bones.size()); ++bone)
    if (!(bone_length(result.skeleton, bone) > 0))
      throw InputError(
          fmt::format("bone \"{}\" shrinks to nothing between the models", result.skeleton.bones[bone].name));

  for (std::size_t m = 0; m < models_.size(); ++m)
    overlays.emplace_back(models_[m], result.skeleton, from_layout[m], traced_seams_[m]);
  set_mean_s(result.skeleton, overlays, weights, overlays[layout_number]);
  const SeparationPlanes& separation = separation_here.emplace(result.skeleton);
  SeamNetwork network = seam_network(result.skeleton, separation);
  for (Overlay& overlay : overlays) overlay.set_seams(separation, network);

  result.patches = mean_patches(overlays, weights, layout);
  SeamMean seams(result, separation, overlays, weights, overlays[layout_number]);
  seams.fill(network);
  for (int bone = 0; has_loops && bone < static_cast<int>(result.patches.size()); ++bone)
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) {
      const std::vector<Overlay::LoopPoint> loop = seams.loop(network, bone, end);
      for (Overlay& overlay : overlays) overlay.set_loop(bone, end, loop);
    }
  result.arcs = std::move(network.arcs);
  result.corners = std::move(network.corners);
  result.ends = std::move(network.ends);

  result.texture.width = layout.texture.width;
  result.texture.height = layout.texture.height;
  record_setting(result, "morphed", weights);
  return between;
}

SkeletexModel Morph::without_texels(std::span<const double> weights) const {
  return std::move(between(weights, false)->model);
}

SkeletexModel Morph::queue(std::span<const double> given, DevicePlanes& texels) const {
  const std::unique_ptr<Between> between = this->between(given, true);
  const auto& [weights, result, overlays, separation_here] = *between;
  const SeparationPlanes& separation = *separation_here;
  BlendTables tables;
  const std::vector<LatticeRow> rows = lattice_rows(result.patches, RowChoice::kAll);
  for (std::size_t m = 0; m < models_.size(); ++m) {
    if (weights[m] == 0) continue;
    ++tables.source_count;
    const Overlay& overlay = overlays[m];
    for (int bone = 0; bone < static_cast<int>(result.patches.size()); ++bone) {
      const Rectangle& from = models_[m].patches[overlay.model_bone(bone)].rectangle;
      const int stride = models_[m].texture.width;
      BlendSource source{texel_begins_[m] + from.y * stride + from.x,
                         stride,
                         from.width,
                         from.height,
                         static_cast<int>(tables.columns.size()),
                         -1,
                         overlay.is_reversed(bone) ? -1.0f : 1.0f};
      append_turned_columns(overlay, separation, bone, result.patches[bone].rectangle.width, source, tables);
      tables.sources.push_back(source);
    }
    for (const LatticeRow& row : rows) {
      const int source_height = models_[m].patches[overlay.model_bone(row[0])].rectangle.height;
      const double at = row_at_same_share(row[1], result.patches[row[0]].rectangle.height, source_height,
                                          overlay.is_reversed(row[0]));
      tables.rows.push_back({static_cast<float>(at), static_cast<float>(weights[m])});
    }
  }
  const std::size_t area = static_cast<std::size_t>(result.texture.width) * result.texture.height;
  if (texels.count != area) {
    texels = allocate_planes(*context_, area);
    context_->fill(texels.values, 0);
  }
  const FrameTables frames = frame_tables(result.skeleton, separation, result.patches, result.origin);
  blend_texels(*context_, tables, rows, frames, result.texture.width, texels_, texels);
  move_ends(*context_, end_moves(result, separation, overlays, weights), rows, frames, result.texture.width, texels);
  return std::move(between->model);
}

int Morph::layout_index(std::span<const double> weights) const {
  return layout_.value_or(static_cast<int>(std::max_element(weights.begin(), weights.end()) - weights.begin()));
}

SkeletexModel Morph::at(std::span<const double> given) const {
  DevicePlanes texels;
  SkeletexModel model = queue(given, texels);
  download_texels(*context_, texels, model.texture);
  const std::vector<double> weights = checked_weights(given, models_.size());
  if (!is_smooth_ || std::find(weights.begin(), weights.end(), 1.0) != weights.end()) return model;
  const int layout = layout_index(weights);
  std::vector<std::vector<Vec3>> sources(models_.size());
  for (std::size_t m = 0; m < models_.size(); ++m)
    if (weights[m] > 0)
      sources[m] = map_surface(*context_, model, models_[m], correspondence(layout, static_cast<int>(m)));
  return blend_orientations(*context_, model, sources, weights).model;
}

}  // namespace skeletex
