// SPDX-License-Identifier: MIT
#pragma once
#include <future>
#include <vector>

#include "skeletex/convert/sample/device_maps.h"
#include "skeletex/convert/snap/lattice_mesh.h"
#include "skeletex/geometry/nearest_search.h"

namespace skeletex {

/// Normals of the mesh near texels, three planes.
/// \param texel_triangles  per texel a triangle of the maps near it, or none
ClBuffer<float> find_texel_normals(ClContext& context, const DeviceLayout& layout, const DeviceMaps& maps,
                                   const ClBuffer<int>& texel_triangles);

/// Per texel the square of how far the quad to the right of and above it could be from the mesh; infinite where it
/// looks against that at a corner. \param rows           quad_rows \param points         of a lattice whose diagonals
/// are not chosen \param texel_normals  see find_texel_normals
ClBuffer<float> suspect_any_quads(ClContext& context, const DeviceLayout& layout, const ClBuffer<LatticeRow>& rows,
                                  const TexelPoints& points, const ClBuffer<int>& texel_triangles,
                                  const ClBuffer<float>& texel_normals);

/// How far the triangles of a lattice are from the mesh that it was read from, and which of them look against it,
/// measured again where the lattice has changed. What is found from nearby (guard.cl) can be too far; what looks too
/// far is looked at again by a tree.
class TriangleDistances {
 public:
  /// All that is given by reference must outlive this.
  /// \param texel_normals  of the regular grid
  /// \param search         of the mesh, on the same queue
  TriangleDistances(ClContext& context, const TriangleMesh& mesh, const DeviceLayout& layout, const DeviceMaps& maps,
                    ClBuffer<float> texel_normals, NearestSearch search);

  /// A triangle of the lattice as it was measured last.
  struct Measured {
    int triangle;
    float distance;  ///< of the furthest of its places that were looked at, or more
    bool is_turned;  ///< looks against the mesh
  };

  /// Of the regular grid, the triangles that look most suspicious, of which it chooses the diagonals. Those at ends are
  /// not looked at. \param suspicions2      see suspect_any_quads \param texel_triangles  as for find_texel_normals
  /// \param turned           out: those that look against the mesh
  /// \return the furthest of them
  float measure_even(LatticeMesh& lattice, const ClMapping<float>& suspicions2, const ClBuffer<int>& texel_triangles,
                     std::vector<int>& turned);
  /// As suspect_any_quads, of another lattice than the even one with its diagonals, on a queue of its own.
  ClBuffer<float> suspect_quads(ClContext& on, const LatticeMesh& lattice, const ClBuffer<int>& texel_triangles) const;
  /// All triangles of that lattice that look suspicious, and all at ends.
  /// \param suspects  told as soon as they are known: those of them that seem nearly as far as the limit, or look
  /// against the mesh
  void measure_suspects(const LatticeMesh& lattice, const ClMapping<float>& suspicions2,
                        const ClBuffer<int>& texel_triangles, float limit, std::promise<std::vector<int>> suspects);
  /// Some of them again.
  /// \param asked  in order
  void measure_changed(const LatticeMesh& lattice, const std::vector<int>& asked, const ClBuffer<int>& texel_triangles,
                       float limit, std::promise<std::vector<int>> suspects);
  /// Triangles that are further than the limit, or look against the mesh.
  const std::vector<Measured>& faults() const { return faults_; }

 private:
  /// How near walks need not come nearer: from middles, and from other places, where middles are further than worth a
  /// look.
  struct Enough {
    float middle, worth_a_look, places;
  };
  void measure_triangles(const LatticeMesh& lattice, const std::vector<int>& asked,
                         const ClBuffer<int>& texel_triangles, float limit, std::promise<std::vector<int>> suspects);
  std::vector<int> suspicious_of(const LatticeMesh& lattice, const std::vector<int>& asked,
                                 const ClBuffer<int>& texel_triangles, float least2);
  std::vector<Measured> measure_near(const LatticeMesh& lattice, const std::vector<int>& asked,
                                     const ClBuffer<int>& texel_triangles, Enough enough);
  bool looks_against(const LatticeMesh& lattice, int triangle, int nearest) const;

  ClContext& context_;
  const TriangleMesh& mesh_;
  const DeviceLayout& layout_;
  const DeviceMaps& maps_;
  ClBuffer<float> texel_normals_;
  NearestSearch search_;
  std::vector<Measured> faults_;
};

}  // namespace skeletex
