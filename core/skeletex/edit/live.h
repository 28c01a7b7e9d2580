// SPDX-License-Identifier: MIT
#pragma once
#include <vector>

#include "skeletex/edit/morph/morph.h"

namespace skeletex {

// Edits at frame rates: all that stays from frame to frame is computed once, and a frame is one pass over two textures
// on the device. The result is a model like any other, which can be reconstructed, posed or drawn:
//
//   const LiveMorph live(context, morph, {{1, 0}, {0, 1}});
//   const SkeletexModel frame = live.queue(0.3, lattice.texels);

/// A morph along a path of weights. At its keys (whole numbers of steps) the texels are those of Morph::queue bit by
/// bit; between keys they are interpolated linearly. Skeleton, rows and seams are the morph's at every time.
class LiveMorph {
 public:
  /// \param morph  must outlive this, and have a layout (MorphOptions::layout)
  /// \param path   the weights at t = 0, 1, 2, ..., two or more
  /// \param steps  from each of these to the next; a texture of the layout's size is kept per step
  /// \throw InputError; DeviceError
  LiveMorph(ClContext& context, const Morph& morph, std::vector<std::vector<double>> path, int steps = 8);

  std::vector<double> weights(double t) const;
  /// Queues the model at t, which is clamped to the path; the model itself has no texels.
  /// \param texels  receives them; allocated when its size is not the layout's
  SkeletexModel queue(double t, DevicePlanes& texels) const;

 private:
  ClContext* context_;
  const Morph* morph_;
  std::vector<std::vector<double>> path_;
  int steps_;
  std::vector<DevicePlanes> keys_;
};

/// Linear interpolation between two models of one skeleton, one layout and one network of seams: the target of a
/// transfer and its result, or a model and the filtered one.
class LiveBlend {
 public:
  /// \throw InputError when the two differ in more than texels, rows and places of seams; DeviceError
  LiveBlend(ClContext& context, SkeletexModel first, const SkeletexModel& second);

  /// \param share  0: the first, 1: the second, bit by bit
  /// \param texels  as in LiveMorph::queue
  SkeletexModel queue(double share, DevicePlanes& texels) const;
  /// The same model with its texels.
  SkeletexModel at(double share) const;

 private:
  ClContext* context_;
  SkeletexModel first_, second_;  ///< without texels
  DevicePlanes first_texels_, second_texels_;
};

}  // namespace skeletex
