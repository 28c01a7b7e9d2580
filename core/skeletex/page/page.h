// SPDX-License-Identifier: MIT
#pragma once
#include <optional>
#include <string>

#include "skeletex/compact/compact_model.h"
#include "skeletex/device/context.h"
#include "skeletex/geometry/mesh.h"
#include "skeletex/model/texture.h"
#include "skeletex/skeleton/correspondence.h"

namespace skeletex {

/// Whether the library was built with the page's script, for which the build needs npm.
bool has_page_script();

/// The model that a page morphs to and transfers from.
struct PageSecond {
  std::string name;
  SkeletexModel model;
  Correspondence correspondence;  ///< from the first model's bones
};

/// What a page's model was decoded from.
struct PageCompact {
  CompactModel model;
  int octaves = 0;  ///< as decode_model took them
};

struct PageOptions {
  std::string name;  ///< of the model, as the page's title has it
  /// Where it is given, and no second model, the page holds the numbers of the compact model instead of texels and
  /// decodes them.
  std::optional<PageCompact> compact;
  std::optional<PageSecond> second;
  const TriangleMesh* reference = nullptr;  ///< mesh that errors are measured to; nullptr: none are shown
  /// How the page stands the model at first: z up and -y in front, or y and z; none: by the model's own up direction.
  std::optional<bool> is_z_up;
  int smallest = 32;  ///< longer side of the coarsest level of detail
};

/// An HTML page that draws a model in a browser from its texture, without a server or a network. The page holds the
/// texture at its size and at each half of it, as 16-bit numbers (pack.h), and the seams. Its vertex shader moves the
/// same lattice to the same points as reconstruct_mesh and its smooth poses do, to 1e-5 diagonals.
/// With a second model the page holds both textures and the tables that blend them (kernels/blend.cl) at keys of the
/// morph, and interpolates between the tables; the morph has creases (MorphOptions) and the first model's layout. It
/// also holds what a transfer makes of every bone.
/// \throw InputError when the models do not correspond, or the library was built without the script; DeviceError
std::string make_page(ClContext& context, const SkeletexModel& model, const PageOptions& options);

}  // namespace skeletex
