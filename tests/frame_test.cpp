// SPDX-License-Identifier: MIT
#include "skeletex/model/frame.h"

#include <gtest/gtest.h>

#include <numbers>

#include "support/random_skeleton.h"

namespace skeletex {
namespace {

using test::random_between;
using test::random_direction;
using test::random_tree;

constexpr double kPi = std::numbers::pi;

TangentFrame frame_at(const Vec3& foot, std::mt19937& random) {
  TangentFrame frame;
  frame.out = random_direction(random);
  frame.around = frame.out.unitOrthogonal();
  frame.along = frame.out.cross(frame.around);
  frame.foot = foot;
  return frame;
}

}  // namespace

TEST(Frame, AxialParametersAndMapCoordinatesAreInverse) {
  for (const bool is_head_free : {false, true})
    for (const bool is_tail_free : {false, true}) {
      double previous_axial = 0, previous_latitude = -kPi / 2;
      for (int i = 0; i <= 1000; ++i) {
        const double u = i / 1000.0;
        const Axial at = axial_of(u, is_head_free, is_tail_free);
        EXPECT_NEAR(u_of(at, is_head_free, is_tail_free), u, 1e-15);
        EXPECT_TRUE(at.latitude == 0 || at.axial == 0 || at.axial == 1);
        EXPECT_GE(at.axial, previous_axial);
        EXPECT_GE(at.latitude, previous_latitude - 1e-15);
        previous_axial = at.axial;
        previous_latitude = at.latitude;
      }
      const Axial first = axial_of(0, is_head_free, is_tail_free), last = axial_of(1, is_head_free, is_tail_free);
      EXPECT_EQ(first.axial, 0);
      EXPECT_EQ(last.axial, 1);
      EXPECT_NEAR(first.latitude, is_head_free ? -kPi / 2 : 0, 1e-15);
      EXPECT_NEAR(last.latitude, is_tail_free ? kPi / 2 : 0, 1e-15);
    }
}

TEST(Frame, CapsTakeHalfOfTheRowsOrAThirdEach) {
  EXPECT_EQ(u_of({1, 0}, false, true), 0.5);
  EXPECT_EQ(u_of({0, 0}, true, false), 0.5);
  EXPECT_NEAR(u_of({0, 0}, true, true), 1 / 3.0, 1e-16);
  EXPECT_NEAR(u_of({1, 0}, true, true), 2 / 3.0, 1e-16);
  EXPECT_NEAR(axial_of(0.75, false, true).latitude, kPi / 4, 1e-15);
}

TEST(Frame, AxesAreOrthonormalAndLeftHanded) {
  std::mt19937 random(1);
  for (int trial = 0; trial < 20; ++trial) {
    const Skeleton skeleton = random_tree(12, random);
    const SeparationPlanes separation(skeleton);
    for (int bone = 0; bone < 12; ++bone)
      for (const double u : {0.0, 1e-9, 0.2, 1.0 / 3, 0.5, 0.7, 1 - 1e-9, 1.0}) {
        const double turn = random_between(random, 0, 1);
        const TangentFrame frame = tangent_frame(skeleton, separation, bone, u, turn);
        Eigen::Matrix3d m;
        m << frame.along, frame.around, frame.out;
        EXPECT_LT((m.transpose() * m - Eigen::Matrix3d::Identity()).norm(), 1e-13);
        EXPECT_NEAR(m.determinant(), -1, 1e-13);
        EXPECT_LT((frame.out.cross(frame.around) - frame.along).norm(), 1e-13);
        // All of `out` lies in the half-plane of its angle; `along` never points backwards.
        EXPECT_NEAR(frame.out.dot(frame.around), 0, 1e-13);
        EXPECT_GE(frame.out.dot(separation.radial(bone, turn)), -1e-13);
        EXPECT_GE(frame.along.dot(separation.bases()[bone].o), -1e-13);
      }
  }
}

TEST(Frame, IsContinuousWhereACapBegins) {
  std::mt19937 random(2);
  const Skeleton skeleton = random_tree(12, random);
  const SeparationPlanes separation(skeleton);
  for (int bone = 0; bone < 12; ++bone)
    for (const double u : {1.0 / 3, 0.5, 2.0 / 3}) {
      const TangentFrame before = tangent_frame(skeleton, separation, bone, u - 1e-9, 0.3),
                         after = tangent_frame(skeleton, separation, bone, u + 1e-9, 0.3);
      EXPECT_LT((before.out - after.out).norm(), 1e-7);
      EXPECT_LT((before.foot - after.foot).norm(), 1e-7);
    }
}

TEST(Frame, PointsIntoTheSeparationPlaneAtASeam) {
  std::mt19937 random(3);
  for (int trial = 0; trial < 20; ++trial) {
    const Skeleton skeleton = random_tree(12, random);
    const SeparationPlanes separation(skeleton);
    for (int bone = 0; bone < 12; ++bone)
      for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) {
        if (separation.is_free(bone, end)) continue;
        const double turn = random_between(random, 0, 1);
        const TangentFrame frame = tangent_frame(skeleton, separation, bone, end == BoneEnd::kHead ? 0 : 1, turn);
        const Vec3 offset = separation.seam_point(bone, end, turn, 0.4) - end_position(skeleton, bone, end);
        EXPECT_LT((frame.foot - end_position(skeleton, bone, end)).norm(), 1e-14 * 10);
        EXPECT_LT((offset.normalized() - frame.out).norm(), 1e-12);
      }
  }
}

TEST(Frame, DecodesWhatItEncodes) {
  std::mt19937 random(4);
  for (int trial = 0; trial < 20000; ++trial) {
    const Vec3 head = random_direction(random),
               tail = head + random_between(random, 0.01, 3) * random_direction(random);
    const double t = trial % 5 == 0 ? 0 : trial % 5 == 1 ? 1 : random_between(random, 0, 1);
    const TangentFrame frame = frame_at(head + t * (tail - head), random);
    const Vec3 point = frame.foot + random_between(random, 0.01, 4) * random_direction(random);
    const Vec3 back = decode_texel(frame, encode_texel(frame, point, head, tail), head, tail);
    // An error of one rounding in the direction moves the exit along the ray by 1 / the sine of the angle at which it
    // leaves the capsule.
    const Vec3 o = (tail - head).normalized();
    const double z = (point - head).dot(o);
    const Vec3 nearest = head + std::clamp(z, 0.0, (tail - head).norm()) * o;
    const Vec3 ray = point - frame.foot;
    const double sine = ray.normalized().dot((point - nearest).normalized());
    EXPECT_LT((back - point).norm(),
              4e-15 * (1 + ray.norm()) / std::max(sine * std::min(1.0, (point - nearest).norm()), 1e-9))
        << trial;
    if (sine > 0.1 && (point - nearest).norm() > 0.1) {
      EXPECT_LT((back - point).norm(), 1e-12);
    }
  }
}

TEST(Frame, DecodesDegeneratePoints) {
  const Vec3 head(0, 0, 0), tail(0, 0, 2);
  std::mt19937 random(5);
  struct Case {
    Vec3 foot, point;
    const char* what;
  };
  const Case cases[] = {
      {{0, 0, 1}, {1, 0, 1}, "straight across"},
      {{0, 0, 2}, {0, 0, 3}, "along the axis from the tail"},
      {{0, 0, 0}, {0, 0, -3}, "along the axis from the head"},
      {{0, 0, 0}, {0, 0, 2.5}, "along the whole bone and beyond"},
      {{0, 0, 1}, {0, 0, -0.5}, "along the axis through the head"},
      {{0, 0, 1}, {1, 0, 2}, "exactly over the tail"},
      {{0, 0, 1}, {1, 0, 0}, "exactly over the head"},
      {{0, 0, 2}, {1, 0, 2}, "across at the tail"},
      {{0, 0, 2}, {1, 0, 0.5}, "backwards over the bone"},
      {{0, 0, 0}, {1e-3, 0, 2.001}, "grazing along the whole bone"},
      {{0, 0, 1}, {1e-8, 0, 1}, "very near"},
      {{0, 0, 1}, {0, 1e8, 1e8}, "very far"},
  };
  for (const Case& c : cases) {
    const TangentFrame frame = frame_at(c.foot, random);
    const Vec3 back = decode_texel(frame, encode_texel(frame, c.point, head, tail), head, tail);
    EXPECT_LT((back - c.point).norm(), 1e-12 * std::max(1.0, c.point.norm())) << c.what << ": " << back.transpose();
  }
  const TangentFrame frame = frame_at({0, 0, 1}, random);
  EXPECT_EQ(encode_texel(frame, frame.foot, head, tail), Vec3::Zero());
  EXPECT_EQ(decode_texel(frame, Vec3::Zero(), head, tail), frame.foot);
}

TEST(Frame, DecodedPointsLieOnTheCapsule) {
  // The restored point is at distance |texel| from the bone and on the ray, whatever direction the texel has.
  std::mt19937 random(6);
  for (int trial = 0; trial < 5000; ++trial) {
    const Vec3 head = random_direction(random), tail = head + random_between(random, 0.1, 3) * random_direction(random);
    const TangentFrame frame =
        frame_at(head + (trial % 3 == 0 ? 1.0 : random_between(random, 0, 1)) * (tail - head), random);
    const Vec3 texel = random_between(random, 0.1, 4) * random_direction(random);
    const Vec3 point = decode_texel(frame, texel, head, tail);
    EXPECT_NEAR(distance_to_bone(point, head, tail), texel.norm(), 1e-13 * (1 + (point - frame.foot).norm()));
    const Vec3 ray = (texel[0] * frame.along + texel[1] * frame.around + texel[2] * frame.out).normalized();
    EXPECT_LT(((point - frame.foot).normalized() - ray).norm(), 1e-13);
  }
}

TEST(Frame, TexelsOfARigidMotionAreTheSame) {
  std::mt19937 random(7);
  for (int trial = 0; trial < 30; ++trial) {
    Skeleton skeleton = random_tree(6, random);
    {
      const auto bases = bone_bases(skeleton);
      for (int i = 0; i < 6; ++i) skeleton.bones[i].s = bases[i].s;
    }
    Skeleton moved = skeleton;
    const Eigen::Quaterniond q(Eigen::AngleAxisd(random_between(random, 0, 6), random_direction(random)));
    const Vec3 shift(3, -1, 2);
    for (Node& node : moved.nodes) node.position = q * node.position + shift;
    for (Bone& bone : moved.bones) bone.s = q * *bone.s;
    const SeparationPlanes separation(skeleton), moved_separation(moved);
    for (int bone = 0; bone < 6; ++bone) {
      const double u = random_between(random, 0, 1), turn = random_between(random, 0, 1);
      const Vec3 point = skeleton.nodes[0].position + 2 * random_direction(random);
      const Vec3 texel =
          encode_texel(tangent_frame(skeleton, separation, bone, u, turn), point,
                       end_position(skeleton, bone, BoneEnd::kHead), end_position(skeleton, bone, BoneEnd::kTail));
      const Vec3 moved_texel =
          encode_texel(tangent_frame(moved, moved_separation, bone, u, turn), q * point + shift,
                       end_position(moved, bone, BoneEnd::kHead), end_position(moved, bone, BoneEnd::kTail));
      EXPECT_LT((texel - moved_texel).norm(), 1e-12);
    }
  }
}

TEST(Frame, TablesHoldWhatTheKernelsNeedForTheSameFrame) {
  std::mt19937 random(8);
  const Skeleton skeleton = random_tree(7, random);
  const SeparationPlanes separation(skeleton);
  std::vector<Patch> patches(7);
  for (int bone = 0; bone < 7; ++bone) {
    Patch& patch = patches[bone];
    patch.rectangle = {10 * bone, 20, 5 + bone, 4 + bone};
    for (int r = 0; r < patch.rectangle.height; ++r)
      patch.row_u.push_back(std::pow(static_cast<double>(r) / (patch.rectangle.height - 1), 1.3));
  }
  const Vec3 origin(0.5, -0.25, 1);
  const FrameTables tables = frame_tables(skeleton, separation, patches, origin);
  ASSERT_EQ(tables.patches.size(), 7u);
  const auto vec = [](const float(&v)[3]) { return Vec3(v[0], v[1], v[2]); };
  for (int bone = 0; bone < 7; ++bone) {
    const PatchRecord& patch = tables.patches[bone];
    EXPECT_EQ(patch.x, 10 * bone);
    EXPECT_EQ(patch.y, 20);
    for (int r = 0; r < patch.height; ++r)
      for (int j = 0; j < patch.width; ++j) {
        const RowRecord& row = tables.rows[patch.row_begin + r];
        const ColumnRecord& column = tables.columns[patch.column_begin + j];
        const TangentFrame frame =
            tangent_frame(skeleton, separation, bone, patches[bone].row_u[r], static_cast<double>(j) / patch.width);
        const Vec3 radial = column.cosine * vec(patch.s) + column.sine * vec(patch.b);
        const double k = (1 - row.axial) * column.slope_head + row.axial * column.slope_tail;
        const Vec3 out = (row.cap_cos * (radial + k * vec(patch.axis)) + row.cap_sin * vec(patch.axis)).normalized();
        const Vec3 foot = origin + vec(patch.head) + row.axial * patch.length * vec(patch.axis);
        EXPECT_LT((out - frame.out).norm(), 2e-6);
        EXPECT_LT((foot - frame.foot).norm(), 2e-6);
      }
  }
}

}  // namespace skeletex
