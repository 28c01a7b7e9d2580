// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <span>
#include <vector>

#include "skeletex/model/texture.h"

namespace skeletex {

/// Vertex numbers of the mesh that a model reconstructs to. In this order: the inner rows 1 .. height-2 of every patch,
/// row by row; one pole per free end; the samples of every arc; the corners. Rows 0 and height-1 are no vertices of
/// their own: they lie on seams, which both sides share, or on a pole.
struct Lattice {
  std::vector<int> first_inner;           ///< per patch: vertex of row 1, column 0
  std::vector<std::array<int, 2>> poles;  ///< per patch, at the head and at the tail; -1 where a seam is
  std::vector<int> first_sample;          ///< per arc
  int first_corner = 0;
  int inner_count = 0;
  int vertex_count = 0;
  std::vector<int> first_quad;  ///< per patch: quads between inner rows, row by row
  int quad_count = 0;
  int triangle_count = 0;  ///< quads, fans and strips together
};

/// A lattice row as the kernels see it: patch, row, number of its first vertex, number of its first quad. Quads of a
/// row lie between it and the next row of the table's patch.
using LatticeRow = std::array<int, 4>;

enum class RowChoice { kAll, kInner };  ///< kInner leaves out rows 0 and height - 1

/// The chosen rows of every patch. Vertices and quads are numbered patch by patch, row by row.
std::vector<LatticeRow> lattice_rows(const std::vector<Patch>& patches, RowChoice choice);
/// The inner rows that quads begin at: all but the last one of each patch.
std::vector<LatticeRow> quad_rows(const std::vector<Patch>& patches);

/// \throw InputError when a rectangle is below 4 x 4 or arcs and ends do not fit together, naming the bone
Lattice number_lattice(const SkeletexModel& model);

/// Vertices of a seam once around a patch's end, in the direction of growing v: arcs with the corners between them.
/// \pre the end has arcs
std::vector<int> end_loop(const SkeletexModel& model, const Lattice& lattice, BoneIndex bone, BoneEnd end);
/// Vertices of the inner row next to an end, by column.
std::vector<int> end_row(const SkeletexModel& model, const Lattice& lattice, BoneIndex bone, BoneEnd end);
/// The triangles between a pole and the inner row next to it, outward, of any numbering.
void append_pole_fan(std::span<const int> row, int pole, BoneEnd end, std::vector<Triangle>& triangles);
/// Those of a lattice.
void append_pole_fan(const SkeletexModel& model, const Lattice& lattice, BoneIndex bone, BoneEnd end,
                     std::vector<Triangle>& triangles);

}  // namespace skeletex
