// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/model/segment.h"
#include "skeletex/model/texture.h"
#include "skeletex/skeleton/separation_planes.h"

namespace skeletex {

/// The seams of a model: arcs and corners stored once, and how each patch's ends run through them.
struct Seams {
  std::vector<SeamArc> arcs;  ///< same indices as the segmentation's arcs
  std::vector<SeamCorner> corners;
  std::vector<std::array<PatchEnd, 2>> ends;
};

enum class SeamSampling {
  kEven,     ///< evenly in the arc's length
  kSnapped,  ///< evenly, but for samples near a bend of the arc (where it crosses an edge of the mesh), which sit on it
};

/// Samples every arc as densely as the finer of its two patches has columns there; open arcs get at least one inner
/// sample, closed ones at least three.
/// \param rectangles  per bone
Seams sample_seams(const Segmentation& segmentation, const Skeleton& skeleton, const SeparationPlanes& separation,
                   std::span<const Rectangle> rectangles, SeamSampling sampling = SeamSampling::kEven);

/// Points of a segment's boundary loop at `columns` texels: where the loop's polyline passes v = j / columns
/// (loop_turns). World coordinates.
std::vector<Vec3> points_on_loop(const Segment& segment, const Skeleton& skeleton, const SeparationPlanes& separation,
                                 BoneEnd end, int columns);

}  // namespace skeletex
