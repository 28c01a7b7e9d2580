// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <memory>
#include <span>
#include <vector>

#include "skeletex/convert/sample/device_maps.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex {

/// The lattice rows that quads between inner rows begin at, of each patch one after the other.
std::vector<LatticeRow> quad_rows(const std::vector<Patch>& patches);
/// Queues which diagonals the decoder takes (one launch): per texel whether the quad to the right of and above it takes
/// the second one. \param rows       quad_rows \param records    see frame_tables \param points     x, y, z per texel
/// of the texture; those of rows 0 and height-1 do not count \param diagonals  out, per texel; of others than those of
/// quads nothing is written
void choose_diagonals(ClContext& context, DiagonalRule rule, const std::vector<Patch>& patches, int texture_width,
                      const ClBuffer<LatticeRow>& rows, const ClBuffer<PatchRecord>& records, const TexelPoints& points,
                      ClBuffer<int>& diagonals);

/// What of a LatticeMesh does not depend on points.
struct LatticeFrame {
  Lattice ends;                    ///< poles, samples and corners alone, numbered from 0
  std::vector<int> texel_patches;  ///< -1: none
  std::vector<Vec3> positions;     ///< of samples and corners
  std::vector<EndSeam> seams;      ///< per patch and end
  std::vector<int> first_end;      ///< triangles, counted from those at the first end; and the end
};
/// \param model  of its texture only the size is looked at
std::shared_ptr<const LatticeFrame> frame_lattice(const SkeletexModel& model);

/// The mesh that a model would reconstruct to whose texels decode to given points; its own texture is not looked at.
/// Points can move, and what stands on them follows. Numbers are those of texels, so that most of it is never written
/// down:
///  - vertex: its texel; poles, samples of seams and corners follow behind all texels in the order of lattice.h;
///  - triangles 2 t and 2 t + 1: of the quad to the right of and above texel t, between inner rows; those at ends
///  follow behind all.
class LatticeMesh {
 public:
  /// Which triangles there are from the beginning.
  enum class Parts {
    kAll,
    kAsked  ///< none before `choose` and `fill_ends`: no others may be asked for, and nothing may `move`
  };
  /// \param rule     of its diagonals, in place of the model's
  /// \param frame    of the model
  /// \param patches  see frame_tables
  /// \param points   x, y, z per texel of the texture, relative to the model's origin; of rows 0 and height-1 only
  /// poles count.
  ///                 These planes are kept, not copied, and read by the host: see `release` for what changes in them
  LatticeMesh(ClContext& context, const SkeletexModel& model, DiagonalRule rule,
              std::shared_ptr<const LatticeFrame> frame, ClBuffer<PatchRecord> patches, TexelPoints points,
              Parts parts = Parts::kAll);
  /// Other points of the same model, with which it has in common what does not depend on them. All its triangles are
  /// there. \param context  another queue than that of the other lattice can go on beside it
  LatticeMesh(ClContext& context, const LatticeMesh& other, DiagonalRule rule, TexelPoints points);

  const SkeletexModel& model() const { return model_; }
  int texel_count() const { return static_cast<int>(frame_->texel_patches.size()); }
  int vertex_count() const { return texel_count() + static_cast<int>(end_points_.size()); }
  int first_end_triangle() const { return 2 * texel_count(); }
  int triangle_count() const { return first_end_triangle() + frame_->first_end.back(); }

  bool is_texel(int vertex) const { return vertex < texel_count(); }
  int patch_of(int texel) const { return frame_->texel_patches[texel]; }
  /// The texel beside one of the same patch, around it.
  int right_of(int texel) const;
  /// Vertices of a triangle, counter-clockwise from outside.
  Triangle triangle(int index) const;
  bool takes_second(int texel) const { return diagonals_[texel] != 0; }
  const ClMapping<int>& diagonals() const { return diagonals_; }
  /// The two of a texel's quad. \param right  the texel beside it
  std::array<Triangle, 2> triangles_of(int texel, int right) const {
    // As write_quad in reconstruct.cl.
    const int above = texel + model_.texture.width, beyond = right + model_.texture.width;
    if (takes_second(texel)) return {{{texel, right, above}, {above, right, beyond}}};
    return {{{texel, right, beyond}, {texel, beyond, above}}};
  }
  /// From the model's origin, in single precision: x, y and z per texel, and of any vertex.
  const std::array<ClMapping<float>, 3>& planes() const { return planes_; }
  Eigen::Array4f point(int vertex) const {
    if (!is_texel(vertex)) return end_points_[vertex - texel_count()];
    return {planes_[0][vertex], planes_[1][vertex], planes_[2][vertex], 0};
  }
  Vec3 position(int vertex) const {
    if (!is_texel(vertex)) return end_positions_[vertex - texel_count()];
    return model_.origin + Vec3(planes_[0][vertex], planes_[1][vertex], planes_[2][vertex]);
  }
  std::array<Vec3, 3> corners(const Triangle& t) const { return {position(t[0]), position(t[1]), position(t[2])}; }
  /// Of a strip or fan, the first triangle and that behind the last.
  std::pair<int, int> triangles_of_end(int bone, BoneEnd end) const {
    const std::size_t i = 2 * bone + static_cast<int>(end);
    return {first_end_triangle() + frame_->first_end[i], first_end_triangle() + frame_->first_end[i + 1]};
  }
  /// Whether that is a fan around a pole.
  bool is_pole(int bone, BoneEnd end) const { return frame_->ends.poles[bone][static_cast<int>(end)] >= 0; }

  const TexelPoints& device_points() const { return points_; }
  /// Those of vertices behind the texels, from the model's origin.
  const TexelPoints& device_end_points() const { return device_end_points_; }
  /// Per texel whether its quad takes the second diagonal.
  const ClBuffer<int>& device_diagonals() const { return device_diagonals_; }
  const ClBuffer<LatticeRow>& device_rows() const { return rows_; }
  const ClBuffer<PatchRecord>& device_patches() const { return patches_; }

  /// The diagonals of some quads, by their texels, in order, of a lattice of which not all are there.
  void choose(std::span<const int> texels);
  /// The triangles at some ends: of patch i 2 i and 2 i + 1.
  void fill_ends(std::span<const int> ends);

  /// Before anything writes to its points on the device: until `move` no vertex' place can be asked for.
  void release() { planes_ = {}; }
  /// These inner texels, and no others, have other points since `release`. Quads around them take their diagonals anew,
  /// strips beside them are filled anew. \param points  x, y, z of all: the planes that the constructor was given
  /// \return the triangles that are not what they were, in order
  std::vector<int> move(std::span<const int> texels, std::array<ClMapping<float>, 3> points);

 private:
  void choose_listed(std::span<const int> quads);
  std::vector<std::vector<Triangle>> make_ends(std::span<const int> ends);

  ClContext& context_;
  const SkeletexModel& model_;
  DiagonalRule rule_;
  std::shared_ptr<const LatticeFrame> frame_;
  ClBuffer<LatticeRow> rows_;  // those that quads begin at
  ClBuffer<PatchRecord> patches_;
  std::array<ClMapping<float>, 3> planes_;
  std::vector<Eigen::Array4f> end_points_;  // of vertices behind the texels
  std::vector<Vec3> end_positions_;         // the same in double precision, not from the model's origin
  std::vector<Triangle> end_triangles_;
  ClMapping<int> diagonals_;
  TexelPoints points_, device_end_points_;
  ClBuffer<int> device_diagonals_;
};

}  // namespace skeletex
