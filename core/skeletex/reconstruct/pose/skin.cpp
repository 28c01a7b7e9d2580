// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/pose/skin.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "reconstruct_structs.h"
#include "skeletex/geometry/parallel.h"
#include "skeletex/reconstruct/lattice.h"
#include "skeletex/reconstruct/pose/weight_walk.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/skeleton/separation_planes.h"

namespace skeletex {
namespace {

constexpr std::size_t kBlocksAtOnce = 4096;

/// Appends the bones of a block that move any of its vertices, and their weights.
/// \param weights  per slot SKIN_BLOCK values, those behind the block's vertices not set
void append_block(SkinBlock& block, std::span<const int> bones, const float* weights, Skin& skin) {
  block.first_bone = static_cast<int>(skin.block_bones.size());
  block.first_weight = static_cast<int>(skin.weights.size());
  for (std::size_t k = 0; k < bones.size(); ++k) {
    const float* const own = weights + k * SKIN_BLOCK;
    if (std::all_of(own, own + block.vertex_count, [](float weight) { return weight == 0; })) continue;
    skin.block_bones.push_back(bones[k]);
    skin.weights.insert(skin.weights.end(), own, own + block.vertex_count);
    skin.weights.resize(skin.weights.size() + SKIN_BLOCK - block.vertex_count, 0.f);
  }
  block.bone_count = static_cast<int>(skin.block_bones.size()) - block.first_bone;
}

void weigh_inner_vertices(ClContext& context, const WeightWalks& walks, const DevicePlanes& points, Skin& skin) {
  const auto blocks = context.upload(skin.blocks);
  const auto steps = context.upload(walks.steps);
  const auto first_steps = context.upload(walks.first_steps);
  const std::size_t slots = walks.longest + 1;
  auto device_weights = context.allocate<float>(std::min(kBlocksAtOnce, skin.blocks.size()) * slots * SKIN_BLOCK);
  for (std::size_t begin = 0; begin < skin.blocks.size(); begin += kBlocksAtOnce) {
    const std::size_t count = std::min(kBlocksAtOnce, skin.blocks.size() - begin);
    context.launch({"skin.cl", "bone_weights"}, block_range(context, count),
                   BlockParameters{static_cast<int>(count), static_cast<int>(begin), static_cast<int>(slots),
                                   static_cast<int>(points.count), 0, 0},
                   blocks, first_steps, steps, points.values, device_weights);
    const ClMapping<float> weights = context.map(device_weights);
    for (std::size_t b = 0; b < count; ++b) {
      SkinBlock& block = skin.blocks[begin + b];
      std::vector<int> bones{block.bone};
      for (int k = walks.first_steps[block.bone]; k < walks.first_steps[block.bone + 1]; ++k)
        bones.push_back(walks.steps[k].bone);
      append_block(block, bones, weights.data() + b * slots * SKIN_BLOCK, skin);
    }
  }
}

/// The weights of a place in a patch that a model's own weights say; the patch's own bone where all of them are 0.
/// \param row  0 to height - 1
/// \param turn  v; between columns weights are linear
std::vector<BoneWeight> weights_at(const SkeletexModel& model, BoneIndex bone, int row, double turn) {
  const Rectangle& r = model.patches[bone].rectangle;
  const double x = (turn - std::floor(turn)) * r.width;
  const int column = static_cast<int>(x) % r.width;
  const double share = x - std::floor(x);
  const std::size_t line = static_cast<std::size_t>(r.y + row) * model.texture.width + r.x;
  std::vector<BoneWeight> weights;
  double sum = 0;
  for (int b = 0; b < static_cast<int>(model.bone_weights.size()); ++b) {
    const std::vector<float>& plane = model.bone_weights[b];
    const double weight = (1 - share) * plane[line + column] + share * plane[line + (column + 1) % r.width];
    if (!(weight > 0)) continue;
    weights.push_back({b, weight});
    sum += weight;
  }
  if (weights.empty()) return {{bone, 1}};
  for (BoneWeight& weight : weights) weight.weight /= sum;
  return weights;
}

void take_inner_weights(const SkeletexModel& model, Skin& skin) {
  const std::size_t bones = model.bone_weights.size();
  std::vector<int> all(bones);
  std::iota(all.begin(), all.end(), 0);
  std::vector<float> weights(bones * SKIN_BLOCK);
  BoneIndex bone;
  VertexIndex first_vertex = 0;  // of the patch
  for (SkinBlock& block : skin.blocks) {
    if (block.bone != bone) bone = block.bone, first_vertex = block.first_vertex;
    std::fill(weights.begin(), weights.end(), 0.f);
    const int width = model.patches[bone].rectangle.width;
    for (int i = 0; i < block.vertex_count; ++i) {
      const int inner = block.first_vertex - first_vertex + i;
      for (const auto& [moving, weight] :
           weights_at(model, bone, 1 + inner / width, static_cast<double>(inner % width) / width))
        weights[moving * SKIN_BLOCK + i] = static_cast<float>(weight);
    }
    append_block(block, all, weights.data(), skin);
  }
}

/// Poles, seam samples and corners as the rows at the ends of their patches have it.
std::vector<std::vector<BoneWeight>> shared_weights_of(const SkeletexModel& model, const Lattice& lattice) {
  std::vector<std::vector<BoneWeight>> weights;
  const auto at = [&](BoneIndex bone, BoneEnd end, double turn) {
    weights.push_back(
        weights_at(model, bone, end == BoneEnd::kHead ? 0 : model.patches[bone].rectangle.height - 1, turn));
  };
  for (BoneIndex bone = 0; bone < static_cast<int>(lattice.poles.size()); ++bone)
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail})
      if (lattice.poles[bone][static_cast<int>(end)] >= 0) at(bone, end, 0);
  for (const SeamArc& arc : model.arcs)
    for (const SeamSample& sample : arc.samples)
      at(arc.bones[0], end_at(model.skeleton, arc.bones[0], arc.node), sample.turn);
  for (const SeamCorner& corner : model.corners)
    at(corner.bones[0], end_at(model.skeleton, corner.bones[0], corner.node), corner.sample.turn);
  return weights;
}

}  // namespace

std::vector<int> bones_of_shared_vertices(const PreparedModel& prepared) {
  const SkeletexModel& model = prepared.model;
  const Lattice& lattice = prepared.lattice;
  std::vector<int> bones(lattice.vertex_count - lattice.inner_count, -1);
  for (BoneIndex bone = 0; bone < static_cast<int>(lattice.poles.size()); ++bone)
    for (const int pole : lattice.poles[bone])
      if (pole >= 0) bones[pole - lattice.inner_count] = bone;
  for (std::size_t a = 0; a < model.arcs.size(); ++a)
    std::fill_n(bones.begin() + (lattice.first_sample[a] - lattice.inner_count), model.arcs[a].samples.size(),
                model.arcs[a].bones[0]);
  for (std::size_t c = 0; c < model.corners.size(); ++c)
    bones[lattice.first_corner - lattice.inner_count + static_cast<int>(c)] = model.corners[c].bones[0];
  return bones;
}

std::vector<SkinBlock> skin_blocks(const std::vector<Patch>& patches) {
  std::vector<SkinBlock> blocks;
  VertexIndex vertex = 0;
  for (BoneIndex bone = 0; bone < static_cast<int>(patches.size()); ++bone) {
    const int end = vertex + patches[bone].rectangle.width * (patches[bone].rectangle.height - 2);
    for (; vertex < end; vertex = blocks.back().first_vertex + blocks.back().vertex_count)
      blocks.push_back({vertex, std::min(SKIN_BLOCK, end - vertex), bone, 0, 0, 0});
  }
  return blocks;
}

ClRange block_range(const ClContext& context, std::size_t blocks) {
  const std::size_t group = std::min<std::size_t>(context.row_items(), SKIN_BLOCK);
  return {{blocks * group, 1}, {group, 1}};
}

Skin make_skin(ClContext& context, const PreparedModel& prepared, const DevicePlanes& points) {
  const SkeletexModel& model = prepared.model;
  const Lattice& lattice = prepared.lattice;
  Skin skin;
  skin.blocks = skin_blocks(model.patches);
  skin.inner_count = lattice.inner_count;
  skin.origin = model.origin;
  std::vector<Vec3> positions(lattice.vertex_count);
  place_shared_vertices(prepared, positions);
  skin.shared_points.assign(positions.begin() + lattice.inner_count, positions.end());
  if (!model.bone_weights.empty()) {
    take_inner_weights(model, skin);
    skin.shared_weights = shared_weights_of(model, lattice);
    return skin;
  }
  const WeightWalks walks = make_weight_walks(model, prepared.separation);
  weigh_inner_vertices(context, walks, points, skin);
  const std::vector<int> bones = bones_of_shared_vertices(prepared);
  for (std::size_t i = 0; i < bones.size(); ++i)
    skin.shared_weights.push_back(bone_weights(walks, bones[i], skin.shared_points[i] - model.origin));
  return skin;
}

std::vector<float> vertex_weights(const Skin& skin, BoneIndex bone) {
  std::vector<float> weights(skin.inner_count + skin.shared_weights.size(), 0.f);
  for (const SkinBlock& block : skin.blocks)
    for (int k = 0; k < block.bone_count; ++k)
      if (skin.block_bones[block.first_bone + k] == bone)
        std::copy_n(skin.weights.begin() + block.first_weight + k * SKIN_BLOCK, block.vertex_count,
                    weights.begin() + block.first_vertex);
  for (std::size_t i = 0; i < skin.shared_weights.size(); ++i)
    for (const BoneWeight& weight : skin.shared_weights[i])
      if (weight.bone == bone) weights[skin.inner_count + i] = static_cast<float>(weight.weight);
  return weights;
}

std::vector<std::vector<float>> weight_planes(ClContext& context, const PreparedModel& prepared) {
  const SkeletexModel& model = prepared.model;
  const WeightWalks walks = make_weight_walks(model, prepared.separation);
  const DevicePlanes device = row_points(context, prepared, RowChoice::kAll);
  const std::array<std::vector<float>, 3> points = download_planes(context, device);
  const std::size_t texels = static_cast<std::size_t>(model.texture.width) * model.texture.height;
  std::vector<std::vector<float>> planes(model.skeleton.bones.size(), std::vector<float>(texels, 0.f));
  const std::vector<LatticeRow>& rows = prepared.all_rows;
  for_each_index(rows.size(), 8, [&](std::size_t k) {
    const auto [bone, row, vertex, quad] = rows[k];
    const Rectangle& r = model.patches[bone].rectangle;
    for (int j = 0; j < r.width; ++j)
      for (const auto& [moving, weight] :
           bone_weights(walks, bone, Vec3(points[0][vertex + j], points[1][vertex + j], points[2][vertex + j])))
        planes[moving][static_cast<std::size_t>(r.y + row) * model.texture.width + r.x + j] =
            static_cast<float>(weight);
  });
  return planes;
}

DeviceSkin upload_skin(ClContext& context, const Skin& skin, DevicePlanes points) {
  return {context.upload(skin.blocks), context.upload(skin.block_bones), context.upload(skin.weights),
          std::move(points)};
}

std::vector<BoneMotionRecord> motion_records(std::span<const BoneMotion> motions, const Vec3& bind_origin,
                                             const Vec3& posed_origin) {
  std::vector<BoneMotionRecord> records;
  for (const BoneMotion& motion : motions) {
    BoneMotionRecord record{};
    const Eigen::Vector4d real(motion.rotation.w(), motion.rotation.x(), motion.rotation.y(), motion.rotation.z());
    const Eigen::Vector4d dual = dual_part(motion, bind_origin, posed_origin);
    const Vec3 head = motion.bind_head - bind_origin;
    for (int i = 0; i < 4; ++i)
      record.real[i] = static_cast<float>(real[i]), record.dual[i] = static_cast<float>(dual[i]);
    for (int i = 0; i < 3; ++i) {
      record.head[i] = static_cast<float>(head[i]);
      record.stretch[i] = static_cast<float>(motion.stretch[i]);
      record.axis[i] = static_cast<float>(motion.bind_axis[i]);
    }
    records.push_back(record);
  }
  return records;
}

bool is_stretched(std::span<const BoneMotion> motions) {
  return std::any_of(motions.begin(), motions.end(),
                     [](const BoneMotion& motion) { return !motion.stretch.isZero(0); });
}

void pose_skin(ClContext& context, const Skin& skin, const DeviceSkin& device, std::span<const BoneMotion> motions,
               const Vec3& posed_origin, DevicePlanes& points) {
  if (skin.blocks.empty()) return;
  const auto records = context.upload(motion_records(motions, skin.origin, posed_origin));
  context.launch({"skin.cl", "skin"}, block_range(context, skin.blocks.size()),
                 BlockParameters{static_cast<int>(skin.blocks.size()), 0, 0, static_cast<int>(points.count),
                                 static_cast<int>(is_stretched(motions)), 0},
                 device.blocks, device.block_bones, device.weights, records, device.points.values, points.values);
}

void pose_shared_vertices(const Skin& skin, std::span<const BoneMotion> motions, std::vector<Vec3>& positions) {
  for (std::size_t i = 0; i < skin.shared_points.size(); ++i)
    positions[skin.inner_count + i] = blend_motions(motions, skin.shared_weights[i], skin.shared_points[i]);
}

}  // namespace skeletex
