// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/pose/posed_frame.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace skeletex {
namespace {

void store(float (&out)[3], const Vec3& v) {
  for (int i = 0; i < 3; ++i) out[i] = static_cast<float>(v[i]);
}

}  // namespace

PosedRow posed_row(const SkeletexModel& model, const PosedPlanes& posed, BoneIndex bone, const Axial& at) {
  PosedRow row;
  const auto fade = [](double from_seam) {
    return from_seam < POSED_SEAM_SHARE ? std::pow(1 - from_seam / POSED_SEAM_SHARE, 2) : 0.0;
  };
  for (const int end : {0, 1}) {
    if (model.ends[bone][end].arcs.empty()) continue;
    const NodeIndex node = end_node(model.skeleton, bone, static_cast<BoneEnd>(end));
    const double share = fade(end == 0 ? at.axial : 1 - at.axial);
    row.bind_extensions[1 - end] = share * (posed.bind_longest_at(node) - bone_length(model.skeleton, bone));
    row.extensions[1 - end] = share * (posed.longest_at(node) - bone_length(posed.skeleton(), bone));
  }
  return row;
}

Vec3 posed_point(const SkeletexModel& model, const SeparationPlanes& bind, const PosedPlanes& posed, BoneIndex bone,
                 double u, double turn, const Vec3& texel, DistanceRule rule) {
  const bool is_head_free = bind.is_free(bone, BoneEnd::kHead), is_tail_free = bind.is_free(bone, BoneEnd::kTail);
  const Axial at = axial_of(u, is_head_free, is_tail_free);
  const double bind_length = bone_length(model.skeleton, bone), length = bone_length(posed.skeleton(), bone);
  const PosedRow row = posed_row(model, posed, bone, at);
  const PosedRadial head = posed.radial(bone, BoneEnd::kHead, turn), tail = posed.radial(bone, BoneEnd::kTail, turn);
  Vec3 foot = end_position(posed.skeleton(), bone, BoneEnd::kHead) + at.axial * length * posed.bases()[bone].o;
  double radius = texel.norm();
  if (!(radius > 0)) return foot;
  const auto mix = [](double a, double b, double share) { return (1 - share) * a + share * b; };
  // What a pose changes at one end is felt at the other end only to second order: the surface there stays smooth.
  const double eased = at.axial * at.axial * (3 - 2 * at.axial);

  // The texel in the bone's own axes (s', o x s', o), with the frame's opening f = f_s s' + f_o o.
  const auto turned = [&](double slope) {
    const Eigen::Vector2d f =
        Eigen::Vector2d(std::cos(at.latitude), std::cos(at.latitude) * slope + std::sin(at.latitude)).normalized();
    return Vec3(texel[2] * f[0] - texel[0] * f[1], texel[1], texel[2] * f[1] + texel[0] * f[0]);
  };
  const auto across = [](const Vec3& q) { return std::hypot(q[0], q[1]); };
  const double bind_head = bind.slope(bone, BoneEnd::kHead, turn), bind_tail = bind.slope(bone, BoneEnd::kTail, turn);
  const double bind_slope = mix(bind_head, bind_tail, at.axial);
  const Vec3 bound = turned(bind_slope);
  const double bound_stretch = leave_capsule(at.axial * bind_length, bound[2], across(bound), radius, 0, bind_length);
  const Vec3 q = turned(bind_slope + mix(head.slope - bind_head, tail.slope - bind_tail, eased));
  double stretch = bound_stretch;
  if (rule == DistanceRule::kFromBone) {
    const double z = at.axial * bind_length + bound_stretch * bound[2];
    if (row.bind_extensions[0] > 0 || row.bind_extensions[1] > 0)
      radius = std::hypot(bound_stretch * across(bound),
                          std::max({0.0, -row.bind_extensions[0] - z, z - bind_length - row.bind_extensions[1]}));
    stretch = leave_capsule(at.axial * length, q[2], across(q), radius, -row.extensions[0], length + row.extensions[1]);
  }
  const double angle = 2 * std::numbers::pi * (turn + mix(head.roll, tail.roll, eased));
  const BoneBasis& basis = posed.bases()[bone];
  const Vec3 radial = std::cos(angle) * basis.s + std::sin(angle) * basis.b;
  return foot + stretch * (q[0] * radial + q[1] * basis.o.cross(radial) + q[2] * basis.o);
}

std::vector<PatchRecord> posed_patches(const SkeletexModel& model, const PosedPlanes& posed, const Vec3& origin) {
  std::vector<PatchRecord> patches;
  int row_begin = 0, column_begin = 0;
  for (BoneIndex bone = 0; bone < static_cast<int>(model.patches.size()); ++bone) {
    const Rectangle& rectangle = model.patches[bone].rectangle;
    PatchRecord record{};
    store(record.head, end_position(posed.skeleton(), bone, BoneEnd::kHead) - origin);
    record.length = static_cast<float>(bone_length(posed.skeleton(), bone));
    store(record.axis, posed.bases()[bone].o);
    store(record.s, posed.bases()[bone].s);
    store(record.b, posed.bases()[bone].b);
    record.x = rectangle.x;
    record.y = rectangle.y;
    record.width = rectangle.width;
    record.height = rectangle.height;
    record.row_begin = row_begin;
    record.column_begin = column_begin;
    row_begin += rectangle.height;
    column_begin += rectangle.width;
    patches.push_back(record);
  }
  return patches;
}

PoseTables pose_tables(const SkeletexModel& model, const PosedPlanes& posed) {
  PoseTables tables;
  tables.origin = middle_of_nodes(posed.skeleton());
  tables.patches = posed_patches(model, posed, tables.origin);
  for (BoneIndex bone = 0; bone < static_cast<int>(model.patches.size()); ++bone) {
    const Patch& patch = model.patches[bone];
    for (const double u : patch.row_u) {
      const PosedRow row = posed_row(model, posed, bone,
                                     axial_of(u, model.ends[bone][0].arcs.empty(), model.ends[bone][1].arcs.empty()));
      tables.rows.push_back({static_cast<float>(row.bind_extensions[0]), static_cast<float>(row.bind_extensions[1]),
                             static_cast<float>(row.extensions[0]), static_cast<float>(row.extensions[1]),
                             static_cast<float>(bone_length(model.skeleton, bone))});
    }
    for (int j = 0; j < patch.rectangle.width; ++j) {
      const double turn = static_cast<double>(j) / patch.rectangle.width;
      const PosedRadial head = posed.radial(bone, BoneEnd::kHead, turn),
                        tail = posed.radial(bone, BoneEnd::kTail, turn);
      tables.columns.push_back({static_cast<float>(2 * std::numbers::pi * head.roll),
                                static_cast<float>(2 * std::numbers::pi * tail.roll), static_cast<float>(head.slope),
                                static_cast<float>(tail.slope)});
    }
  }
  return tables;
}

}  // namespace skeletex
