// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/model/texture.h"

namespace skeletex {

/// What a file that does not say it most likely means: up is y and front is z, as in glTF and most OBJ. A body that is
/// half as tall again along z as along y, and stands on two limbs or more at its lower end there, has z up and looks
/// along -y. Front is turned round where bones that are named left would lie on the right. Where no names tell, it is
/// turned round where the feet of an upright body, or the head of a long one, point backwards.
Stance guess_stance(const TriangleMesh& mesh, const Skeleton& skeleton);
/// A stance from directions that need not be unit or orthogonal.
/// \param front  none: z, or -y where that is along `up`
/// \throw InputError when they have no length, or are parallel
Stance make_stance(const Vec3& up, const std::optional<Vec3>& front);

}  // namespace skeletex
