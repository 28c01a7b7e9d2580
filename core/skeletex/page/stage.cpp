// SPDX-License-Identifier: MIT
#include "skeletex/page/stage.h"

#include <algorithm>
#include <cmath>

#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kColumnStep = 1.0 / 4096;
constexpr double kSeamColumnStep = 1.0 / 64;  // texels; the checker and the pointer alone read these columns
constexpr double kTurnStep = 1.0 / (1 << 19);
constexpr double kSlopeStep = 1e-5;
constexpr double kStep = 2e-6;  // diagonals

/// The triangles between seams and the rows beside them, end by end.
struct Strips {
  Json starts = Json::array();       ///< per end, of the first triangle: vertex of the seam and column of the row
  std::vector<unsigned char> steps;  ///< one bit per triangle: it has an edge of the seam, not one of the row
  std::size_t step_count = 0;
  std::vector<float> columns;  ///< per vertex of a seam, in texels from the one before; the first of a ring from 0

  void add_step(bool is_along_seam) {
    if (step_count % 8 == 0) steps.push_back(0);
    steps.back() |= static_cast<unsigned char>(static_cast<unsigned>(is_along_seam) << step_count % 8);
    ++step_count;
  }
};

/// Adds the strip at an end of a patch. Each triangle shares an edge with the one before, so that one bit says whether
/// its third corner is the next vertex of the seam or of the row.
void append_strip(const PreparedModel& prepared, std::span<const Vec3> positions, BoneIndex bone, BoneEnd end,
                  Strips& strips) {
  const Lattice& lattice = prepared.lattice;
  const int width = prepared.model.patches[bone].rectangle.width;
  const EndSeam seam = end_seam(prepared.model, prepared.separation, lattice, positions, bone, end);
  if (seam.ring.vertices.empty()) {
    strips.starts.push_back({0, 0});
    return;
  }
  std::vector<Triangle> triangles;
  append_end_triangles(prepared.model, lattice, positions, seam, bone, end, triangles);
  const int at_seam = end == BoneEnd::kHead ? 0 : 2;  // the corner of the first triangle that lies on the seam
  const auto start = std::find(seam.ring.vertices.begin(), seam.ring.vertices.end(), triangles[0][at_seam]);
  strips.starts.push_back({start - seam.ring.vertices.begin(),
                           (triangles[0][2 - at_seam] - end_row(prepared.model, lattice, bone, end).front()) % width});
  for (const Triangle& triangle : triangles)
    strips.add_step(std::ranges::count_if(triangle, [&](int v) { return v >= lattice.inner_count; }) == 2);
  double before = 0;
  for (const double turn : seam.turns) {
    const double column = kSeamColumnStep * std::round(turn * width / kSeamColumnStep);
    strips.columns.push_back(static_cast<float>(column - before));
    before = column;
  }
}

Strips strips_of(const PreparedModel& prepared, std::span<const Vec3> positions) {
  Strips strips;
  for (BoneIndex bone = 0; bone < static_cast<int>(prepared.model.patches.size()); ++bone)
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) append_strip(prepared, positions, bone, end, strips);
  return strips;
}

/// One bit per quad: it takes the second diagonal. Quads are the lattice's, patch by patch, row by row.
std::vector<unsigned char> second_diagonals(const PreparedModel& prepared, std::span<const Triangle> triangles) {
  std::vector<unsigned char> bits((prepared.lattice.quad_count + 7) / 8, 0);
  std::size_t quad = 0;
  for (const Patch& patch : prepared.model.patches) {
    const int width = patch.rectangle.width;
    for (int i = 0; i < width * (patch.rectangle.height - 3); ++i, ++quad) {
      const Triangle& triangle = triangles[2 * quad];
      if (triangle[2] == triangle[0] + width) bits[quad / 8] |= static_cast<unsigned char>(1U << quad % 8);
    }
  }
  return bits;
}

Json network_of(const SkeletexModel& model) {
  Json network{{"arcs", Json::array()}, {"corners", Json::array()}, {"ends", Json::array()}};
  for (const SeamArc& arc : model.arcs)
    network["arcs"].push_back(
        {{"node", arc.node}, {"bone", arc.bones[0]}, {"samples", arc.samples.size()}, {"corners", arc.corners}});
  for (const SeamCorner& corner : model.corners)
    network["corners"].push_back({{"node", corner.node}, {"bone", corner.bones[0]}});
  for (const std::array<PatchEnd, 2>& ends : model.ends) {
    Json bone = Json::array();
    for (const PatchEnd& end : ends) {
      Json arcs = Json::array();
      for (const ArcUse& use : end.arcs) arcs.push_back({use.arc, use.is_reversed});
      bone.push_back(arcs);
    }
    network["ends"].push_back(bone);
  }
  return network;
}

/// Of every sample, arc by arc, then of every corner.
struct Samples {
  std::vector<float> turns, distances;
};

Samples samples_of(const SkeletexModel& model) {
  Samples samples;
  const auto add = [&](const SeamSample& sample) {
    samples.turns.push_back(static_cast<float>(sample.turn));
    samples.distances.push_back(static_cast<float>(sample.distance));
  };
  for (const SeamArc& arc : model.arcs) std::for_each(arc.samples.begin(), arc.samples.end(), add);
  for (const SeamCorner& corner : model.corners) add(corner.sample);
  return samples;
}

}  // namespace

bool has_same_seams(const SkeletexModel& a, const SkeletexModel& b) {
  const auto same_arcs = [](const SeamArc& p, const SeamArc& q) {
    return p.node == q.node && p.bones == q.bones && p.corners == q.corners && p.samples.size() == q.samples.size();
  };
  const auto same_corners = [](const SeamCorner& p, const SeamCorner& q) {
    return p.node == q.node && p.bones == q.bones;
  };
  return std::ranges::equal(a.arcs, b.arcs, same_arcs) && std::ranges::equal(a.corners, b.corners, same_corners);
}

Json add_stage(ClContext& context, PageArrays& arrays, std::span<const PageKey> keys, bool is_decoded) {
  const PreparedModel prepared(keys.front().model);
  const TriangleMesh mesh = reconstruct_bind_mesh(context, prepared).mesh;  // in the model's frame
  const Strips strips = strips_of(prepared, mesh.positions);
  Json stage = network_of(prepared.model);
  stage["starts"] = strips.starts;
  stage["strips"] = arrays.add(strips.steps);
  std::vector<int> none;
  stage["columns"] = add_steps(arrays, strips.columns, kSeamColumnStep, none);
  if (is_decoded) return stage;
  stage["diagonals"] = arrays.add(second_diagonals(prepared, mesh.triangles));
  stage["keys"] = Json::array();
  std::vector<int> turns, distances;  // of the key before
  for (const PageKey& key : keys) {
    const Samples samples = samples_of(key.model);
    stage["keys"].push_back(
        {{"t", key.t},
         {"turns", add_steps(arrays, samples.turns, kTurnStep, turns)},
         {"distances", add_steps(arrays, samples.distances, kStep * key.model.diagonal, distances)}});
  }
  return stage;
}

Json add_blend(PageArrays& arrays, const Morph& morph, std::span<const PageKey> keys) {
  const BlendTables& first = keys.front().tables;
  const std::size_t bones = first.sources.size() / first.source_count;
  Json sources = Json::array();
  for (std::size_t i = 0; i < first.sources.size(); ++i) {
    const bool is_second = i >= bones;
    const BoneIndex bone = static_cast<int>(i % bones);
    const Rectangle& rectangle =
        morph.models()[is_second ? 1 : 0].patches[morph.correspondence(0, is_second ? 1 : 0).bones[bone]].rectangle;
    sources.push_back({rectangle.x, rectangle.y, rectangle.width, rectangle.height, first.sources[i].sign});
  }
  std::vector<int> none;
  Json blend{
      {"sources", sources}, {"slopes", add_steps(arrays, first.slopes, kSlopeStep, none)}, {"keys", Json::array()}};
  std::vector<int> columns_before, moves_before;
  for (const PageKey& key : keys) {
    std::vector<float> columns, moves;
    for (const BlendColumn& column : key.tables.columns) columns.insert(columns.end(), {column.head, column.tail});
    for (const auto& end : key.moves.planes)
      for (const std::vector<float>& plane : end) moves.insert(moves.end(), plane.begin(), plane.end());
    blend["keys"].push_back({{"t", key.t},
                             {"columns", add_steps(arrays, columns, kColumnStep, columns_before)},
                             {"moves", add_steps(arrays, moves, kStep * key.model.diagonal, moves_before)}});
  }
  return blend;
}

}  // namespace skeletex
