// SPDX-License-Identifier: MIT
#pragma once
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "skeletex/edit/morph/blend.h"
#include "skeletex/edit/morph/seam_map.h"
#include "skeletex/model/texture.h"
#include "skeletex/reconstruct/displace.h"

namespace skeletex {

struct MorphOptions {
  /// Number of the model whose bones (names, order, directions), rectangles and seam samples the result takes. Default:
  /// the model of the largest weight, the first of several. So a morph that ends at a model ends at its very texels.
  std::optional<int> layout;
  int size = 0;                ///< longer side of the result's texture; 0: the largest of the models'
  bool has_own_texels = true;  ///< the ends are snapped models' own texels; without, those of regular_grid
  bool is_smooth = true;       ///< at() removes creases where bones of different rotations meet (orientation.h)
};

/// An in-between model before its texels are blended: the model without texels, where they are read, and what moves the
/// rows at the ends onto the seams.
struct MorphPlan {
  SkeletexModel model;
  BlendTables tables;  ///< of the models with a weight above 0
  EndMoves moves;
};

/// In-between models of two or more models (paper 5). Texels, the distances of seams and corners, and the positions of
/// rows along the bones are weighted means of the models' values at corresponding places. Of a snapped model these
/// texels are those of regular_grid; what its own are off them is added as its weight goes from a half to 1. Places
/// correspond at the same share of the rows, and at angles given by a SeamMap from the mean skeleton to each model.
class Morph {
 public:
  /// \param models      at least two; those of another size than the result are resampled
  /// \param from_first  for each but the first model, from the first one's bones to its own
  /// \throw InputError when numbers or genera do not fit; DeviceError
  Morph(ClContext& context, std::vector<SkeletexModel> models, std::span<const Correspondence> from_first,
        const MorphOptions& options = {});

  const std::vector<SkeletexModel>& models() const { return models_; }
  /// See MorphOptions::layout.
  std::optional<int> layout() const { return layout_; }
  /// From the bones of one model to those of another.
  Correspondence correspondence(int from, int to) const;

  /// The model at weights that sum to 1, one per model, none negative.
  /// \throw InputError otherwise
  SkeletexModel at(std::span<const double> weights) const;
  /// Queues the same on the device, with creases. The texels stay there, in planes of the result's size; the texture of
  /// the returned model has a size and no texels. For animations see LiveMorph (live.h).
  SkeletexModel queue(std::span<const double> weights, DevicePlanes& texels) const;
  /// What queue does to the texels.
  MorphPlan plan(std::span<const double> weights) const;
  /// The model that queue returns, without any work per texel.
  SkeletexModel without_texels(std::span<const double> weights) const;

 private:
  struct Between;
  std::unique_ptr<Between> between(std::span<const double> weights, bool has_loops) const;
  void set_mean_skeleton(int layout, Between& between) const;
  int layout_index(std::span<const double> weights) const;
  /// A model of models_, its texels moved by a share of own_moves_.
  SkeletexModel model_with_own(int model, double share) const;
  bool has_own_texels(int model) const { return !own_moves_[model].out.empty(); }

  ClContext* context_;
  std::vector<SkeletexModel> models_;
  std::vector<Correspondence> from_first_;       ///< per model
  std::vector<SeamLoops> traced_seams_;          ///< per model
  std::vector<TexelSampling> own_sampling_;      ///< per model: as it was given, not on a regular grid
  std::vector<DiagonalRule> own_diagonals_;      ///< likewise
  std::vector<std::vector<Layer>> own_layers_;   ///< likewise
  std::vector<DisplacementTexture> own_moves_;   ///< per model: its own texels less those on the grid; empty: none
  std::vector<int> texel_begins_, move_begins_;  ///< per model: of its texture and its moves in texels_
  DevicePlanes texels_;                          ///< of all models, then their moves
  std::optional<int> layout_;
  bool is_smooth_;
};

/// The mean node positions of skeletons of one branching, per node of skeletons[layout]. The skeletons are rotated to
/// the best fit with skeletons[layout], and the mean of these rotations is undone afterwards, so that a weight of 1
/// gives a skeleton's own positions.
/// \param from_layout  per skeleton
std::vector<Vec3> mean_nodes(std::span<const Skeleton* const> skeletons, std::span<const Correspondence> from_layout,
                             std::span<const double> weights, int layout);

}  // namespace skeletex
