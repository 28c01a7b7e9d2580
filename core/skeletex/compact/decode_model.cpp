// SPDX-License-Identifier: MIT
#include "skeletex/compact/decode_model.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "skeletex/compact/layer_planes.h"
#include "skeletex/compact/patch_grid.h"
#include "skeletex/compact/seam_curves.h"
#include "skeletex/geometry/parallel.h"
#include "skeletex/math/portable.h"
#include "skeletex/model/error.h"
#include "skeletex/model/frame.h"
#include "skeletex/model/memory.h"

namespace skeletex {
namespace {

/// Steps of a patch for a size, and its rectangle's.
struct PatchSize {
  int steps = 0, width = 0, height = 0;
};

PatchSize patch_size(const CompactPatch& patch, int octaves) {
  PatchSize size{0, patch.columns, patch.intervals};
  const int wanted = std::min(patch.step_count + 2 * octaves, 31);
  // A patch has three intervals between rows, or more.
  for (; size.steps < wanted || (size.height < 3 && size.steps < 31); ++size.steps)
    (step_doubles_rows(patch, size.steps) ? size.height : size.width) *= 2;
  ++size.height;
  return size;
}

/// Packs rectangles in shelves, the highest first, into about a square.
/// \return width and height
std::array<int, 2> pack_shelves(std::vector<Rectangle>& rectangles) {
  std::vector<int> order(rectangles.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return rectangles[a].height > rectangles[b].height; });
  long area = 0;
  int widest = 0;
  for (const Rectangle& r : rectangles) {
    area += static_cast<long>(r.width) * r.height;
    widest = std::max(widest, r.width);
  }
  std::array<int, 2> best{0, 0};
  const auto place = [&](int limit) {
    int x = 0, y = 0, shelf = 0, width = 0;
    for (const int i : order) {
      Rectangle& r = rectangles[i];
      if (x + r.width > limit) {
        y += shelf;
        x = shelf = 0;
      }
      r.x = x;
      r.y = y;
      x += r.width;
      width = std::max(width, x);
      shelf = std::max(shelf, r.height);
    }
    return std::array<int, 2>{width, y + shelf};
  };
  const double side = std::sqrt(static_cast<double>(area));
  int best_limit = widest;
  for (int i = 0; i <= 32; ++i) {
    const int limit = std::max(widest, static_cast<int>(side * (1 + i / 32.0)));
    const std::array<int, 2> size = place(limit);
    const auto longer = [](const std::array<int, 2>& s) { return std::max(s[0], s[1]); };
    if (best[0] == 0 || longer(size) < longer(best) ||
        (longer(size) == longer(best) && size[0] * size[1] < best[0] * best[1])) {
      best = size;
      best_limit = limit;
    }
  }
  return place(best_limit);
}

/// u of rows: a monotone cubic (Fritsch and Carlson) through the knots.
std::vector<double> row_table(const CompactPatch& patch, int rows) {
  const std::array<double, 5> y{0, patch.row_knots[0] / 256.0, patch.row_knots[1] / 256.0, patch.row_knots[2] / 256.0,
                                1};
  std::array<double, 5> slope{};
  for (int i = 0; i < 5; ++i) {
    const double left = i > 0 ? y[i] - y[i - 1] : y[1] - y[0], right = i < 4 ? y[i + 1] - y[i] : y[4] - y[3];
    slope[i] = 2 * left * right / (left + right);  // the harmonic mean keeps it monotone
  }
  std::vector<double> table(rows);
  for (int row = 1; row + 1 < rows; ++row) {
    const double x = 4.0 * row / (rows - 1);
    const int i = std::min(3, static_cast<int>(x));
    const double t = x - i, s = 1 - t;
    table[row] =
        s * s * (1 + 2 * t) * y[i] + t * t * (1 + 2 * s) * y[i + 1] + t * s * s * slope[i] - t * t * s * slope[i + 1];
  }
  table.front() = 0;
  table.back() = 1;
  return table;
}

/// Texels of a patch's points.
void store_texels(SkeletexModel& model, const SeparationPlanes& separation, BoneIndex bone, const PatchGrid& grid) {
  const Patch& patch = model.patches[bone];
  const Rectangle& r = patch.rectangle;
  const Vec3 &head = end_position(model.skeleton, bone, BoneEnd::kHead),
             &tail = end_position(model.skeleton, bone, BoneEnd::kTail);
  const Vec3& o = separation.bases()[bone].o;
  const bool is_head_free = separation.is_free(bone, BoneEnd::kHead),
             is_tail_free = separation.is_free(bone, BoneEnd::kTail);
  std::vector<Vec3> radials;
  std::vector<std::array<double, 2>> slopes;
  for (int column = 0; column < r.width; ++column) {
    const double turn = static_cast<double>(column) / r.width;
    radials.push_back(separation.radial(bone, turn));
    slopes.push_back({separation.slope(bone, BoneEnd::kHead, turn), separation.slope(bone, BoneEnd::kTail, turn)});
  }
  for (int row = 0; row < r.height; ++row) {
    const Axial at = axial_of(patch.row_u[row], is_head_free, is_tail_free);
    const double cosine = portable::cos(at.latitude), sine = portable::sin(at.latitude);
    TangentFrame frame;
    frame.foot = head + at.axial * (tail - head);
    for (int column = 0; column < r.width; ++column) {
      const Vec3& radial = radials[column];
      const double k = (1 - at.axial) * slopes[column][0] + at.axial * slopes[column][1];
      frame.out = (cosine * (radial + k * o) + sine * o).normalized();
      frame.around = o.cross(radial);
      frame.along = frame.out.cross(frame.around);
      const Vec3 texel = encode_texel(frame, grid.points[grid.index(row, column)], head, tail);
      const std::size_t i = static_cast<std::size_t>(r.y + row) * model.texture.width + r.x + column;
      model.texture.along[i] = static_cast<float>(texel[0]);
      model.texture.around[i] = static_cast<float>(texel[1]);
      model.texture.out[i] = static_cast<float>(texel[2]);
    }
  }
}

void store_seams(SkeletexModel& model, const CompactModel& compact, const SeparationPlanes& separation,
                 const SeamCurves& seams) {
  const double q = seam_step(compact.step);
  for (const CompactCorner& corner : compact.corners)
    model.corners.push_back({corner.node, corner.bones, {corner.turn / 65536.0, corner.distance * q}});
  for (std::size_t i = 0; i < compact.arcs.size(); ++i) {
    const CompactArc& arc = compact.arcs[i];
    SeamArc& result = model.arcs.emplace_back(SeamArc{arc.node, arc.bones, arc.corners, {}});
    const BoneEnd end = end_at(model.skeleton, arc.bones[0], arc.node);
    const Vec3& node = model.skeleton.nodes[arc.node].position;
    for (const Vec3& point : seams.arcs[i])
      result.samples.push_back(
          {separation.turn_of(arc.bones[0], point - node), separation.half_line_distance(arc.bones[0], end, point)});
  }
}

std::vector<Rectangle> rectangles_of(const CompactModel& compact, int octaves) {
  std::vector<Rectangle> rectangles;
  for (const CompactPatch& patch : compact.patches) {
    const PatchSize size = patch_size(patch, octaves);
    rectangles.push_back({0, 0, size.width, size.height});
  }
  return rectangles;
}

}  // namespace

int decoded_size(const CompactModel& compact, int octaves) {
  std::vector<Rectangle> rectangles = rectangles_of(compact, octaves);
  const auto [width, height] = pack_shelves(rectangles);
  return std::max(width, height);
}

int unused_steps(const CompactModel& compact, int octaves) {
  int unused = 31;
  for (const CompactPatch& patch : compact.patches)
    unused = std::min(unused, patch.step_count - patch_size(patch, octaves).steps);
  return std::max(0, unused);
}

int octaves_for(const CompactModel& compact, int size) {
  int octaves = 0;
  while (octaves < 8 && decoded_size(compact, octaves) < size) ++octaves;
  while (octaves > -8 && decoded_size(compact, octaves - 1) >= size) --octaves;
  return octaves;
}

SkeletexModel decode_model(const CompactModel& compact, int octaves) {
  std::vector<Rectangle> rectangles = rectangles_of(compact, octaves);
  double texels = 0;
  for (const Rectangle& r : rectangles) texels += static_cast<double>(r.width) * r.height;
  if (texels > 16384.0 * 16384.0) throw InputError("the size that is asked for exceeds 16384 x 16384 texels");
  require_memory((400.0 + 4 * plane_count(compact)) * texels, fmt::format("decoding {:.0f} texels", texels));

  SkeletexModel model;
  model.skeleton = compact.skeleton;
  model.stance = compact.stance;
  model.diagonal = 1;
  model.ends = ends_of(compact);
  const SeparationPlanes separation(model.skeleton);
  const SeamCurves seams = decode_seams(compact, separation, 0);
  store_seams(model, compact, separation, octaves == 0 ? seams : decode_seams(compact, separation, octaves));
  std::vector<PatchGrid> grids(compact.patches.size());
  for_each_index(grids.size(), [&](std::size_t i) {
    const BoneIndex bone = static_cast<int>(i);
    const CompactPatch& patch = compact.patches[bone];
    const std::array<bool, 2> has_pole{model.ends[bone][0].arcs.empty(), model.ends[bone][1].arcs.empty()};
    const EndRow row = [&](BoneEnd end, int columns) {
      return end_row(compact, separation, model.ends, seams, bone, end, columns);
    };
    grids[bone] = decode_patch(compact, separation, bone, has_pole, row, patch_size(patch, octaves).steps);
    rectangles[bone].width = grids[bone].columns;
    rectangles[bone].height = grids[bone].intervals + 1;
  });
  const auto [width, height] = pack_shelves(rectangles);
  model.texture.width = width;
  model.texture.height = height;
  for (std::vector<float>* plane : {&model.texture.along, &model.texture.around, &model.texture.out})
    plane->assign(static_cast<std::size_t>(width) * height, 0);
  for (BoneIndex bone = 0; bone < static_cast<int>(compact.patches.size()); ++bone) {
    const int free_ends =
        static_cast<int>(model.ends[bone][0].arcs.empty()) + static_cast<int>(model.ends[bone][1].arcs.empty());
    constexpr std::array kTopologies{SegmentTopology::kAnnulus, SegmentTopology::kDisk, SegmentTopology::kSphere};
    model.patches.push_back({rectangles[bone], Method::kVsm, kTopologies[free_ends],
                             row_table(compact.patches[bone], rectangles[bone].height)});
  }
  for_each_index(grids.size(),
                 [&](std::size_t bone) { store_texels(model, separation, static_cast<int>(bone), grids[bone]); });
  decode_layers(model, compact);
  model.genus = genus_of(model);
  return model;
}

}  // namespace skeletex
