// SPDX-License-Identifier: MIT
#include "skeletex/model/frame.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "capsule.h"
#include "skeletex/math/portable.h"

namespace skeletex {
namespace {

constexpr double kHalfPi = std::numbers::pi / 2;

/// The part [begin, end] of u that runs along the bone itself; the rest are caps.
std::array<double, 2> tube_interval(bool is_head_free, bool is_tail_free) {
  if (is_head_free && is_tail_free) return {1.0 / 3, 2.0 / 3};
  if (is_head_free) return {0.5, 1};
  if (is_tail_free) return {0, 0.5};
  return {0, 1};
}

void store(float (&out)[3], const Vec3& v) {
  for (int i = 0; i < 3; ++i) out[i] = static_cast<float>(v[i]);
}

}  // namespace

Axial axial_of(double u, bool is_head_free, bool is_tail_free) {
  const auto [begin, end] = tube_interval(is_head_free, is_tail_free);
  if (u < begin) return {0, -kHalfPi * (begin - u) / begin};
  if (u > end) return {1, kHalfPi * (u - end) / (1 - end)};
  return {(u - begin) / (end - begin), 0};
}

double u_of(const Axial& at, bool is_head_free, bool is_tail_free) {
  const auto [begin, end] = tube_interval(is_head_free, is_tail_free);
  if (at.latitude < 0) return begin * (1 + at.latitude / kHalfPi);
  if (at.latitude > 0) return end + (1 - end) * at.latitude / kHalfPi;
  return begin + at.axial * (end - begin);
}

TangentFrame tangent_frame(const Skeleton& skeleton, const SeparationPlanes& separation, BoneIndex bone, double u,
                           double turn) {
  const BoneBasis& basis = separation.bases()[bone];
  const Axial at = axial_of(u, separation.is_free(bone, BoneEnd::kHead), separation.is_free(bone, BoneEnd::kTail));
  const Vec3 radial = separation.radial(bone, turn);
  const double k = (1 - at.axial) * separation.slope(bone, BoneEnd::kHead, turn) +
                   at.axial * separation.slope(bone, BoneEnd::kTail, turn);
  const Vec3 f = portable::cos(at.latitude) * (radial + k * basis.o) + portable::sin(at.latitude) * basis.o;
  TangentFrame frame;
  frame.out = f.normalized();
  frame.around = basis.o.cross(radial);
  frame.along = frame.out.cross(frame.around);
  const Vec3& head = end_position(skeleton, bone, BoneEnd::kHead);
  frame.foot = head + at.axial * (end_position(skeleton, bone, BoneEnd::kTail) - head);
  return frame;
}

Vec3 encode_texel(const TangentFrame& frame, const Vec3& point, const Vec3& head, const Vec3& tail) {
  const Vec3 offset = point - frame.foot;
  const double length = offset.norm();
  if (length == 0) return Vec3::Zero();
  const double scale = distance_to_bone(point, head, tail) / length;
  return scale * Vec3(offset.dot(frame.along), offset.dot(frame.around), offset.dot(frame.out));
}

Vec3 decode_texel(const TangentFrame& frame, const Vec3& texel, const Vec3& head, const Vec3& tail) {
  const double e = texel.norm();
  if (e == 0) return frame.foot;
  const Vec3 d = (texel[0] * frame.along + texel[1] * frame.around + texel[2] * frame.out) / e;
  const double length = (tail - head).norm();
  const Vec3 o = (tail - head) / length;
  const double along = d.dot(o);
  return frame.foot + leave_capsule((frame.foot - head).dot(o), along, (d - along * o).norm(), e, 0, length) * d;
}

double leave_capsule(double z, double along, double across, double radius, double lower, double upper) {
  const double inverse2 = 1 / (along * along + across * across);
  return leave_capsule_of_radius(along, across * across * inverse2, inverse2, z - lower, upper - z,
                                 radius * radius * inverse2);
}

FrameTables frame_tables(const Skeleton& skeleton, const SeparationPlanes& separation,
                         const std::vector<Patch>& patches, const Vec3& origin) {
  FrameTables tables;
  for (BoneIndex bone = 0; bone < static_cast<int>(patches.size()); ++bone) {
    const Patch& patch = patches[bone];
    const BoneBasis& basis = separation.bases()[bone];
    PatchRecord record{};
    store(record.head, end_position(skeleton, bone, BoneEnd::kHead) - origin);
    record.length = static_cast<float>(bone_length(skeleton, bone));
    store(record.axis, basis.o);
    store(record.s, basis.s);
    store(record.b, basis.b);
    record.x = patch.rectangle.x;
    record.y = patch.rectangle.y;
    record.width = patch.rectangle.width;
    record.height = patch.rectangle.height;
    record.row_begin = static_cast<int>(tables.rows.size());
    record.column_begin = static_cast<int>(tables.columns.size());
    tables.patches.push_back(record);
    const bool is_head_free = separation.is_free(bone, BoneEnd::kHead),
               is_tail_free = separation.is_free(bone, BoneEnd::kTail);
    for (const double u : patch.row_u) {
      const Axial at = axial_of(u, is_head_free, is_tail_free);
      tables.rows.push_back({static_cast<float>(u), static_cast<float>(at.axial),
                             static_cast<float>(portable::cos(at.latitude)),
                             static_cast<float>(portable::sin(at.latitude))});
    }
    for (int j = 0; j < patch.rectangle.width; ++j) {
      const double turn = static_cast<double>(j) / patch.rectangle.width;
      tables.columns.push_back({static_cast<float>(portable::cos(2 * std::numbers::pi * turn)),
                                static_cast<float>(portable::sin(2 * std::numbers::pi * turn)),
                                static_cast<float>(separation.slope(bone, BoneEnd::kHead, turn)),
                                static_cast<float>(separation.slope(bone, BoneEnd::kTail, turn))});
    }
  }
  return tables;
}

Eigen::Matrix3f texel_axes(const FrameTables& tables, PatchIndex patch, int row, int column) {
  const PatchRecord& p = tables.patches[patch];
  const RowRecord& r = tables.rows[p.row_begin + row];
  const ColumnRecord& c = tables.columns[p.column_begin + column];
  const Eigen::Vector3f s = Eigen::Map<const Eigen::Vector3f>(p.s), b = Eigen::Map<const Eigen::Vector3f>(p.b),
                        o = Eigen::Map<const Eigen::Vector3f>(p.axis);
  const Eigen::Vector3f radial = c.cosine * s + c.sine * b;
  const float across = r.cap_cos,
              along = r.cap_cos * (c.slope_head + r.axial * (c.slope_tail - c.slope_head)) + r.cap_sin;
  const float inverse = 1 / std::sqrt(across * across + along * along);
  Eigen::Matrix3f axes;
  axes.col(0) = inverse * (across * o - along * radial);
  axes.col(1) = c.cosine * b - c.sine * s;
  axes.col(2) = inverse * (across * radial + along * o);
  return axes;
}

}  // namespace skeletex
