// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "skeletex/model/method.h"
#include "skeletex/model/segment.h"
#include "skeletex/skeleton/skeleton.h"

namespace skeletex {

const char* to_string(SegmentTopology topology);

/// A rectangle of texels: columns [x, x + width), rows [y, y + height).
struct Rectangle {
  int x = 0, y = 0, width = 0, height = 0;
};

/// One bone's part of the texture. Row r is read at u = row_u[r], column j at v = j / width; v is periodic.
/// Row 0 lies on the head's seam or pole, row height-1 on the tail's.
struct Patch {
  Rectangle rectangle;
  Method method = Method::kVsm;
  SegmentTopology topology = SegmentTopology::kAnnulus;
  std::vector<double> row_u;  ///< height entries, increasing from 0 to 1
};

/// A point of a seam: its angle about the bone bones[0] of its arc (or corner), in turns, and its distance to the
/// half-line from the node along that bone. The bones that meet there see the same distance.
struct SeamSample {
  double turn = 0;      ///< [0,1)
  double distance = 0;  ///< world units
};

/// A point where three or more segments meet.
struct SeamCorner {
  NodeIndex node;
  std::vector<BoneIndex> bones;  ///< the bones that meet; the sample's angle is about bones[0]
  SeamSample sample;
};

/// The shared boundary of two segments, stored once for both.
struct SeamArc {
  NodeIndex node;
  std::array<BoneIndex, 2> bones{-1, -1};
  std::array<int, 2> corners{-1, -1};  ///< first and last corner; -1, -1 when closed
  std::vector<SeamSample> samples;     ///< in the direction of growing v about bones[0]; without the corners
  bool is_closed() const { return corners[0] < 0; }
};

/// How a patch's end runs through the seams.
struct PatchEnd {
  std::vector<ArcUse> arcs;  ///< in the direction of growing v; empty at a free end, which has a pole instead
};

/// The vector displacement texture: three planes, row-major, in bone tangent space. A texel is the direction from the
/// foot W(u) to the surface in the frame (along, around, out), scaled to the distance e of the point from the bone
/// segment, in world units. The frame (along, around, out) is left-handed: out x around = along.
struct DisplacementTexture {
  int width = 0, height = 0;
  std::vector<float> along, around, out;
};

/// Which diagonal the quads between texels take, see kernels/reconstruct.cl.
enum class DiagonalRule {
  kNearest,  ///< the one nearer to a cubic through the texels around: for regular grids
  kSmooth,   ///< the one whose triangles turn least against those around: for texels on the mesh's own vertices and
             ///< edges
};

/// How inner texels were taken from the surface. What other sizes and morphs of the model make of them depends on it.
struct TexelSampling {
  bool is_prefiltered = false;  ///< 1/16 of their second differences off the surface, unless they are snapped or fitted
  bool is_snapped = false;      ///< those of VSM patches lie on the mesh's vertices and edges where they can
  bool is_fitted = false;  ///< those of VSM patches were moved so that the triangles between lie nearer to the mesh
};

/// Lengths, in the frame of the model, whose squares single precision holds with room to spare: diagonals of models lie
/// between them.
inline constexpr double kSmallestDiagonal = 1e-15, kLargestDiagonal = 1e15;
/// How many diagonals a model's nodes, seams and texels may lie away from its origin.
inline constexpr double kMostDiagonals = 100;

/// What the planes of a layer hold.
enum class LayerKind {
  kNormal,  ///< two planes: the surface's unit normal in the frame (along, around, out) of the texel, octahedral
  kColour,  ///< three planes red, green, blue of linear light, or four with opacity; 0 to 1 for the most part
  kNumber,  ///< one plane
};

/// A quantity of the surface beside its place: per texel its value where the texel reads.
struct Layer {
  std::string name;  ///< different for each layer of a model; shading normals are "normal", the colour is "colour"
  LayerKind kind = LayerKind::kNumber;
  std::vector<std::vector<float>> planes;  ///< as those of the texture
};

/// How a surface stands in the world: unit directions, orthogonal.
struct Stance {
  Vec3 up = Vec3::UnitY(), front = Vec3::UnitZ();
};

/// A model: one texture and what is needed to turn it back into a mesh. Its lengths and places are in the frame of its
/// skeleton; reconstruct_mesh gives the user's units.
struct SkeletexModel {
  Skeleton skeleton;           ///< bind pose, every bone with its s
  Vec3 origin = Vec3::Zero();  ///< place that device coordinates are relative to (the input's box centre)
  double diagonal = 0;         ///< of the input mesh's bounding box
  int genus = 0;
  DiagonalRule diagonals = DiagonalRule::kNearest;
  TexelSampling sampling;
  DisplacementTexture texture;
  std::vector<Patch> patches;                 ///< one per bone
  std::vector<std::array<PatchEnd, 2>> ends;  ///< one pair per bone: head, tail
  std::vector<SeamArc> arcs;
  std::vector<SeamCorner> corners;
  /// How much each bone moves each texel in a smooth pose, where that is painted or imported: per bone a plane as the
  /// texture's, values of at least 0 whose sum does not matter. Empty: weights in closed form (weight_walk.h).
  std::vector<std::vector<float>> bone_weights;
  std::vector<Layer> layers;
  std::optional<Stance> stance;  ///< none: not known
  std::string encoder_settings;  ///< JSON object: how the model was made, for the record; nothing depends on it
};

/// The genus of the surface that a model's patches and seams make, by Euler's formula.
/// \pre the model is in one piece
int genus_of(const SkeletexModel& model);

/// The same model in another frame. Of scales that differ, texels are rounded once more.
/// \throw InputError when its diagonal would not be between kSmallestDiagonal and kLargestDiagonal there
SkeletexModel in_frame(SkeletexModel model, const UnitFrame& frame);

}  // namespace skeletex
