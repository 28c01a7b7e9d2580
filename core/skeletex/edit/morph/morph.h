// SPDX-License-Identifier: MIT
#pragma once
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "skeletex/edit/morph/overlay.h"
#include "skeletex/model/texture.h"
#include "skeletex/reconstruct/displace.h"

namespace skeletex {

struct MorphOptions {
  /// Number of the model whose bones (names, order, directions), rectangles and seam samples the result takes. Default:
  /// that of the largest weight, so that a morph that ends at a model ends at its very texels (of a snapped one: see
  /// even_lattice); of several the first.
  std::optional<int> layout;
  int size = 0;           ///< longer side of the result's texture; 0: the largest of the models'
  bool is_smooth = true;  ///< at(): without creases where bones of different turns meet (orientation.h)
};

/// In-between models of two or more (paper 5). Texels, distances of seams and corners, and the positions of rows along
/// the bones are weighted means of what lies at the same place of the models: at the same share of the rows, and at the
/// angle that the overlays of all models on the mean skeleton give.
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

  /// The model at weights that sum to 1, one per model, none negative. \throw InputError otherwise
  SkeletexModel at(std::span<const double> weights) const;
  /// The same on the device, its creases left: texels stay there, in planes of the result's size; the texture of the
  /// returned model has a size and no texels. For frames see LiveMorph (live.h).
  SkeletexModel queue(std::span<const double> weights, DevicePlanes& texels) const;
  /// What queue returns, and no work per texel.
  SkeletexModel without_texels(std::span<const double> weights) const;

 private:
  struct Between;
  std::unique_ptr<Between> between(std::span<const double> weights, bool has_loops) const;
  int layout_index(std::span<const double> weights) const;

  ClContext* context_;
  std::vector<SkeletexModel> models_;
  std::vector<Correspondence> from_first_;  ///< per model
  std::vector<TracedSeams> traced_seams_;   ///< per model
  std::vector<int> texel_begins_;           ///< per model: of its texture in texels_
  DevicePlanes texels_;                     ///< of all models
  std::optional<int> layout_;
  bool is_smooth_;
};

/// The mean of skeletons of one branching, in the bones of skeletons[layout]: node positions linearly, after the models
/// are turned to face the same way; the mean of these turns is added again, so that weights of 1 give a model's own
/// place. \param from_layout  per skeleton
std::vector<Vec3> mean_nodes(std::span<const Skeleton* const> skeletons, std::span<const Correspondence> from_layout,
                             std::span<const double> weights, int layout);

}  // namespace skeletex
