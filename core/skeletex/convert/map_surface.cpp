// SPDX-License-Identifier: MIT
#include "skeletex/convert/map_surface.h"

#include <algorithm>
#include <utility>

#include "skeletex/convert/parameterize/spd.h"
#include "skeletex/geometry/parallel.h"

namespace skeletex {
namespace {

/// Times the expected error of a map that spreads texels evenly: from here on a part is squeezed.
constexpr double kSqueezed = 5;
/// Reweighting goes on as long as the expected error falls to this, or lower.
constexpr double kWorthReweighting = 0.88;
constexpr int kMostIterations = 32;

void judge_map(const MapSurfaceOptions& options, std::size_t bone, MappedSurface& surface) {
  surface.profiles[bone] = row_profile(surface.charts[bone]);
  surface.errors[bone] =
      expected_error(surface.charts[bone], options.has_uniform_rows ? nullptr : &surface.profiles[bone]);
}

/// Bones whose expected error is far above that of an even map are mapped again with twice the iterations, and again,
/// as long as it falls. Others have the best map after few.
void reweight_squeezed(ClContext& context, const MapSurfaceOptions& options, MappedSurface& surface) {
  std::vector<std::size_t> bones;
  for (std::size_t bone = 0; bone < surface.charts.size(); ++bone)
    if (surface.methods[bone] == Method::kVsm && surface.errors[bone].least() > kSqueezed * surface.errors[bone].even)
      bones.push_back(bone);
  VsmOptions vsm = options.vsm;
  for (vsm.iterations = std::max(1, 2 * vsm.iterations); !bones.empty() && vsm.iterations <= kMostIterations;
       vsm.iterations *= 2) {
    std::vector<Chart> charts;
    for (const std::size_t bone : bones) charts.push_back(surface.charts[bone]);
    std::vector<MapReport> reports = parameterization(Method::kVsm).map(context, charts, {vsm});
    std::vector<std::size_t> better;
    for (std::size_t i = 0; i < bones.size(); ++i) {
      const std::size_t bone = bones[i];
      const double before = surface.errors[bone].least();
      std::swap(surface.charts[bone], charts[i]);
      judge_map(options, bone, surface);
      if (surface.errors[bone].least() < kWorthReweighting * before && reports[i].flipped_triangles == 0) {
        surface.reports[bone] = reports[i];
        better.push_back(bone);
      } else {
        std::swap(surface.charts[bone], charts[i]);
        judge_map(options, bone, surface);
      }
    }
    bones = std::move(better);
  }
}

}  // namespace

MappedSurface map_surface(ClContext& context, Segmentation segmentation, std::vector<Method> methods,
                          const Skeleton& skeleton, const SeparationPlanes& separation,
                          const MapSurfaceOptions& options) {
  MappedSurface surface{std::move(segmentation), {}, {}, std::move(methods), {}, {}, {}};
  const std::size_t count = skeleton.bones.size();
  surface.charts.resize(count), surface.profiles.resize(count), surface.errors.resize(count);
  for_each_index(count, [&](std::size_t i) {
    surface.charts[i] = make_chart(surface.segmentation.segments[i], skeleton, separation);
  });
  surface.unseen = unseen_area_fractions(skeleton, separation, surface.charts);
  surface.reports = map_charts(context, surface.methods, surface.charts, {options.vsm});
  for_each_index(count, [&](std::size_t i) {
    if (!is_height_field(surface.methods[i])) judge_map(options, i, surface);
  });
  if (options.reweights_squeezed) reweight_squeezed(context, options, surface);
  return surface;
}

}  // namespace skeletex
