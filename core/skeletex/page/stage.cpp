// SPDX-License-Identifier: MIT
#include "skeletex/page/stage.h"

#include <algorithm>
#include <unordered_map>

#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kColumnStep = 1.0 / 4096;
constexpr double kTurnStep = 1.0 / (1 << 19);
constexpr double kSlopeStep = 1e-5;
constexpr double kStep = 2e-6;  // diagonals

/// The vertices around the patches' ends as the page has them, and the triangles there.
struct EndCopies {
  std::vector<int> sources;    ///< vertices of the lattice behind the inner ones, from 0 on
  std::vector<int> counts;     ///< per end
  std::vector<float> columns;  ///< in texels, not wrapped
  std::vector<Triangle> triangles;
};

void append_pole_copies(const Lattice& lattice, int pole, int width, EndCopies& copies) {
  copies.counts.push_back(width);
  for (int column = 0; column < width; ++column) {
    copies.sources.push_back(pole - lattice.inner_count);
    copies.columns.push_back(static_cast<float>(column) + 0.5f);
  }
}

void append_seam_copies(const Lattice& lattice, const EndSeam& seam, int width, EndCopies& copies) {
  copies.counts.push_back(static_cast<int>(seam.ring.vertices.size()));
  for (std::size_t i = 0; i < seam.ring.vertices.size(); ++i) {
    copies.sources.push_back(seam.ring.vertices[i] - lattice.inner_count);
    copies.columns.push_back(static_cast<float>(seam.turns[i] * width));
  }
}

void append_end(const PreparedModel& prepared, std::span<const Vec3> positions, int bone, BoneEnd end,
                EndCopies& copies) {
  const Lattice& lattice = prepared.lattice;
  const int width = prepared.model.patches[bone].rectangle.width, pole = lattice.poles[bone][static_cast<int>(end)];
  const int first = lattice.inner_count + static_cast<int>(copies.sources.size());
  const EndSeam seam = end_seam(prepared.model, prepared.separation, lattice, positions, bone, end);
  std::vector<Triangle> triangles;
  append_end_triangles(prepared.model, lattice, positions, seam, bone, end, triangles);
  std::unordered_map<int, int> copy_of;  // of a seam's vertices
  if (pole >= 0) {
    append_pole_copies(lattice, pole, width, copies);
  } else {
    append_seam_copies(lattice, seam, width, copies);
    for (std::size_t i = 0; i < seam.ring.vertices.size(); ++i)
      copy_of[seam.ring.vertices[i]] = first + static_cast<int>(i);
  }
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    Triangle& triangle = triangles[t];
    const auto inner =
        std::find_if(triangle.begin(), triangle.end(), [&](int vertex) { return vertex < lattice.inner_count; });
    std::rotate(triangle.begin(), inner + 1, triangle.end());
    for (int& vertex : triangle)
      if (vertex >= lattice.inner_count) vertex = pole >= 0 ? first + static_cast<int>(t) : copy_of.at(vertex);
    copies.triangles.push_back(triangle);
  }
}

EndCopies end_copies(const PreparedModel& prepared, std::span<const Vec3> positions) {
  EndCopies copies;
  for (int bone = 0; bone < static_cast<int>(prepared.model.patches.size()); ++bone)
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) append_end(prepared, positions, bone, end, copies);
  return copies;
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

/// Differences between corners of triangles that follow each other: small numbers, which compress.
std::vector<int> differences_of(const std::vector<Triangle>& triangles) {
  std::vector<int> differences;
  Triangle before{0, 0, 0};
  for (const Triangle& triangle : triangles) {
    for (int i = 0; i < 3; ++i) differences.push_back(triangle[i] - before[i]);
    before = triangle;
  }
  return differences;
}

Json network_of(const SkeletexModel& model) {
  Json network{{"arcs", Json::array()}, {"corners", Json::array()}};
  for (const SeamArc& arc : model.arcs)
    network["arcs"].push_back(
        {{"node", arc.node}, {"bone", arc.bones[0]}, {"samples", arc.samples.size()}, {"corners", arc.corners}});
  for (const SeamCorner& corner : model.corners)
    network["corners"].push_back({{"node", corner.node}, {"bone", corner.bones[0]}});
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

Json add_stage(ClContext& context, PageArrays& arrays, std::span<const PageKey> keys) {
  const PreparedModel prepared(keys.front().model);
  const TriangleMesh mesh = reconstruct_bind_mesh(context, prepared).mesh;  // in the model's frame
  const EndCopies copies = end_copies(prepared, mesh.positions);
  Json stage = network_of(prepared.model);
  stage["copies"] = copies.counts;
  stage["sources"] = arrays.add(copies.sources);
  std::vector<int> none;
  stage["columns"] = add_steps(arrays, copies.columns, kColumnStep, none);
  stage["triangles"] = arrays.add(differences_of(copies.triangles));
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
    const int bone = static_cast<int>(i % bones);
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
