// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <span>
#include <vector>

#include "skeletex/reconstruct/pose/skin.h"

namespace skeletex {

/// What moves the vertices of a mesh in other programs: four bones per vertex.
struct VertexInfluences {
  std::vector<std::array<int, 4>> bones;      ///< the strongest first; 0 where the weight is 0
  std::vector<std::array<float, 4>> weights;  ///< their sum is 1
};

/// The four strongest bones of each vertex of the model's mesh; the others are left out.
VertexInfluences strongest_influences(const Skin& skin);

/// Linear blend skinning: the mean of where the bones take a point. A bone that gets longer or shorter stretches its
/// points along itself.
/// \param positions  in the bind pose, as many as there are influences
/// \return positions in the pose, in the same units
std::vector<Vec3> skin_linearly(std::span<const Vec3> positions, const VertexInfluences& influences,
                                std::span<const BoneMotion> motions);

}  // namespace skeletex
