// SPDX-License-Identifier: MIT
#include "skeletex/edit/morph/morph.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <deque>
#include <numbers>

#include "skeletex/convert/resample/resample.h"
#include "skeletex/edit/morph/morph_layers.h"
#include "skeletex/edit/morph/orientation.h"
#include "skeletex/edit/morph/seam_mean.h"
#include "skeletex/edit/morph/surface_map.h"
#include "skeletex/edit/regular_grid.h"
#include "skeletex/geometry/best_rotation.h"
#include "skeletex/model/encoder_settings.h"
#include "skeletex/model/error.h"
#include "skeletex/model/memory.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex {
namespace {

constexpr double kNoMove = 1e-6;  // diagonals: the accuracy of stored seams

/// Sets each bone's s to the mean of the models' own, posed to the mean skeleton: the layout's, rotated about the bone
/// by the mean of the angles to the others.
void set_mean_s(Skeleton& skeleton, const std::deque<SeamMap>& maps, std::span<const double> weights,
                const SeamMap& layout) {
  for (BoneIndex bone = 0; bone < static_cast<int>(skeleton.bones.size()); ++bone) {
    const Vec3 o =
        (end_position(skeleton, bone, BoneEnd::kTail) - end_position(skeleton, bone, BoneEnd::kHead)).normalized();
    const Vec3& s = layout.posed_s(bone);
    double angle = 0;
    for (std::size_t m = 0; m < maps.size(); ++m) {
      const Vec3& other = maps[m].posed_s(bone);
      const double turned = std::atan2(other.dot(o.cross(s)), other.dot(s));
      // Half a turn goes the same way whatever its rounding.
      angle += weights[m] * (turned < 1e-6 - std::numbers::pi ? turned + 2 * std::numbers::pi : turned);
    }
    skeleton.bones[bone].s = angle == 0 ? s : Vec3(Eigen::AngleAxisd(angle, o) * s);
  }
}

/// The layout's patches with the mean positions of their rows.
std::vector<Patch> mean_patches(const std::deque<SeamMap>& maps, std::span<const double> weights,
                                const SkeletexModel& layout) {
  std::vector<Patch> patches = layout.patches;
  for (BoneIndex bone = 0; bone < static_cast<int>(patches.size()); ++bone) {
    Patch& patch = patches[bone];
    const int height = patch.rectangle.height;
    std::fill(patch.row_u.begin(), patch.row_u.end(), 0.0);
    patch.method = Method::kSpd;
    for (std::size_t m = 0; m < maps.size(); ++m) {
      if (weights[m] == 0) continue;
      const Patch& from = maps[m].model().patches[maps[m].model_bone(bone)];
      if (!is_height_field(from.method)) patch.method = from.method;
      for (int r = 0; r < height; ++r)
        patch.row_u[r] += weights[m] * u_at_same_share(from, r, height, maps[m].is_reversed(bone));
    }
    patch.row_u.front() = 0;
    patch.row_u.back() = 1;
  }
  return patches;
}

/// The moves of the end rows onto the seams: texels are averaged as vectors, seams by angle and distance.
EndMoves end_moves(const SkeletexModel& result, const SeparationPlanes& separation, const std::deque<SeamMap>& maps,
                   std::span<const double> weights) {
  const auto move_at = [&](BoneIndex bone, BoneEnd end, double v) {
    if (result.ends[bone][static_cast<int>(end)].arcs.empty()) return Vec3(Vec3::Zero());
    Vec3 move = maps[0].target_end_texel(result.skeleton, separation, bone, end, v);
    for (std::size_t m = 0; m < maps.size(); ++m)
      if (weights[m] > 0) move -= weights[m] * maps[m].model_end_texel(bone, end, v);
    return move.norm() < kNoMove * result.diagonal ? Vec3(Vec3::Zero()) : move;
  };
  EndMoves moves;
  for (BoneIndex bone = 0; bone < static_cast<int>(result.patches.size()); ++bone) {
    const int width = result.patches[bone].rectangle.width;
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail})
      for (int j = 0; j < width; ++j) moves.add(end, move_at(bone, end, static_cast<double>(j) / width));
  }
  return moves;
}

/// How much of a model's own texels there is at a weight, in place of those on a regular grid.
double own_share(double weight) {
  const double share = std::max(0.0, 2 * weight - 1);
  return share * share * (3 - 2 * share);
}

/// What the texels of a model are more than those of another one of the same layout; nothing where they are the same.
DisplacementTexture moves_between(const SkeletexModel& from, const SkeletexModel& to) {
  if (!to.sampling.is_snapped) return {};
  DisplacementTexture moves = to.texture;
  for (std::size_t i = 0; i < moves.out.size(); ++i)
    moves.along[i] -= from.texture.along[i], moves.around[i] -= from.texture.around[i],
        moves.out[i] -= from.texture.out[i];
  return moves;
}

void append(const DisplacementTexture& texture, DisplacementTexture& all) {
  all.along.insert(all.along.end(), texture.along.begin(), texture.along.end());
  all.around.insert(all.around.end(), texture.around.begin(), texture.around.end());
  all.out.insert(all.out.end(), texture.out.begin(), texture.out.end());
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
  constexpr double kBytesPerTexel = 280;
  require_memory(kBytesPerTexel * size * size * static_cast<double>(models_.size()),
                 fmt::format("a morph of {} models at {} x {} texels", models_.size(), size, size));
  DisplacementTexture all;
  const UnitFrame frame = models_[0].skeleton.frame;
  for (SkeletexModel& model : models_) {
    const SkeletexModel own = resample_model(context, in_frame(std::move(model), frame), size);
    own_sampling_.push_back(own.sampling), own_diagonals_.push_back(own.diagonals);
    own_layers_.push_back(own.layers);
    model = regular_grid(context, own);
    own_moves_.push_back(options.has_own_texels ? moves_between(model, own) : DisplacementTexture{});
    traced_seams_.push_back(trace_seams(model));
    texel_begins_.push_back(static_cast<int>(all.out.size()));
    append(model.texture, all);
  }
  for (const DisplacementTexture& moves : own_moves_) {
    move_begins_.push_back(static_cast<int>(all.out.size()));
    append(moves, all);
  }
  texels_ = upload_texels(context, all);
}

Correspondence Morph::correspondence(int from, int to) const {
  return composed(inverse(from_first_[from]), from_first_[to]);
}

/// An in-between model without its texels, and the maps from it to the models.
struct Morph::Between {
  std::vector<double> weights;
  SkeletexModel model;
  std::deque<SeamMap> maps;
  std::optional<SeparationPlanes> separation;  // reads model.skeleton
};

/// Sets all of a model but its patches, seams and texels.
void Morph::set_mean_skeleton(int layout, Between& between) const {
  SkeletexModel& result = between.model;
  result.skeleton = models_[layout].skeleton;
  result.genus = models_[layout].genus;
  result.diagonals = models_[layout].diagonals;
  result.sampling = models_[layout].sampling;
  result.stance = models_[layout].stance;
  for (std::size_t m = 0; m < models_.size(); ++m) {
    const double own = own_share(between.weights[m]);
    if (!has_own_texels(static_cast<int>(m)) || own == 0) continue;
    result.sampling = own_sampling_[m];
    if (own > 0.5) result.diagonals = own_diagonals_[m];
  }
  result.encoder_settings = models_[layout].encoder_settings;
  std::vector<const Skeleton*> skeletons;
  std::vector<Correspondence> from_layout;
  for (std::size_t m = 0; m < models_.size(); ++m) {
    skeletons.push_back(&models_[m].skeleton);
    from_layout.push_back(correspondence(layout, static_cast<int>(m)));
    result.origin += between.weights[m] * models_[m].origin;
    result.diagonal += between.weights[m] * models_[m].diagonal;
  }
  const std::vector<Vec3> nodes = mean_nodes(skeletons, from_layout, between.weights, layout);
  for (std::size_t n = 0; n < nodes.size(); ++n) result.skeleton.nodes[n].position = nodes[n];
  for (BoneIndex bone = 0; bone < static_cast<int>(result.skeleton.bones.size()); ++bone)
    if (!(bone_length(result.skeleton, bone) > 0))
      throw InputError(
          fmt::format("bone \"{}\" shrinks to nothing between the models", result.skeleton.bones[bone].name));

  for (std::size_t m = 0; m < models_.size(); ++m)
    between.maps.emplace_back(models_[m], result.skeleton, from_layout[m], traced_seams_[m]);
  set_mean_s(result.skeleton, between.maps, between.weights, between.maps[layout]);
}

std::unique_ptr<Morph::Between> Morph::between(std::span<const double> given, bool has_loops) const {
  auto between = std::make_unique<Between>();
  auto& [weights, result, maps, separation] = *between;
  weights = checked_weights(given, models_.size());
  const int layout = layout_index(weights);
  set_mean_skeleton(layout, *between);
  separation.emplace(result.skeleton);
  result.patches = mean_patches(maps, weights, models_[layout]);
  SeamNetwork network = mean_seams(result, *separation, maps, weights, layout, has_loops);
  result.arcs = std::move(network.arcs);
  result.corners = std::move(network.corners);
  result.ends = std::move(network.ends);

  result.texture.width = models_[layout].texture.width;
  result.texture.height = models_[layout].texture.height;
  record_setting(result, "morphed", weights);
  return between;
}

SkeletexModel Morph::without_texels(std::span<const double> weights) const {
  return std::move(between(weights, false)->model);
}

MorphPlan Morph::plan(std::span<const double> given) const {
  const std::unique_ptr<Between> between = this->between(given, true);
  // No structured binding: clang does not capture it.
  const std::vector<double>& weights = between->weights;
  SkeletexModel& result = between->model;
  const std::deque<SeamMap>& maps = between->maps;
  const SeparationPlanes& separation = *between->separation;
  MorphPlan plan;
  BlendTables& tables = plan.tables;
  const std::vector<LatticeRow> rows = lattice_rows(result.patches, RowChoice::kAll);
  const auto add_source = [&](std::size_t m, int texel_begin, double weight) {
    ++tables.source_count;
    for (BoneIndex bone = 0; bone < static_cast<int>(result.patches.size()); ++bone) {
      const auto [x, y, width, height] = models_[m].patches[maps[m].model_bone(bone)].rectangle;
      const int stride = models_[m].texture.width;
      BlendSource source{
          texel_begin + y * stride + x,          stride, width, height, static_cast<int>(tables.columns.size()), -1,
          static_cast<float>(maps[m].sign(bone))};
      append_turned_columns(maps[m], separation, bone, result.patches[bone].rectangle.width, source, tables);
      tables.sources.push_back(source);
    }
    append_rows(maps[m], rows, result.patches, weight, tables);
  };
  for (std::size_t m = 0; m < models_.size(); ++m) {
    if (weights[m] > 0) add_source(m, texel_begins_[m], weights[m]);
    if (has_own_texels(static_cast<int>(m)) && own_share(weights[m]) > 0)
      add_source(m, move_begins_[m], own_share(weights[m]));
  }
  plan.moves = end_moves(result, separation, maps, weights);
  plan.model = std::move(result);
  return plan;
}

SkeletexModel Morph::queue(std::span<const double> given, DevicePlanes& texels) const {
  MorphPlan plan = this->plan(given);
  const SkeletexModel& result = plan.model;
  const std::vector<LatticeRow> rows = lattice_rows(result.patches, RowChoice::kAll);
  const std::size_t area = static_cast<std::size_t>(result.texture.width) * result.texture.height;
  if (texels.count != area) {
    texels = allocate_planes(*context_, area);
    context_->fill(texels.values, 0);
  }
  const FrameTables frames =
      frame_tables(result.skeleton, SeparationPlanes(result.skeleton), result.patches, result.origin);
  blend_texels(*context_, plan.tables, rows, frames, result.texture.width, texels_, texels);
  move_ends(*context_, plan.moves, rows, frames, result.texture.width, texels);
  return std::move(plan.model);
}

int Morph::layout_index(std::span<const double> weights) const {
  return layout_.value_or(static_cast<int>(std::max_element(weights.begin(), weights.end()) - weights.begin()));
}

SkeletexModel Morph::model_with_own(int model, double share) const {
  SkeletexModel result = models_[model];
  const DisplacementTexture& moves = own_moves_[model];
  const auto by = static_cast<float>(share);
  for (std::size_t i = 0; share > 0 && i < moves.out.size(); ++i)
    result.texture.along[i] += by * moves.along[i], result.texture.around[i] += by * moves.around[i],
        result.texture.out[i] += by * moves.out[i];
  return result;
}

SkeletexModel Morph::at(std::span<const double> given) const {
  DevicePlanes texels;
  SkeletexModel model = queue(given, texels);
  download_texels(*context_, texels, model.texture);
  const std::vector<double> weights = checked_weights(given, models_.size());
  const int layout = layout_index(weights);
  const bool is_model = std::find(weights.begin(), weights.end(), 1.0) != weights.end();
  if (is_model && weights[layout] == 1) {  // its own texels
    model.layers = has_own_texels(layout) ? own_layers_[layout] : models_[layout].layers;
    return model;
  }
  const bool has_layers =
      std::any_of(models_.begin(), models_.end(), [](const SkeletexModel& m) { return !m.layers.empty(); });
  const bool is_smooth = is_smooth_ && !is_model;
  if (!is_smooth && !has_layers) return model;
  std::vector<std::vector<Vec3>> sources(models_.size());
  for (std::size_t m = 0; m < models_.size(); ++m)
    if (weights[m] > 0)
      sources[m] = map_surface(*context_, model, model_with_own(static_cast<int>(m), own_share(weights[m])),
                               correspondence(layout, static_cast<int>(m)));
  if (is_smooth) model = blend_orientations(*context_, model, sources, weights).model;
  if (!has_layers) return model;
  std::vector<LayerSource> layer_sources;
  for (std::size_t m = 0; m < models_.size(); ++m)
    if (weights[m] > 0) layer_sources.push_back({models_[m], std::move(sources[m]), weights[m]});
  model.layers = blend_layers(*context_, model, layer_sources);
  return model;
}

}  // namespace skeletex
