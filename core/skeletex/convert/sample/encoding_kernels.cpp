// SPDX-License-Identifier: MIT
#include "skeletex/convert/sample/encoding_kernels.h"

#include "skeletex/reconstruct/displace.h"

namespace skeletex {
namespace {

/// Groups of the kernels that walk through lists or trees (spd.cpp, nearest_search.cpp).
const ClRange kSearch{{32, 1}, {32, 1}};
/// VSM on a CPU: a work-item takes a whole chart.
const ClRange kSingle{{1, 1}, {1, 1}};

}  // namespace

std::vector<KernelVariant> encoding_kernels(const ClContext& context, const EncodeOptions& options) {
  const bool has_vsm = options.method != EncodeMethod::kSpd, has_spd = options.method != EncodeMethod::kVsm;
  const std::size_t texels = static_cast<std::size_t>(options.width) * options.height;
  const ClRange items(1), all_texels(texels), rows = row_range(context, 1);
  std::vector<KernelVariant> kernels;
  const auto add = [&](std::string_view file, std::initializer_list<const char*> names, const ClRange& range) {
    for (const char* name : names) kernels.push_back({{file, name}, range});
  };
  add("segment.cl", {"classify_points"}, items);
  if (has_vsm && context.row_items() == 1) add("vsm.cl", {"map_charts"}, kSingle);  // elsewhere there is none
  add("spd.cl", {"find_hidden"}, kSearch);
  if (has_spd) add("spd.cl", {"cast_rays"}, kSearch);
  if (has_vsm) {
    add("encode.cl", {"cover_texels"}, items);
    add("encode.cl", {"read_surface"}, rows);
  }
  if (has_spd) add("encode.cl", {"place_spd_points"}, items);
  add("encode.cl", {"place_points"}, items);
  if (has_vsm && options.has_unfold) {
    add("unfold.cl", {"find_folds"}, all_texels);
    add("unfold.cl", {"relax_folds"}, items);
    add("encode.cl", {"read_listed"}, items);
  }
  const bool can_snap = has_vsm && options.has_snap.value_or(true);
  const bool can_fit = has_vsm && options.has_fit.value_or(options.has_prefilter && texels <= kMostFittedTexels);
  if (can_snap) {
    add("snap.cl", {"reserve_texels", "decide_reservations"}, items);
    add("snap.cl", {"part_colours", "decide_the_rest", "place_on_edges"}, rows);
    add("encode.cl", {"read_snapped"}, rows);
  }
  if (can_fit)
    add("fit.cl",
        {"read_samples", "choose_fitted_diagonals", "match_samples", "match_lattice", "assemble", "relax_moves",
         "move_points"},
        items);
  if (options.has_prefilter) add("encode.cl", {"prefilter_positions"}, rows);
  if (can_snap || can_fit) add("reconstruct.cl", {"triangulate_quads", "triangulate_smoothly"}, rows);
  add("encode.cl", {"encode_texels"}, rows);
  if (options.has_half_texels) {
    add("lattice.cl", {"choose_diagonals"}, rows);
    add("half.cl", {"round_texels"}, rows);
  }
  return kernels;
}

}  // namespace skeletex
