// SPDX-License-Identifier: MIT
#pragma once
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "skeletex/convert/choose_placing.h"
#include "skeletex/convert/layers/read_layers.h"
#include "skeletex/convert/layout/patch_requests.h"
#include "skeletex/convert/measure/bone_distances.h"
#include "skeletex/convert/parameterize/spd.h"
#include "skeletex/convert/parameterize/vsm.h"
#include "skeletex/convert/sample/read_texels.h"
#include "skeletex/device/context.h"
#include "skeletex/geometry/triangle_tree.h"
#include "skeletex/model/texture.h"

namespace skeletex {

/// How rows are spread along a bone: evenly in surface length (the default), or evenly in the map's u (the paper).
enum class RowSpacing { kSurfaceLength, kUniform };
struct EncodeOptions {
  int width = 512, height = 512;
  /// Of all bones; without, each bone takes SPD or VSM (hybrid).
  std::optional<Method> method = Method::kVsm;
  /// Hybrid: bones whose unseen share of area is above this take VSM; the others SPD, where it is hardly further from
  /// the mesh than VSM (docs/steps/spd.md).
  double hybrid_unseen_threshold = 0.01;
  /// Hybrid: bones by name whose method the user chose.
  std::vector<std::pair<std::string, Method>> hybrid_overrides;
  VsmOptions vsm;
  bool reweights_squeezed = true;  ///< bones of which VSM squeezes a part are reweighted further (docs/steps/vsm.md)
  SpdHit spd_hit = SpdHit::kLast;
  RowSpacing row_spacing = RowSpacing::kSurfaceLength;
  bool has_prefilter = true;
  bool has_unfold = true;  ///< see unfold_lattice; snapping and fit start from the lattice that it leaves
  /// Texels of VSM patches sit on the mesh's own vertices and edges where they can (docs/steps/snap.md). Takes the
  /// prefilter's place. Default: see choose_placing.
  std::optional<bool> has_snap;
  /// Their points move so that the flat triangles between them are nearer to the mesh (docs/steps/snap.md). Takes the
  /// prefilter's place. Default: with the prefilter, see choose_placing.
  std::optional<bool> has_fit;
  std::optional<DiagonalRule> diagonals;  ///< default: smooth with snapping or fit, else nearest
  /// Texels come as half floats hold them (docs/steps/sample.md): write_model stores them as such without loss.
  bool has_half_texels = false;
  std::optional<TexelShare> texel_share;  ///< and of the side ratio; default: area for all-SPD models, error otherwise
  /// What else the mesh has, of which the layers are read: its normals, colours and numbers. Without, normals are those
  /// of its triangles.
  const MeshAttributes* attributes = nullptr;
  LayerOptions layers;
  std::optional<Stance> stance;  ///< of the mesh, for the record
  /// Of the mesh, as validate_before_segmentation has built it; without, it is built where it is needed. Another mesh's
  /// is an error.
  const TriangleTree* tree = nullptr;
  /// Called with a stage's name and the share of work done; returning false cancels by throwing Error.
  std::function<bool(const std::string& stage, double done)> progress;
};

struct BoneReport {
  std::string name;
  Method method = Method::kVsm;
  SegmentTopology topology = SegmentTopology::kAnnulus;
  double area = 0;  ///< in the user's units, squared
  int vertices = 0, triangles = 0;
  Rectangle rectangle;
  double unseen_area_fraction = 0;
  int flipped_triangles = 0;             ///< of the map
  double sampled_triangle_fraction = 0;  ///< share of the segment's triangles that a texel reads
  int missed_texels = 0;                 ///< filled from their neighbours, see TexelReport
  BoneDistance distance;  ///< of its surface to the decoded mesh, in the unit frame; its place is the user's
  /// Of height fields: of the decoded mesh to the surface, likewise.
  BoneDistance excess;
  MapReport map;
};

/// Whether a part of a bone's surface is missing from the model: it is further away than ten times the bone's median
/// and half a percent of the diagonal.
inline bool lacks_part(const BoneReport& bone, double diagonal) {
  return bone.distance.furthest > 10 * bone.distance.median && bone.distance.furthest > 0.005 * diagonal;
}

/// Whether a bone's part of the model is a false surface: it is more than three thousandths of the diagonal away from
/// the mesh on average, as where rays of SPD meet the surface more than once.
inline bool has_false_surface(const BoneReport& bone, double diagonal) { return bone.excess.mean > 0.003 * diagonal; }

struct EncodeReport {
  int vertices = 0, triangles = 0, genus = 0;  ///< of the mesh
  int split_triangles = 0;                     ///< of the mesh after its long edges were split; 0: none were
  double diagonal = 0;  ///< of the mesh in the frame of the model, as are the lengths of the reports below
  double scale = 1;     ///< of that frame
  std::vector<BoneReport> bones;
  double used_fraction = 0;
  TexelPlacing placing;                    ///< what was chosen for VSM patches; of SPD models 0 texels per vertex
  std::optional<UnfoldReport> unfold;      ///< when it was on
  std::optional<SnapReport> snap;          ///< when it was on
  std::optional<FitReport> fit;            ///< when it was on
  std::optional<RoundingReport> rounding;  ///< to half floats, when it was on
  std::optional<RevertReport> revert;      ///< with snapping or fit
  std::vector<std::string> layer_notes;    ///< see ReadLayers
  double half_edge_ms = 0, segmentation_ms = 0, parameterization_ms = 0, encoding_ms = 0, layers_ms = 0;
  std::string device;
};

struct EncodeResult {
  SkeletexModel model;
  EncodeReport report;
};

/// Turns a closed mesh and its skeleton into a model (paper 3.1-3.4): half edges, segments, maps, atlas, texels. Both
/// are in the frame of the skeleton, which becomes that of the model; unit_frame (geometry/mesh.h) is the frame in
/// which all scales and places give the same texels.
/// \pre validate_before_segmentation reports no error
/// \throw TopologyError, InputError, DeviceError
EncodeResult encode_model(ClContext& context, const TriangleMesh& mesh, const Skeleton& skeleton,
                          const EncodeOptions& options = {});

}  // namespace skeletex
