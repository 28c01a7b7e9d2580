// SPDX-License-Identifier: MIT
// Structs that host and device share. Read by C++20 and by OpenCL C 1.2; all members are 4 bytes wide, no padding.
#ifndef SKELETEX_STRUCTS_H
#define SKELETEX_STRUCTS_H

#ifndef __OPENCL_C_VERSION__
namespace skeletex {
#endif

/// One bone's patch of the texture, as the kernels see it. Positions are relative to the model's origin.
typedef struct PatchRecord {
  float head[3];     ///< H
  float length;      ///< L = |T - H|
  float axis[3];     ///< o = (T - H) / L
  float s[3];        ///< s, unit, orthogonal to o; angle 0
  float b[3];        ///< b = o x s; angle pi/2
  int x;             ///< left column of the rectangle in the texture
  int y;             ///< first row of the rectangle in the texture
  int width;         ///< columns, around the bone; v = column / width
  int height;        ///< rows, along the bone; row 0 and row height-1 lie on seams or poles
  int row_begin;     ///< first entry of this patch in the row table (RowRecord)
  int column_begin;  ///< first entry of this patch in the column table (ColumnRecord)
} PatchRecord;

/// What the tangent frame needs along u: the foot W = H + axial parameter * L * o and the opening of the frame.
typedef struct RowRecord {
  float u;        ///< the row's map coordinate in [0,1]
  float axial;    ///< position of W between head (0) and tail (1)
  float cap_cos;  ///< cosine of the cap's latitude, 1 outside caps
  float cap_sin;  ///< signed sine of the cap's latitude, > 0 in the tail's cap, < 0 in the head's, 0 outside caps
} RowRecord;

/// What the tangent frame needs around v: s'(v) = cosine s + sine b and the slopes of the separation planes.
typedef struct ColumnRecord {
  float cosine;
  float sine;
  float slope_head;  ///< k_H(v): the head's separation plane is met at H + s'(v) + k_H o; 0 at a free end
  float slope_tail;  ///< k_T(v)
} ColumnRecord;

/// What a pose adds to a row: how far the row's capsule extends past the bone's ends, in the bind pose and in this one.
/// World units.
typedef struct PosedRowRecord {
  float bind_extension_head;
  float bind_extension_tail;
  float extension_head;
  float extension_tail;
  float bind_length;  ///< of the bone in the bind pose
} PosedRowRecord;

/// The share of a bone's length, from a seam on, over which its capsule is extended: by (1 - axial parameter /
/// share)^2 of the extension at the seam.
#define POSED_SEAM_SHARE 0.25f

/// What a pose adds to a column, at the bone's head and tail.
typedef struct PosedColumnRecord {
  float roll_head;  ///< radians, to be added to the column's angle
  float roll_tail;
  float slope_head;  ///< of the posed separation planes at the rolled angle
  float slope_tail;
} PosedColumnRecord;

/// What holds along an arc of a loop of seams around a bone's end in a pose. Angles are those of the bind pose,
/// radians.
typedef struct PosedArcRecord {
  float begin;    ///< where it begins, in [0, 2 pi); the first arc of a loop begins at 0, and the last one ends at 2 pi
  float roll;     ///< radians, to be added to the angle where the arc begins
  float rate;     ///< by which the roll grows with the angle
  float slope_s;  ///< the separation plane's slope at the rolled angle a is slope_s cos a + slope_b sin a
  float slope_b;
} PosedArcRecord;

/// The arcs around a bone's head and tail in a pose; a free end has one, without roll and slope.
typedef struct PosedEndsRecord {
  int first_arc[2];  ///< in the table of PosedArcRecord
  int arc_count[2];
  /// How far the capsule extends past the head at the tail's seam, and past the tail at the head's seam; world units.
  float bind_extension[2];
  float extension[2];  ///< the same in this pose
} PosedEndsRecord;

/// One joint of a walk along the skeleton, from the bone that a point belongs to towards other bones: see WeightWalks.
typedef struct WeightStep {
  float normal[3];      ///< (d_from - d_to) / girth: unit directions away from the joint along the two bones
  float girth_inverse;  ///< 1 / girth, the median distance of the seams at the joint to their bones
  float joint[3];       ///< relative to the model's origin
  float seam_radius;    ///< the largest distance of those seams to the joint
  int bone;             ///< that the step leads to
  int before;           ///< the step before this one in the same walk; -1: it begins at the point's own bone
  int same;             ///< an earlier step of the walk that leads to the same bone; -1: none
} WeightStep;

/// Consecutive vertices of one patch, SKIN_BLOCK at most, and the bones that move them. The weights of bone k of the
/// block stand behind each other from first_weight + k * SKIN_BLOCK on.
typedef struct SkinBlock {
  int first_vertex;
  int vertex_count;
  int bone;        ///< the patch's own
  int first_bone;  ///< in the table of the blocks' bones
  int bone_count;
  int first_weight;
} SkinBlock;
#define SKIN_BLOCK 64

/// How a pose moves a bone, as a dual quaternion (w, x, y, z) from bind to posed device coordinates, and how it
/// stretches it.
typedef struct BoneMotionRecord {
  float real[4];
  float dual[4];
  float head[3];     ///< in the bind pose
  float stretch[3];  ///< what the tail moves by as the bone gets longer or shorter
  float axis[3];     ///< unit vector from head to tail in the bind pose, divided by the length
} BoneMotionRecord;

#ifndef __OPENCL_C_VERSION__
static_assert(sizeof(WeightStep) == 4 * 11);
static_assert(sizeof(SkinBlock) == 4 * 6);
static_assert(sizeof(BoneMotionRecord) == 4 * 17);
static_assert(sizeof(PatchRecord) == 4 * 19);
static_assert(sizeof(RowRecord) == 16);
static_assert(sizeof(ColumnRecord) == 16);
static_assert(sizeof(PosedRowRecord) == 4 * 5);
static_assert(sizeof(PosedColumnRecord) == 16);
static_assert(sizeof(PosedArcRecord) == 4 * 5);
static_assert(sizeof(PosedEndsRecord) == 4 * 8);
}  // namespace skeletex
#endif
#endif
