// SPDX-License-Identifier: MIT
#pragma once
#include <functional>
#include <optional>
#include <string>

#include "skeletex/convert/encode_model.h"
#include "skeletex/geometry/cut_mesh.h"
#include "skeletex/skeletonize/repair.h"

namespace skeletex {

/// Names for messages and files while there are none better: "node_3", "bone_7".
void give_numbers(Skeleton& skeleton);

/// Repairs a skeleton until the encoder accepts it.
class Acceptance {
 public:
  Acceptance(ClContext& context, const Surface& surface);

  /// Where segmentation refuses, nodes are moved and, when that does not help, bones contracted.
  /// \param stop  called after each contraction; the skeleton is given up for the reason that it returns, unless empty
  /// \return why the skeleton cannot be used; empty when it can
  std::string segment(Repair& repair, const std::function<std::string(const Repair&)>& stop = {}) const;

  /// Whether segmentation takes a skeleton as it is.
  bool is_accepted(const Skeleton& skeleton) const;

  struct Trial {
    double error = 0;     ///< symmetric surface mean / diagonal
    std::string refusal;  ///< empty when it was encoded
  };
  /// The error of a model of 128 x 128 texels with that skeleton. In place of a large mesh, a coarse one is encoded.
  Trial encode(const Skeleton& skeleton) const;

 private:
  Trial encode_mesh(const TriangleMesh& mesh, const TriangleTree& tree, const Skeleton& skeleton) const;

  ClContext& context_;
  const Surface& surface_;
  CutMesh cut_;
  /// In place of a large mesh.
  struct Coarse {
    TriangleMesh mesh;
    TriangleTree tree;
  };
  std::optional<Coarse> coarse_;
};

}  // namespace skeletex
