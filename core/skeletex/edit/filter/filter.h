// SPDX-License-Identifier: MIT
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "skeletex/device/context.h"
#include "skeletex/edit/filter/move_surface.h"
#include "skeletex/model/texture.h"

namespace skeletex {

// Filters work on the surface of the bind pose, across seams, v = 0 and poles (neighbours.h). They return a model of
// the same skeleton, layout and topology of seams. Where they act on a snapped model, its texels move to a regular grid
// (regular_grid.h). Lengths are in diagonals.

/// Where a filter acts.
struct FilterRegion {
  std::vector<std::string> bones;  ///< by name; empty: the whole model
  /// The distance over which the effect grows from the region's boundary inwards. Outside, texels and seams stay bit by
  /// bit.
  double falloff = 0.02;
};

struct FilterReport : MoveReport {
  double volume_before = 0;  ///< world units cubed
};
struct FilterResult {
  SkeletexModel model;
  FilterReport report;
};

struct SmoothOptions {
  double scale = 0.01;        ///< smaller detail vanishes: the surface diffuses for the time scale^2 (implicit Euler)
  int iterations = 1;         ///< steps that the time is divided into, each with the operator of the surface before it
  bool keeps_volume = false;  ///< moves the surface along its normals until it encloses its old volume
};
FilterResult smooth_model(ClContext& context, const SkeletexModel& model, const SmoothOptions& options = {},
                          const FilterRegion& region = {});

struct EnhanceOptions {
  double scale = 0.01;  ///< detail is what smooth_model takes away
  double gain = 1;      ///< how many times the detail is added
};
FilterResult enhance_model(ClContext& context, const SkeletexModel& model, const EnhanceOptions& options = {},
                           const FilterRegion& region = {});

struct NoiseOptions {
  double amplitude = 0.003;  ///< of the largest waves; noise is about -1 .. 1 of it
  double wavelength = 0.05;  ///< of the largest waves
  int octaves = 3;           ///< each half the length and half the height of the one before
  std::uint32_t seed = 0;
};
/// Moves the surface along its normals by gradient noise of the bind pose's positions, which is equal on both sides of
/// a seam.
FilterResult add_noise(ClContext& context, const SkeletexModel& model, const NoiseOptions& options = {},
                       const FilterRegion& region = {});

struct LayerFilterOptions {
  std::string layer;    ///< by name
  double scale = 0.01;  ///< detail is what diffusion takes away, as of smooth_model
  double gain = -1;     ///< how many times the detail is added; -1 takes it away
};
/// Smooths the values of a layer over the surface, or enhances their detail. The surface stays, and so do texels
/// outside of the region.
/// \throw InputError when the model has no such layer
SkeletexModel filter_layer(ClContext& context, const SkeletexModel& model, const LayerFilterOptions& options,
                           const FilterRegion& region = {});

/// How strongly a region's filter acts at each vertex, 0 .. 1.
/// \throw InputError naming a bone that the skeleton does not have
std::vector<float> region_weights(ClContext& context, const SkeletexModel& model, const FilterRegion& region);

}  // namespace skeletex
