// SPDX-License-Identifier: MIT
#pragma once
#include <optional>
#include <string>

#include "command.h"
#include "skeletex/close/carry_over.h"

namespace skeletex::cli {

inline constexpr double kLongestHandleLoop = 2;  ///< diagonals: every handle has a loop around it that is no longer

/// --close, --close-detail and --close-handles.
struct CloseOptions {
  bool is_on = false;
  std::optional<double> detail;   ///< of a wrap, diagonals
  std::optional<double> handles;  ///< those that a loop of that length goes around are cut, diagonals
  bool has_rig = false;           ///< whose skeleton has no rings around handles: longer loops are cut then
};
void add_close_options(CLI::App& command, CloseOptions& options);

/// A mesh with what belongs to it.
struct MeshParts {
  TriangleMesh mesh;
  MeshAttributes attributes;
  VertexBoneWeights weights;
};
/// Makes a mesh closed and of one part: fills its holes, else unites its parts or wraps it by the program
/// skeletex_wrap, which is beside this one or on the PATH. Then cuts handles off: of a union or a wrap, and where
/// --close-handles is given. Says what it did, and how far a wrap is from the mesh.
///
/// \throw InputError when that program is not there, or could not wrap it
/// \return for the JSON
Json close_mesh(MeshParts& open, const CloseOptions& options);

/// Cuts handles off a closed mesh of one part, and says which.
/// \param longest  length of the loops around them, diagonals
/// \return the loops, for the JSON
Json cut_handles_off(MeshParts& parts, double longest);

}  // namespace skeletex::cli
