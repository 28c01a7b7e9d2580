// SPDX-License-Identifier: MIT
#pragma once
#include <cstddef>
#include <optional>

namespace skeletex {

/// Where the texels of VSM patches read, and where their points lie.
struct TexelPlacing {
  bool has_snap = false;         ///< on vertices and edges of the mesh where they can
  double fit_steps = 0;          ///< their points are fitted to the mesh in so many steps; 0: they lie on it
  double texels_per_vertex = 0;  ///< of the mesh
  double expected_error = 1;     ///< mean distance from the mesh, share of a regular grid's
  bool is_fitted() const { return fit_steps > 0; }
  bool is_regular_grid() const { return !has_snap && !is_fitted(); }
};

/// What is best for a number of texels. The expected error of each choice is a power of the texels per vertex, as
/// measured on the standard models (docs/steps/snap.md): snapping is taken where it is expected to lower the error. The
/// fit always lowers it, but takes longer than all else: it is taken where it is quick, and where there are few texels
/// per vertex; between few and many its steps become fewer.
/// \param has_snap, has_fit  what the user chose; without, it is chosen here
TexelPlacing choose_placing(std::size_t texels, std::size_t vertices, std::optional<bool> has_snap,
                            std::optional<bool> has_fit);

}  // namespace skeletex
