// SPDX-License-Identifier: MIT
#include "skeletex/io/check_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <vector>

#include "skeletex/model/error.h"

namespace skeletex {
namespace {

class ModelCheck {
 public:
  ModelCheck(const SkeletexModel& model, const std::string& where) : m_(model), where_(where) {}

  void run() {
    require(m_.diagonal >= kSmallestDiagonal && m_.diagonal <= kLargestDiagonal, "diagonal",
            fmt::format("must be a length from {:g} to {:g}, as single precision holds no others", kSmallestDiagonal,
                        kLargestDiagonal));
    const UnitFrame& frame = m_.skeleton.frame;
    require(frame.scale >= kSmallestScale && frame.scale <= kLargestScale, "frame",
            fmt::format("its scale must be a length from {:g} to {:g}", kSmallestScale, kLargestScale));
    require(frame.offset.allFinite() && frame.offset.cwiseAbs().maxCoeff() <= kLargestScale, "frame",
            fmt::format("its offset must lie within {:g} of zero", kLargestScale));
    require(m_.origin.allFinite() && m_.origin.cwiseAbs().maxCoeff() <= 1e12 * m_.diagonal, "origin",
            "must be finite, and within 1e12 diagonals of zero");
    require(m_.genus >= 0, "genus", "must not be negative");
    require(m_.texture.width > 0 && m_.texture.height > 0 && m_.texture.width <= kMaxTextureSize &&
                m_.texture.height <= kMaxTextureSize,
            "texture", fmt::format("its sides must be from 1 to {}", kMaxTextureSize));
    check_skeleton();
    require(m_.patches.size() == m_.skeleton.bones.size() && m_.ends.size() == m_.skeleton.bones.size(), "patches",
            "there must be one for each bone");
    check_patches();
    check_corners();
    check_arcs();
    check_ends();
    require(m_.genus == genus_of(m_), "genus",
            fmt::format("it is {}, and patches and seams make a surface of genus {}", m_.genus, genus_of(m_)));
  }

 private:
  void require(bool condition, const std::string& entry, const std::string& rule) const {
    if (!condition)
      throw IoError(fmt::format("{}: {}: {}; the file is damaged or was not written by skeletex", where_, entry, rule));
  }
  static std::string entry(const char* list, std::size_t i) { return fmt::format("{}[{}]", list, i); }

  int node_of(std::size_t bone, std::size_t end) const {
    return end == 0 ? m_.skeleton.bones[bone].head : m_.skeleton.bones[bone].tail;
  }
  bool is_at(BoneIndex bone, NodeIndex node) const {
    return m_.skeleton.bones[bone].head == node || m_.skeleton.bones[bone].tail == node;
  }
  bool is_index(int index, const auto& list) const { return index >= 0 && index < static_cast<int>(list.size()); }
  bool is_sample(const SeamSample& s) const {
    return s.turn >= 0 && s.turn < 1 && s.distance >= 0 && s.distance <= kMostDiagonals * m_.diagonal;
  }

  void check_skeleton() {
    const auto& bones = m_.skeleton.bones;
    for (const Node& node : m_.skeleton.nodes)
      require(node.position.allFinite() &&
                  (node.position - m_.origin).cwiseAbs().maxCoeff() <= kMostDiagonals * m_.diagonal,
              "skeleton",
              fmt::format("node \"{}\" must lie within {:g} diagonals of the origin", node.name, kMostDiagonals));
    bones_at_.assign(m_.skeleton.nodes.size(), 0);
    require(!bones.empty(), "skeleton", "must have a bone");
    for (const Bone& bone : bones) {
      require(
          is_index(bone.head, m_.skeleton.nodes) && is_index(bone.tail, m_.skeleton.nodes) && bone.head != bone.tail,
          "skeleton", fmt::format("bone \"{}\" must join two nodes", bone.name));
      require(bone.s && bone.s->cwiseAbs().maxCoeff() >= 1e-6 && bone.s->cwiseAbs().maxCoeff() <= 1e6, "skeleton",
              fmt::format("bone \"{}\" must have its s, a direction of length about 1", bone.name));
      const double length = (m_.skeleton.nodes[bone.tail].position - m_.skeleton.nodes[bone.head].position).norm();
      require(length >= 1e-6 * m_.diagonal, "skeleton",
              fmt::format("bone \"{}\" must be at least a millionth of the diagonal long", bone.name));
      ++bones_at_[bone.head];
      ++bones_at_[bone.tail];
    }
    try {
      bone_bases(m_.skeleton);
      check_directions(m_.skeleton);
    } catch (const Error& error) {
      throw IoError(fmt::format("{}: skeleton: {}", where_, error.what()));
    }
  }

  void check_patches() const {
    std::vector<bool> is_taken(static_cast<std::size_t>(m_.texture.width) * static_cast<std::size_t>(m_.texture.height),
                               false);
    for (std::size_t i = 0; i < m_.patches.size(); ++i) {
      const Patch& patch = m_.patches[i];
      const Rectangle& r = patch.rectangle;
      require(r.x >= 0 && r.y >= 0 && r.width >= 3 && r.height >= 2 && r.width <= m_.texture.width &&
                  r.height <= m_.texture.height && r.x <= m_.texture.width - r.width &&
                  r.y <= m_.texture.height - r.height,
              entry("patches", i),
              fmt::format("its rectangle must be at least 3 x 2 and lie in the texture of {} x {}", m_.texture.width,
                          m_.texture.height));
      bool is_apart = true;
      for (int y = r.y; y < r.y + r.height; ++y) {
        const auto first = is_taken.begin() + y * static_cast<std::ptrdiff_t>(m_.texture.width) + r.x;
        is_apart = is_apart && std::find(first, first + r.width, true) == first + r.width;
        std::fill_n(first, r.width, true);
      }
      require(is_apart, entry("patches", i), "its rectangle must not overlap others");
      require(static_cast<int>(patch.row_u.size()) == r.height, entry("patches", i),
              "row_u must have an entry per row");
      bool is_increasing = patch.row_u.front() == 0 && patch.row_u.back() == 1;
      for (std::size_t row = 1; row < patch.row_u.size(); ++row)
        is_increasing = is_increasing && patch.row_u[row - 1] < patch.row_u[row];
      require(is_increasing, entry("patches", i), "row_u must increase from 0 to 1");
      const int free_ends = (bones_at_[node_of(i, 0)] == 1) + (bones_at_[node_of(i, 1)] == 1);
      constexpr std::array kTopologies{SegmentTopology::kAnnulus, SegmentTopology::kDisk, SegmentTopology::kSphere};
      require(
          patch.topology == kTopologies[free_ends], entry("patches", i),
          fmt::format("a bone with {} free ends has the topology {}", free_ends, to_string(kTopologies[free_ends])));
    }
  }

  void check_corners() const {
    for (std::size_t i = 0; i < m_.corners.size(); ++i) {
      const SeamCorner& corner = m_.corners[i];
      require(is_index(corner.node, m_.skeleton.nodes), entry("corners", i), "its node must exist");
      std::vector<BoneIndex> bones = corner.bones;
      std::sort(bones.begin(), bones.end());
      require(bones.size() >= 3 && std::adjacent_find(bones.begin(), bones.end()) == bones.end(), entry("corners", i),
              "three or more bones meet at a corner");
      for (const BoneIndex bone : bones)
        require(is_index(bone, m_.skeleton.bones) && is_at(bone, corner.node), entry("corners", i),
                "its bones must lie at its node");
      require(is_sample(corner.sample), entry("corners", i),
              "turn must be in [0,1), distance not negative and at most 100 diagonals");
    }
  }

  void check_arcs() const {
    for (std::size_t i = 0; i < m_.arcs.size(); ++i) {
      const SeamArc& arc = m_.arcs[i];
      require(is_index(arc.node, m_.skeleton.nodes), entry("arcs", i), "its node must exist");
      require(arc.bones[0] != arc.bones[1], entry("arcs", i), "lies between two bones");
      for (const BoneIndex bone : arc.bones)
        require(is_index(bone, m_.skeleton.bones) && is_at(bone, arc.node), entry("arcs", i),
                "its bones must lie at its node");
      require((arc.corners[0] < 0) == (arc.corners[1] < 0), entry("arcs", i), "has two corners or none");
      for (const int corner : arc.corners) {
        if (arc.is_closed()) continue;
        require(is_index(corner, m_.corners) && m_.corners[corner].node == arc.node, entry("arcs", i),
                "its corners must exist and lie at its node");
        for (const BoneIndex bone : arc.bones) {
          const auto& bones = m_.corners[corner].bones;
          require(std::find(bones.begin(), bones.end(), bone) != bones.end(), entry("arcs", i),
                  "its bones must meet at its corners");
        }
      }
      require(arc.samples.size() >= (arc.is_closed() ? 3u : 1u), entry("arcs", i),
              "a closed arc has at least three samples, an open one at least one");
      require(std::all_of(arc.samples.begin(), arc.samples.end(), [&](const SeamSample& s) { return is_sample(s); }),
              entry("arcs", i), "turns must be in [0,1), distances not negative and at most 100 diagonals");
    }
  }

  /// The arcs of an end, which `uses` counts: per arc how often by its first and its second bone.
  void check_end(std::size_t bone, std::size_t end, std::vector<std::array<int, 2>>& uses) const {
    const std::string here = fmt::format("patches[{}], ends.{}", bone, end == 0 ? "head" : "tail");
    const std::vector<ArcUse>& loop = m_.ends[bone][end].arcs;
    const NodeIndex node = node_of(bone, end);
    const BoneIndex own = static_cast<int>(bone);
    require(loop.empty() == (bones_at_[node] == 1), here,
            "arcs run along an end that has neighbours, and none along a free one");
    for (std::size_t k = 0; k < loop.size(); ++k) {
      require(is_index(loop[k].arc, m_.arcs), here, "its arcs must exist");
      const SeamArc& arc = m_.arcs[loop[k].arc];
      require(arc.node == node && (arc.bones[0] == own || arc.bones[1] == own), here,
              "its arcs must be the bone's own");
      const std::size_t side = arc.bones[0] == own ? 0 : 1;
      ++uses[loop[k].arc][side];
      // Angles about two bones run against each other when both begin, or both end, at the node.
      const std::size_t other = static_cast<std::size_t>(m_.skeleton.bones[arc.bones[1 - side]].head == node ? 0 : 1);
      require(loop[k].is_reversed == (side == 1 && other == end), here,
              "an arc runs with the angle about its first bone");
      if (arc.is_closed()) {
        require(loop.size() == 1, here, "a closed arc is a loop of its own");
        continue;
      }
      const ArcUse& after = loop[(k + 1) % loop.size()];
      require(is_index(after.arc, m_.arcs), here, "its arcs must exist");
      const int from = arc.corners[loop[k].is_reversed ? 0 : 1],
                to = m_.arcs[after.arc].corners[after.is_reversed ? 1 : 0];
      require(from == to, here, "each arc must begin where the one before ends");
    }
  }

  void check_ends() const {
    std::vector<std::array<int, 2>> uses(m_.arcs.size(), {0, 0});
    for (std::size_t bone = 0; bone < m_.ends.size(); ++bone)
      for (const std::size_t end : {0u, 1u}) check_end(bone, end, uses);
    for (std::size_t i = 0; i < uses.size(); ++i)
      require(uses[i][0] == 1 && uses[i][1] == 1, entry("arcs", i), "must be part of one end of each of its two bones");
  }

  const SkeletexModel& m_;
  const std::string& where_;
  std::vector<int> bones_at_;
};

}  // namespace

void check_model(const SkeletexModel& model, const std::string& where) { ModelCheck(model, where).run(); }

}  // namespace skeletex
