// SPDX-License-Identifier: MIT
#pragma once
#include <vector>

#include "skeletex/convert/resample/filter_taps.h"
#include "skeletex/device/context.h"
#include "skeletex/geometry/mesh.h"
#include "skeletex/reconstruct/prepared_model.h"

namespace skeletex {

/// A polyline with `cells` edges in place of another one. The first and last point of an open one stay; the others are
/// those of the polyline that is nearest to the given one in the least-squares sense, or as the filter says. A closed
/// polyline does not repeat its first point, and none of its points stays.
std::vector<Vec3> resample_polyline(const std::vector<Vec3>& points, bool is_closed, int cells, ResampleFilter filter);

/// The rectangles of a width x height texture scaled to another one: edges keep their places relative to it, to
/// rounding, so that nothing overlaps and covered stays covered.
/// \return empty when a rectangle would fall below 4 x 4
std::vector<Rectangle> scale_rectangles(const std::vector<Patch>& patches, int width, int height, int new_width,
                                        int new_height);

/// The same model with rectangles scaled to another texture size (longer side `size`, at least 4 x 4 each). Texels are
/// resampled as bind-pose positions, averaged where the lattice gets coarser; seams are resampled as polylines.
/// \throw InputError when the size is too small for the number of bones
SkeletexModel resample_model(ClContext& context, const PreparedModel& model, int size);

}  // namespace skeletex
