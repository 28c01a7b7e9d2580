// SPDX-License-Identifier: MIT
#include "skeletex/convert/segment/segment_mesh.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include "skeletex/convert/segment/cells.h"
#include "skeletex/convert/segment/cut.h"
#include "skeletex/model/error.h"
#include "skeletex/model/texture.h"
#include "skeletex/skeleton/check_skeleton.h"
#include "skeletex/skeleton/separation_planes.h"

namespace skeletex {
namespace {

/// Which bone's side of which node's separation planes a half-edge runs along.
struct SeamSide {
  NodeIndex node;
  BoneAtNode bone;
};

/// A boundary of a bone's surface, in the order of its half-edges (surface on the left).
struct HalfEdgeLoop {
  std::vector<int> half_edges;
  int turning = 0;  ///< how often it runs around the bone's axis in the direction of growing v
};

class Segmenter {
 public:
  Segmenter(ClContext& context, CutMesh mesh, const Skeleton& skeleton)
      : context_(context),
        skeleton_(skeleton),
        separation_(skeleton),
        mesh_(std::move(mesh)),
        genus_(1 - (static_cast<int>(mesh_.positions.size()) - mesh_.triangle_count() / 2) / 2) {}

  Segmentation run() {
    check_skeleton_inside(mesh_, skeleton_);
    cut();
    flood();
    find_loops();
    build_arcs();
    build_segments();
    return std::move(result_);
  }

 private:
  const std::string& bone_name(BoneIndex bone) const { return skeleton_.bones[bone].name; }
  const std::string& node_name(NodeIndex node) const { return skeleton_.nodes[node].name; }
  const SeamSide& side(int half_edge) const { return sides_[mesh_.seams[half_edge]]; }
  const Vec3& position(VertexIndex vertex) const { return mesh_.positions[vertex]; }

  /// A part of the surface between separation planes.
  struct Component {
    int seam = -1;   ///< a half-edge that says whose it is
    int first = -1;  ///< triangle
  };

  void cut();
  void split_short_arcs();
  void flood();
  void flood_component(int seed, Component& component);
  void assign_components();
  void find_loops();
  HalfEdgeLoop trace_loop(int start);
  void check_loops(BoneIndex bone, BoneEnd end, bool is_wanted) const;
  void build_arcs();
  bool turn_to_first_corner(BoneIndex bone, NodeIndex node, std::vector<int>& ring) const;
  void add_arc(BoneIndex bone, BoneEnd end, bool has_corners, std::span<const int> half_edges);
  void build_segments();
  void add_triangles(const std::vector<int>& triangles, Segment& segment);
  void add_boundary(BoneEnd end, Segment& segment) const;
  void check_topology(const Segment& segment) const;
  [[noreturn]] void throw_crossing(NodeIndex node, const CutOutcome& outcome) const;
  [[noreturn]] void throw_run_over(int first, int second) const;
  double turn(BoneIndex bone, NodeIndex node, VertexIndex vertex) const {
    return separation_.turn_of(bone, position(vertex) - skeleton_.nodes[node].position);
  }

  ClContext& context_;
  const Skeleton& skeleton_;
  SeparationPlanes separation_;
  CutMesh mesh_;
  int genus_;  // Euler's formula for a closed triangle mesh: edges are 3/2 of the triangles
  std::vector<SeamSide> sides_;
  std::vector<std::uint8_t> seam_degree_;                        // seams that meet at a vertex
  std::vector<std::array<std::vector<HalfEdgeLoop>, 2>> loops_;  // per bone and end
  std::vector<int> arc_of_;                                      // half-edge -> arc, -1
  std::vector<int> triangle_counts_;                             // per bone
  std::vector<Component> components_;
  std::vector<int> component_of_;  // triangle -> component, -1
  std::vector<int> local_;         // vertex -> its number in the segment at hand, -1
  Segmentation result_;
};

void Segmenter::throw_crossing(NodeIndex node, const CutOutcome& outcome) const {
  const int other = side(outcome.crossed_half_edge).node;
  int between = -1;
  for (int b = 0; b < static_cast<int>(skeleton_.bones.size()); ++b)
    if ((skeleton_.bones[b].head == node && skeleton_.bones[b].tail == other) ||
        (skeleton_.bones[b].head == other && skeleton_.bones[b].tail == node))
      between = b;
  const BoneIndex bone = between >= 0 ? BoneIndex(between) : side(outcome.crossed_half_edge).bone.bone;
  throw TopologyError(
      fmt::format("bone \"{}\": the separation planes at node \"{}\" and at node \"{}\" cross inside "
                  "the body, at {} on the surface; move the nodes apart, or turn the bones there so "
                  "that their separation planes stand more nearly parallel",
                  bone_name(bone), node_name(other), node_name(node), text_of(skeleton_, outcome.point)),
      bone, node);
}

void Segmenter::cut() {
  const double diagonal = bounding_box(mesh_.positions).diagonal();
  const std::vector<NodeCells> nodes = node_cells(skeleton_, kMostPerturbation * diagonal);
  const std::vector<std::uint8_t> labels_at_nodes = classify_points(context_, mesh_.positions, nodes);
  const std::size_t input_count = mesh_.positions.size();
  std::vector<std::uint8_t> labels;
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    const auto row = labels_at_nodes.begin() + static_cast<std::ptrdiff_t>(n * input_count);
    labels.assign(row, row + static_cast<std::ptrdiff_t>(input_count));
    for (std::size_t v = input_count; v < mesh_.positions.size(); ++v)
      labels.push_back(static_cast<std::uint8_t>(nodes[n].cell_of(mesh_.positions[v])));
    const CutOutcome outcome = cut_along_separation(mesh_, nodes[n], labels, static_cast<int>(sides_.size()));
    if (outcome.status == CutStatus::kCrossesSeam) throw_crossing(nodes[n].node, outcome);
    if (outcome.status == CutStatus::kNoSurface)
      throw TopologyError(
          fmt::format(
              "bone \"{}\": no separation plane of node \"{}\" at {} meets the surface; move the node into the body",
              bone_name(nodes[n].cells[0].bone.bone), node_name(nodes[n].node), text_of(skeleton_, nodes[n].position)),
          nodes[n].cells[0].bone.bone, nodes[n].node);
    for (const Cell& cell : nodes[n].cells) sides_.push_back({nodes[n].node, cell.bone});
  }
  split_short_arcs();
}

/// Gives every open arc an inner vertex.
void Segmenter::split_short_arcs() {
  seam_degree_.assign(mesh_.positions.size(), 0);
  for (std::size_t h = 0; h < mesh_.origins.size(); ++h)
    if (mesh_.seams[h] >= 0 && seam_degree_[mesh_.origins[h]] < 255) ++seam_degree_[mesh_.origins[h]];
  // Splitting appends half-edges, which old ones may have become.
  for (std::size_t h = 0; h < mesh_.origins.size(); ++h)
    if (mesh_.seams[h] >= 0 && seam_degree_[mesh_.origins[h]] != 2 &&
        seam_degree_[mesh_.target(static_cast<int>(h))] != 2) {
      split_edge(mesh_, static_cast<int>(h));
      seam_degree_.push_back(2);
    }
}

void Segmenter::throw_run_over(int first, int second) const {
  const SeamSide &a = side(first), &b = side(second);
  std::vector<bool> is_used(skeleton_.nodes.size(), false);
  for (const Bone& bone : skeleton_.bones) is_used[bone.head] = is_used[bone.tail] = true;
  const int cycles =
      static_cast<int>(skeleton_.bones.size()) - static_cast<int>(std::count(is_used.begin(), is_used.end(), true)) + 1;
  std::string remedy;
  if (genus_ != cycles)
    remedy =
        fmt::format("the mesh has {} handle{} and the skeleton {} ring{} of bones; lay one ring through every handle",
                    genus_, genus_ == 1 ? "" : "s", cycles, cycles == 1 ? "" : "s");
  else if (a.node == b.node)
    remedy = fmt::format(
        "the separation planes at node \"{}\" do not close around the body; move the node, or turn the bones there",
        node_name(a.node));
  else
    remedy = fmt::format(
        "the separation planes at node \"{}\" or at node \"{}\" reach another part of the body; move one of them, or "
        "put a node in between",
        node_name(a.node), node_name(b.node));
  throw TopologyError(
      fmt::format("bone \"{}\": its surface runs over into that of bone \"{}\", from {} at node \"{}\" to {} at node "
                  "\"{}\" without a separation plane between; {}",
                  bone_name(a.bone.bone), bone_name(b.bone.bone), text_of(skeleton_, position(mesh_.origins[first])),
                  node_name(a.node), text_of(skeleton_, position(mesh_.origins[second])), node_name(b.node), remedy),
      a.bone.bone, a.node);
}

/// Marks the triangles of a component from one of them on.
void Segmenter::flood_component(int seed, Component& component) {
  const int number = static_cast<int>(components_.size()) - 1;
  std::vector<int> stack{seed};
  component_of_[seed] = number;
  while (!stack.empty()) {
    const int t = stack.back();
    stack.pop_back();
    for (int h = 3 * t; h < 3 * t + 3; ++h) {
      if (mesh_.seams[h] >= 0) {
        if (component.seam < 0) component.seam = h;
        if (side(h).bone.bone != side(component.seam).bone.bone) throw_run_over(component.seam, h);
        continue;
      }
      const int neighbour = mesh_.opposites[h] / 3;
      if (component_of_[neighbour] >= 0) continue;
      component_of_[neighbour] = number;
      stack.push_back(neighbour);
    }
  }
}

void Segmenter::flood() {
  const int triangle_count = mesh_.triangle_count();
  component_of_.assign(triangle_count, -1);
  for (int seed = 0; seed < triangle_count; ++seed)
    if (component_of_[seed] < 0) flood_component(seed, components_.emplace_back(Component{-1, seed}));
  assign_components();
}

/// Each bone gets one component.
void Segmenter::assign_components() {
  const int bone_count = static_cast<int>(skeleton_.bones.size());
  std::vector<int> component_of_bone(bone_count, -1), bone_of;
  for (int c = 0; c < static_cast<int>(components_.size()); ++c) {
    const Component& component = components_[c];
    if (component.seam < 0 && components_.size() > 1)
      throw TopologyError(
          fmt::format("a part of the mesh at {} belongs to no bone; join the mesh to one piece, or remove the part",
                      text_of(skeleton_, position(mesh_.origins[3 * component.first]))));
    const BoneIndex bone = component.seam < 0 ? BoneIndex(0) : side(component.seam).bone.bone;
    if (component_of_bone[bone] >= 0)
      throw TopologyError(fmt::format("bone \"{}\": its separation planes at node \"{}\" cut off a second piece of "
                                      "surface at {}; move the node so that they meet only the body around it",
                                      bone_name(bone), node_name(side(component.seam).node),
                                      text_of(skeleton_, position(mesh_.origins[component.seam]))),
                          bone, side(component.seam).node);
    component_of_bone[bone] = c;
    bone_of.push_back(bone);
  }
  for (int b = 0; b < bone_count; ++b)
    if (component_of_bone[b] < 0)
      throw TopologyError(
          fmt::format("bone \"{}\" gets no surface: the separation planes at its nodes \"{}\" {} and \"{}\" {} leave "
                      "it none; move its nodes apart",
                      bone_name(b), node_name(skeleton_.bones[b].head),
                      text_of(skeleton_, end_position(skeleton_, b, BoneEnd::kHead)),
                      node_name(skeleton_.bones[b].tail),
                      text_of(skeleton_, end_position(skeleton_, b, BoneEnd::kTail))),
          b, skeleton_.bones[b].head);
  triangle_counts_.assign(bone_count, 0);
  for (const int component : component_of_) {
    result_.triangle_bones.push_back(bone_of[component]);
    ++triangle_counts_[bone_of[component]];
  }
}

/// The boundary that a half-edge on a seam belongs to.
HalfEdgeLoop Segmenter::trace_loop(int start) {
  HalfEdgeLoop loop;
  const SeamSide& first = side(start);
  const BoneIndex bone = first.bone.bone;
  int h = start;
  do {
    if (side(h).node != first.node)
      throw TopologyError(fmt::format("bone \"{}\": the separation planes at nodes \"{}\" and \"{}\" meet at {} on the "
                                      "surface; move the nodes apart",
                                      bone_name(bone), node_name(first.node), node_name(side(h).node),
                                      text_of(skeleton_, position(mesh_.origins[h]))),
                          bone, first.node);
    loop.half_edges.push_back(h);
    h = CutMesh::next(h);
    while (mesh_.seams[h] < 0) h = CutMesh::next(mesh_.opposites[h]);
  } while (h != start);
  double turning = 0;
  double before = turn(bone, first.node, mesh_.origins[start]);
  for (const int half_edge : loop.half_edges) {
    const double now = turn(bone, first.node, mesh_.target(half_edge));
    turning += now - before - std::round(now - before);
    before = now;
  }
  loop.turning = static_cast<int>(std::lround(turning));
  return loop;
}

/// One boundary at an end that has neighbours, once around the bone.
void Segmenter::check_loops(BoneIndex bone, BoneEnd end, bool is_wanted) const {
  const auto& loops = loops_[bone][static_cast<int>(end)];
  const NodeIndex node = end_node(skeleton_, bone, end);
  if (is_wanted && loops.empty())
    throw TopologyError(fmt::format("bone \"{}\": its surface does not reach the separation planes of its node \"{}\" "
                                    "at {}; move the node, or lengthen the bone",
                                    bone_name(bone), node_name(node), text_of(skeleton_.nodes[node].position)),
                        bone, node);
  if (loops.size() > (is_wanted ? 1 : 0)) {
    // The one that winds around the bone is right; name another.
    const auto wrong = std::find_if(loops.begin(), loops.end(), [](const HalfEdgeLoop& l) { return l.turning == 0; });
    const HalfEdgeLoop& loop = wrong == loops.end() ? loops.back() : *wrong;
    throw TopologyError(fmt::format("bone \"{}\": its surface has {} boundaries at node \"{}\" instead of one, another "
                                    "at {}: the separation planes there reach a second part of the body; move the node "
                                    "or turn the bones so that they meet only the body around it",
                                    bone_name(bone), loops.size(), node_name(node),
                                    text_of(skeleton_, position(mesh_.origins[loop.half_edges[0]]))),
                        bone, node);
  }
  // With the surface on the left, a boundary at the head runs with growing v, one at the tail against it.
  if (is_wanted && loops[0].turning != (end == BoneEnd::kHead ? 1 : -1))
    throw TopologyError(
        fmt::format("bone \"{}\": its boundary at node \"{}\", through {}, does not run once around the bone; move the "
                    "node to the middle of the body",
                    bone_name(bone), node_name(node),
                    text_of(skeleton_, position(mesh_.origins[loops[0].half_edges[0]]))),
        bone, node);
}

/// All boundaries of all segments, checked.
void Segmenter::find_loops() {
  loops_.resize(skeleton_.bones.size());
  std::vector<char> is_seen(mesh_.origins.size(), 0);
  for (int start = 0; start < static_cast<int>(mesh_.origins.size()); ++start) {
    if (mesh_.seams[start] < 0 || is_seen[start]) continue;
    HalfEdgeLoop loop = trace_loop(start);
    for (const int h : loop.half_edges) is_seen[h] = 1;
    const BoneAtNode& owner = side(start).bone;
    loops_[owner.bone][static_cast<int>(owner.end)].push_back(std::move(loop));
  }
  const auto at_nodes = bones_at_nodes(skeleton_);
  for (int b = 0; b < static_cast<int>(loops_.size()); ++b) {
    int loop_count = 0;
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) {
      const bool is_wanted = at_nodes[end_node(skeleton_, b, end)].size() > 1;
      check_loops(b, end, is_wanted);
      loop_count += is_wanted;
    }
    result_.segments.push_back({});
    result_.segments.back().bone = b;
    result_.segments.back().topology = loop_count == 2   ? SegmentTopology::kAnnulus
                                       : loop_count == 1 ? SegmentTopology::kDisk
                                                         : SegmentTopology::kSphere;
  }
}

/// Turns a loop so that it begins at the corner with the smallest angle; without corners at the vertex with the
/// smallest angle.
/// \return whether it has corners
bool Segmenter::turn_to_first_corner(BoneIndex bone, NodeIndex node, std::vector<int>& ring) const {
  const auto is_corner = [&](int h) { return seam_degree_[mesh_.origins[h]] != 2; };
  const bool has_corners = std::any_of(ring.begin(), ring.end(), is_corner);
  const auto key = [&](int h) { return std::pair(has_corners && !is_corner(h), turn(bone, node, mesh_.origins[h])); };
  std::rotate(ring.begin(), std::min_element(ring.begin(), ring.end(), [&](int g, int h) { return key(g) < key(h); }),
              ring.end());
  return has_corners;
}

/// The arc of some half-edges of a loop, from corner to corner. The first of its bones adds it.
void Segmenter::add_arc(BoneIndex bone, BoneEnd end, bool has_corners, std::span<const int> half_edges) {
  const NodeIndex node = end_node(skeleton_, bone, end);
  const BoneIndex other = side(mesh_.opposites[half_edges[0]]).bone.bone;
  for (const int h : half_edges)
    if (const BoneIndex changed = side(mesh_.opposites[h]).bone.bone; changed != other)
      throw TopologyError(fmt::format("bone \"{}\": its neighbour at node \"{}\" changes from \"{}\" to \"{}\" at {} "
                                      "without a corner; move the node",
                                      bone_name(bone), node_name(node), bone_name(other), bone_name(changed),
                                      text_of(skeleton_, position(mesh_.origins[h]))),
                          bone, node);
  if (bone > other) return;
  Arc arc;
  arc.node = node;
  arc.bones = {bone, other};
  arc.is_closed = !has_corners;
  for (const int h : half_edges) arc.vertices.push_back(mesh_.origins[h]);
  if (has_corners) arc.vertices.push_back(mesh_.target(half_edges.back()));
  if (end == BoneEnd::kTail)
    std::reverse(has_corners ? arc.vertices.begin() : arc.vertices.begin() + 1, arc.vertices.end());
  for (const int h : half_edges) arc_of_[h] = arc_of_[mesh_.opposites[h]] = static_cast<int>(result_.arcs.size());
  result_.arcs.push_back(std::move(arc));
}

void Segmenter::build_arcs() {
  arc_of_.assign(mesh_.origins.size(), -1);
  for (BoneIndex bone = 0; bone < static_cast<int>(loops_.size()); ++bone)
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) {
      auto& loops = loops_[bone][static_cast<int>(end)];
      if (loops.empty()) continue;
      std::vector<int>& ring = loops[0].half_edges;
      const bool has_corners = turn_to_first_corner(bone, end_node(skeleton_, bone, end), ring);
      for (std::size_t begin = 0, stop = 0; begin < ring.size(); begin = stop) {
        stop = begin + 1;
        while (stop < ring.size() && (!has_corners || seam_degree_[mesh_.origins[ring[stop]]] == 2)) ++stop;
        add_arc(bone, end, has_corners, std::span(ring).subspan(begin, stop - begin));
      }
    }
}

/// Numbers the segment's vertices in the order in which its triangles meet them.
void Segmenter::add_triangles(const std::vector<int>& triangles, Segment& segment) {
  segment.source_vertices.reserve(triangles.size() / 2 + 64);
  segment.mesh.triangles.reserve(triangles.size());
  for (const int t : triangles) {
    Triangle triangle;
    for (int c = 0; c < 3; ++c) {
      const int v = mesh_.origins[3 * t + c];
      if (local_[v] < 0) {
        local_[v] = static_cast<int>(segment.source_vertices.size());
        segment.source_vertices.push_back(v);
      }
      triangle[c] = local_[v];
    }
    segment.mesh.triangles.push_back(triangle);
  }
  segment.mesh.positions.reserve(segment.source_vertices.size());
  for (const int v : segment.source_vertices) segment.mesh.positions.push_back(position(v));
}

void Segmenter::add_boundary(BoneEnd end, Segment& segment) const {
  const auto& loops = loops_[segment.bone][static_cast<int>(end)];
  if (loops.empty()) return;
  BoundaryLoop& loop = segment.loops[static_cast<int>(end)];
  for (const int h : loops[0].half_edges) {
    loop.vertices.push_back(local_[mesh_.origins[h]]);
    const ArcIndex arc = arc_of_[h];
    if (loop.arcs.empty() || loop.arcs.back().arc != arc) loop.arcs.push_back({arc, false});
  }
  // Half-edges run with growing v at a head, against it at a tail; arcs with growing v of their first bone.
  if (end == BoneEnd::kTail) {
    std::reverse(loop.vertices.begin() + 1, loop.vertices.end());
    std::reverse(loop.arcs.begin(), loop.arcs.end());
  }
  for (ArcUse& use : loop.arcs) {
    const Arc& arc = result_.arcs[use.arc];
    if (arc.bones[0] == segment.bone) continue;
    const BoneEnd first_end =
        end_node(skeleton_, arc.bones[0], BoneEnd::kHead) == arc.node ? BoneEnd::kHead : BoneEnd::kTail;
    // The half-edges of the two sides run against each other, and once more where the ends differ.
    use.is_reversed = first_end == end;
  }
  // A closed arc begins where its first bone has its smallest angle.
  const Arc& only = result_.arcs[loop.arcs[0].arc];
  if (loop.arcs.size() == 1 && only.is_closed)
    std::rotate(loop.vertices.begin(), std::find(loop.vertices.begin(), loop.vertices.end(), local_[only.vertices[0]]),
                loop.vertices.end());
}

void Segmenter::check_topology(const Segment& segment) const {
  const int vertices = static_cast<int>(segment.source_vertices.size()),
            faces = static_cast<int>(segment.mesh.triangles.size()),
            boundary = static_cast<int>(segment.loops[0].vertices.size() + segment.loops[1].vertices.size());
  const int euler = vertices - (3 * faces + boundary) / 2 + faces;
  const int wanted = segment.topology == SegmentTopology::kAnnulus ? 0
                     : segment.topology == SegmentTopology::kDisk  ? 1
                                                                   : 2;
  if (euler == wanted) return;
  const Vec3 centre = 0.5 * (end_position(skeleton_, segment.bone, BoneEnd::kHead) +
                             end_position(skeleton_, segment.bone, BoneEnd::kTail));
  throw TopologyError(fmt::format("bone \"{}\" around {}: its surface is no {} but has {} handle{} (Euler number {} "
                                  "instead of {}); lay a ring of bones through every handle of the body",
                                  bone_name(segment.bone), text_of(skeleton_, centre), to_string(segment.topology),
                                  (wanted - euler) / 2, wanted - euler == 2 ? "" : "s", euler, wanted),
                      segment.bone, -1);
}

void Segmenter::build_segments() {
  const int triangle_count = mesh_.triangle_count();
  result_.cut_mesh.positions = mesh_.positions;
  result_.cut_mesh.triangles.resize(triangle_count);
  for (int t = 0; t < triangle_count; ++t)
    result_.cut_mesh.triangles[t] = {mesh_.origins[3 * t], mesh_.origins[3 * t + 1], mesh_.origins[3 * t + 2]};

  std::vector<std::vector<int>> triangles(result_.segments.size());
  for (std::size_t b = 0; b < triangles.size(); ++b) triangles[b].reserve(triangle_counts_[b]);
  for (int t = 0; t < triangle_count; ++t) triangles[result_.triangle_bones[t]].push_back(t);

  local_.assign(mesh_.positions.size(), -1);
  for (Segment& segment : result_.segments) {
    add_triangles(triangles[segment.bone], segment);
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) add_boundary(end, segment);
    check_topology(segment);
    for (const int v : segment.source_vertices) local_[v] = -1;
  }
}

}  // namespace

Segmentation segment_mesh(ClContext& context, CutMesh mesh, const Skeleton& skeleton) {
  if (skeleton.bones.empty()) throw InputError("the skeleton has no bones; give it at least one");
  if (mesh.origins.empty()) throw InputError("the mesh has no triangles");
  for (std::size_t v = 0; v < mesh.positions.size(); ++v)
    if (!std::isfinite(mesh.positions[v].squaredNorm()))
      throw InputError(fmt::format("vertex {} of the mesh has no finite position; remove it", v));
  return Segmenter(context, std::move(mesh), skeleton).run();
}

}  // namespace skeletex
