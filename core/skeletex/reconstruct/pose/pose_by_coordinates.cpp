// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/pose/pose_by_coordinates.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "reconstruct_structs.h"
#include "skeletex/reconstruct/pose/pose_mesh.h"
#include "skeletex/reconstruct/pose/skin.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex {
namespace {

constexpr double kTwoPi = 2 * std::numbers::pi;

/// The arcs around a bone's end by growing bind angle in [0, 2 pi): the one that runs across angle 0 comes as two.
std::vector<PosedArcRecord> arc_records(const PosedPlanes& posed, BoneIndex bone, BoneEnd end) {
  const std::vector<PosedBound> bounds = posed.bounds(bone, end);
  if (bounds.empty()) return {PosedArcRecord{}};
  std::vector<PosedArcRecord> records;
  for (const double lap : {1.0, 0.0})
    for (std::size_t i = 0; i < bounds.size(); ++i) {
      const PosedBound& bound = bounds[i];
      const double length = (i + 1 < bounds.size() ? bounds[i + 1].turn : bounds[0].turn + 1) - bound.turn;
      const double begin = bound.turn - lap, first = std::max(0.0, begin);
      if (length <= 0 || begin + length <= 0 || begin >= 1) continue;
      const double rate = (bound.end_roll - bound.roll) / length;
      records.push_back({static_cast<float>(kTwoPi * first),
                         static_cast<float>(kTwoPi * (bound.roll + rate * (first - begin))), static_cast<float>(rate),
                         static_cast<float>(bound.slope_s), static_cast<float>(bound.slope_b)});
    }
  return records;
}

struct EndTables {
  std::vector<PosedEndsRecord> ends;
  std::vector<PosedArcRecord> arcs;
};

EndTables end_tables(const SkeletexModel& model, const PosedPlanes& posed) {
  EndTables tables;
  for (BoneIndex bone = 0; bone < static_cast<int>(model.patches.size()); ++bone) {
    PosedEndsRecord record{};
    for (const int end : {0, 1}) {
      const std::vector<PosedArcRecord> arcs = arc_records(posed, bone, static_cast<BoneEnd>(end));
      record.first_arc[end] = static_cast<int>(tables.arcs.size());
      record.arc_count[end] = static_cast<int>(arcs.size());
      tables.arcs.insert(tables.arcs.end(), arcs.begin(), arcs.end());
      // The seam at one end extends the capsule past the other.
      const PosedRow row = posed_row(model, posed, bone, {end == 0 ? 1.0 : 0.0, 0});
      record.bind_extension[end] = static_cast<float>(row.bind_extensions[end]);
      record.extension[end] = static_cast<float>(row.extensions[end]);
    }
    tables.ends.push_back(record);
  }
  return tables;
}

BlockParameters block_parameters(const ClBuffer<SkinBlock>& blocks, const DevicePlanes& points) {
  return {static_cast<int>(blocks.size), 0, 0, static_cast<int>(points.count), 0, 0};
}

ClLocal loops_of_block() { return ClLocal{6 * SKIN_BLOCK * sizeof(float)}; }

}  // namespace

BoneCoordinates bone_coordinates(const Skeleton& skeleton, const SeparationPlanes& separation, BoneIndex bone,
                                 const Vec3& point) {
  const Vec3 offset = point - end_position(skeleton, bone, BoneEnd::kHead);
  const bool is_head_free = separation.is_free(bone, BoneEnd::kHead),
             is_tail_free = separation.is_free(bone, BoneEnd::kTail);
  const double length = bone_length(skeleton, bone), turn = separation.turn_of(bone, offset);
  const double along = offset.dot(separation.bases()[bone].o);
  const double across = std::hypot(offset.dot(separation.bases()[bone].s), offset.dot(separation.bases()[bone].b));
  const double from_head = along - across * separation.slope(bone, BoneEnd::kHead, turn);
  const double to_tail = length + across * separation.slope(bone, BoneEnd::kTail, turn) - along;
  // a and b where both are positive, -b and -a where both are negative; one of the two is 0 beyond one plane alone.
  const double before = std::max(0.0, from_head) + std::max(0.0, -to_tail),
               after = std::max(0.0, to_tail) + std::max(0.0, -from_head);
  Axial at{before > 0 ? before / (before + after) : 0, 0};
  if (is_head_free && at.axial <= 0) at.latitude = std::min(0.0, std::atan2(along, across));
  if (is_tail_free && at.axial >= 1) at.latitude = std::max(0.0, std::atan2(along - length, across));
  return {u_of(at, is_head_free, is_tail_free), turn};
}

Vec3 posed_by_coordinates(const PreparedModel& prepared, const PosedPlanes& posed, BoneIndex bone, const Vec3& point,
                          DistanceRule rule) {
  const SkeletexModel& model = prepared.model;
  const SeparationPlanes& bind = prepared.separation;
  const auto [u, turn] = bone_coordinates(model.skeleton, bind, bone, point);
  const Vec3 texel = encode_texel(tangent_frame(model.skeleton, bind, bone, u, turn), point,
                                  end_position(model.skeleton, bone, BoneEnd::kHead),
                                  end_position(model.skeleton, bone, BoneEnd::kTail));
  return posed_point(model, bind, posed, bone, u, turn, texel, rule);
}

DeviceCoordinates make_coordinates(ClContext& context, const PreparedModel& prepared, const DevicePlanes& points) {
  const SkeletexModel& model = prepared.model;
  const EndTables tables = end_tables(model, PosedPlanes(model, model.skeleton));
  DeviceCoordinates made{context.upload(skin_blocks(model.patches)), context.upload(prepared.tables.patches),
                         context.allocate<float>(5 * points.count)};
  if (made.blocks.size > 0)
    context.launch({"coordinates.cl", "bone_coordinates"}, block_range(context, made.blocks.size),
                   block_parameters(made.blocks, points), made.blocks, made.patches, context.upload(tables.ends),
                   context.upload(tables.arcs), points.values, made.values, loops_of_block());
  return made;
}

void pose_by_coordinates(ClContext& context, const SkeletexModel& model, const DeviceCoordinates& coordinates,
                         const PosedPlanes& posed, DistanceRule rule, const Vec3& origin, DevicePlanes& points) {
  if (coordinates.blocks.size == 0) return;
  const EndTables tables = end_tables(model, posed);
  BlockParameters parameters = block_parameters(coordinates.blocks, points);
  parameters.is_distance_kept = static_cast<int>(rule == DistanceRule::kFromBone);
  context.launch({"coordinates.cl", "pose_by_coordinates"}, block_range(context, coordinates.blocks.size), parameters,
                 coordinates.blocks, coordinates.patches, context.upload(posed_patches(model, posed, origin)),
                 context.upload(tables.ends), context.upload(tables.arcs), coordinates.values, points.values,
                 loops_of_block());
}

void place_shared_by_coordinates(const PreparedModel& model, const PosedPlanes& posed, DistanceRule rule,
                                 std::vector<Vec3>& positions) {
  place_shared_vertices(model, posed, rule, positions);
  std::vector<Vec3> bind_positions(positions.size());
  place_shared_vertices(model, bind_positions);
  for_each_pole(model.model, model.lattice, [&](VertexIndex vertex, BoneIndex bone, int, std::size_t) {
    positions[vertex] = posed_by_coordinates(model, posed, bone, bind_positions[vertex], rule);
  });
}

}  // namespace skeletex
