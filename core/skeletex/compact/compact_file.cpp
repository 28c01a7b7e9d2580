// SPDX-License-Identifier: MIT
#include "skeletex/compact/compact_file.h"

#include <fmt/format.h>

#define XXH_INLINE_ALL
#include <xxhash.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "skeletex/compact/byte_stream.h"
#include "skeletex/compact/layer_planes.h"
#include "skeletex/compact/skeleton_code.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

constexpr std::string_view kMagic = "\x8fSKX";
constexpr std::size_t kHeader = 13;  // magic, version, checksum
/// Limits of what a file may hold: every size is checked against them before memory is taken.
constexpr std::uint64_t kMostListed = 4096, kMostName = 4096, kMostSteps = 28, kMostLayers = 1024,
                        kMostPayload = std::uint64_t{1} << 30;
constexpr std::int64_t kMostPosition = std::int64_t{1} << 40, kMostInteger = 1 << 24;
constexpr double kMostPoints = 16384.0 * 16384.0;

void write_skeleton(ByteWriter& out, const Skeleton& skeleton) {
  const FrameCode frame = frame_code(skeleton.frame);
  out.number(frame.exponent);
  for (int k = 0; k < 3; ++k) out.byte(static_cast<int>(frame.mantissa >> (8 * k) & 255));
  for (const std::int64_t offset : frame.offset) out.number(offset);
  out.count(skeleton.nodes.size());
  for (const Node& node : skeleton.nodes) out.text(node.name);
  for (const Node& node : skeleton.nodes)
    for (int k = 0; k < 3; ++k) out.number(std::llround(node.position[k] / kNodeStep));
  out.count(skeleton.bones.size());
  for (const Bone& bone : skeleton.bones) out.text(bone.name);
  for (std::size_t i = 0; i < skeleton.bones.size(); ++i) {
    const Bone& bone = skeleton.bones[i];
    out.count(bone.head);
    out.count(bone.tail);
    const int angle = angle_code(direction_from(skeleton, {static_cast<int>(i), BoneEnd::kHead}), *bone.s);
    out.byte(angle & 255);
    out.byte(angle >> 8);
  }
}

Skeleton read_skeleton(ByteReader& in) {
  Skeleton skeleton;
  FrameCode frame;
  frame.exponent = static_cast<int>(in.number(1000));
  for (int k = 0; k < 3; ++k) frame.mantissa |= static_cast<std::uint32_t>(in.byte()) << (8 * k);
  for (std::int64_t& offset : frame.offset) offset = in.number(kMostPosition);
  skeleton.frame = frame_of_code(frame);
  skeleton.nodes.resize(in.count(kMostListed + 1));
  for (Node& node : skeleton.nodes) node.name = in.text(kMostName);
  for (Node& node : skeleton.nodes)
    for (int k = 0; k < 3; ++k) node.position[k] = static_cast<double>(in.number(kMostPosition)) * kNodeStep;
  skeleton.bones.resize(in.count(kMostListed));
  if (skeleton.bones.empty()) throw IoError("it has no bone");
  for (Bone& bone : skeleton.bones) bone.name = in.text(kMostName);
  for (std::size_t i = 0; i < skeleton.bones.size(); ++i) {
    Bone& bone = skeleton.bones[i];
    bone.head = static_cast<int>(in.count(kMostListed));
    bone.tail = static_cast<int>(in.count(kMostListed));
    const int low = in.byte(), angle = low + 256 * in.byte();
    const int nodes = static_cast<int>(skeleton.nodes.size());
    if (bone.head >= nodes || bone.tail >= nodes || bone.head == bone.tail)
      throw IoError(fmt::format("bone {} does not join two nodes", i));
    const Vec3 way = skeleton.nodes[bone.tail].position - skeleton.nodes[bone.head].position;
    if (way.norm() < 1e-7) throw IoError(fmt::format("bone {} has no length", i));
    bone.s = direction_of_code(direction_from(skeleton, {static_cast<int>(i), BoneEnd::kHead}), angle);
  }
  check_directions(skeleton);
  return skeleton;
}

/// An axis of the world: 0 to 5 for x, -x, y, -y, z, -z.
Vec3 axis_of(int code) { return (code % 2 == 0 ? 1 : -1) * Vec3::Unit(code / 2); }
constexpr int kNoStance = 0, kAxes = 6, kOtherStance = 255;

void write_stance(ByteWriter& out, const std::optional<Stance>& stance) {
  if (!stance) return out.byte(kNoStance);
  for (int code = 0; code < kAxes * kAxes; ++code)
    if (stance->up == axis_of(code / kAxes) && stance->front == axis_of(code % kAxes)) return out.byte(code + 1);
  out.byte(kOtherStance);
  for (const Vec3* direction : {&stance->up, &stance->front})
    for (int k = 0; k < 3; ++k) out.real((*direction)[k]);
}

std::optional<Stance> read_stance(ByteReader& in) {
  const int code = in.byte();
  if (code == kNoStance) return {};
  Stance stance;
  if (code <= kAxes * kAxes) {
    stance = {axis_of((code - 1) / kAxes), axis_of((code - 1) % kAxes)};
  } else {
    for (Vec3* direction : {&stance.up, &stance.front})
      for (int k = 0; k < 3; ++k) (*direction)[k] = in.real();
  }
  const auto is_unit = [](const Vec3& v) { return std::abs(v.norm() - 1) < 1e-6; };
  if (!(is_unit(stance.up) && is_unit(stance.front) && std::abs(stance.up.dot(stance.front)) < 1e-6))
    throw IoError("its up and front are not orthogonal directions");
  return stance;
}

/// Calls `each` with every end that has a pole.
template <class Model, class Each>
void for_each_pole(Model& model, const Each& each) {
  std::vector<int> bones_at(model.skeleton.nodes.size(), 0);
  for (const Bone& bone : model.skeleton.bones) ++bones_at[bone.head], ++bones_at[bone.tail];
  for (std::size_t bone = 0; bone < model.skeleton.bones.size(); ++bone) {
    if (bones_at[model.skeleton.bones[bone].head] == 1) each(model.patches[bone].poles[0]);
    if (bones_at[model.skeleton.bones[bone].tail] == 1) each(model.patches[bone].poles[1]);
  }
}

void write_sides(ByteWriter& out, const CompactModel& model) {
  out.count(model.corners.size());
  for (const CompactCorner& corner : model.corners) {
    out.count(corner.node);
    out.count(corner.bones.size());
    for (const BoneIndex bone : corner.bones) out.count(bone);
    out.byte(corner.turn & 255);
    out.byte(corner.turn >> 8);
    out.count(corner.distance);
  }
  out.count(model.arcs.size());
  for (const CompactArc& arc : model.arcs) {
    out.count(arc.node);
    for (const BoneIndex bone : arc.bones) out.count(bone);
    for (const int corner : arc.corners) out.count(corner + 1);
    out.byte(arc.step_count);
    out.byte(static_cast<int>(arc.steps.size()));
  }
  for (const CompactPatch& patch : model.patches) {
    out.byte(patch.columns);
    out.byte(patch.intervals);
    out.byte(patch.step_count);
    out.byte(patch.base_exponent);
    out.count(patch.row_steps);
    for (const int knot : patch.row_knots) out.byte(knot);
  }
}

int read_index(ByteReader& in, std::size_t size) {
  const auto index = static_cast<int>(in.count(kMostInteger));
  if (index >= static_cast<int>(size)) throw IoError("an index is too large");
  return index;
}

void check_at(const CompactModel& model, BoneIndex bone, NodeIndex node) {
  const Bone& b = model.skeleton.bones[bone];
  if (b.head != node && b.tail != node) throw IoError(fmt::format("bone {} does not lie at node {}", bone, node));
}

void read_seams(ByteReader& in, CompactModel& model) {
  model.corners.resize(in.count(8 * kMostListed));
  for (CompactCorner& corner : model.corners) {
    corner.node = read_index(in, model.skeleton.nodes.size());
    corner.bones.resize(in.count(kMostListed));
    if (corner.bones.size() < 3) throw IoError("three or more bones meet at a corner");
    for (BoneIndex& bone : corner.bones) {
      bone = read_index(in, model.skeleton.bones.size());
      check_at(model, bone, corner.node);
    }
    const int low = in.byte();
    corner.turn = low + 256 * in.byte();
    corner.distance = static_cast<int>(in.count(kMostInteger));
  }
  model.arcs.resize(in.count(8 * kMostListed));
  for (CompactArc& arc : model.arcs) {
    arc.node = read_index(in, model.skeleton.nodes.size());
    for (BoneIndex& bone : arc.bones) {
      bone = read_index(in, model.skeleton.bones.size());
      check_at(model, bone, arc.node);
    }
    if (arc.bones[0] == arc.bones[1]) throw IoError("an arc lies between two bones");
    for (int& corner : arc.corners) corner = read_index(in, model.corners.size() + 1) - 1;
    if ((arc.corners[0] < 0) != (arc.corners[1] < 0)) throw IoError("an arc has two corners or none");
    arc.step_count = in.byte();
    if (arc.step_count > 16 || (!arc.is_closed() && arc.step_count < 1)) throw IoError("an arc's size is impossible");
    const int coded = in.byte();
    if (coded > arc.step_count) throw IoError("an arc's size is impossible");
    arc.steps.resize(coded);
  }
}

void read_patches(ByteReader& in, CompactModel& model) {
  model.patches.resize(model.skeleton.bones.size());
  double points = 0;
  for (CompactPatch& patch : model.patches) {
    patch.columns = in.byte();
    patch.intervals = in.byte();
    patch.step_count = in.byte();
    patch.base_exponent = in.byte();
    patch.row_steps = static_cast<std::uint32_t>(in.count(0xffffffff));
    for (int& knot : patch.row_knots) knot = in.byte();
    const auto& k = patch.row_knots;
    if (patch.columns < 4 || patch.columns > 64 || patch.intervals < 2 || patch.intervals > 64 ||
        patch.step_count > static_cast<int>(kMostSteps) || patch.base_exponent > 30 ||
        patch.row_steps >> patch.step_count != 0 || k[0] < 1 || k[1] <= k[0] || k[2] <= k[1])
      throw IoError("the size of a patch is impossible");
    points += std::ldexp(patch.columns * (patch.intervals + 1.0), patch.step_count);
    if (points > kMostPoints) throw IoError("it is larger than 16384 x 16384 texels");
  }
}

/// How many points a step adds.
/// \param is_inner  whether those of the ends' rows do not count
std::size_t added_count(const CompactPatch& patch, int step, bool is_inner) {
  std::size_t columns = patch.columns, intervals = patch.intervals;
  for (int i = 0; i < step; ++i) ((patch.row_steps >> i & 1) != 0 ? intervals : columns) *= 2;
  if ((patch.row_steps >> step & 1) != 0) return intervals * columns;
  return (is_inner ? intervals - 1 : intervals + 1) * columns;
}
std::size_t site_count(const CompactPatch& patch, int step) { return added_count(patch, step, true); }
std::size_t value_count(const CompactPatch& patch, int step) { return added_count(patch, step, false); }
std::size_t site_count(const CompactArc& arc, int step) { return (arc.is_closed() ? std::size_t{4} : 1) << step; }

void write_step(ByteWriter& out, const StepResiduals& step) {
  out.byte(step.side.empty() ? 0 : 1);
  for (const std::vector<int>* values : {&step.normal, &step.side, &step.across})
    for (const int value : *values) out.residual(value);
}
/// \param has_across  whether there is a second tangential direction
StepResiduals read_step(ByteReader& in, std::size_t sites, bool has_across) {
  StepResiduals step;
  const int flag = in.byte();
  if (flag > 1) throw IoError("the head of a step is damaged");
  if (sites > in.left()) throw IoError(kEndsTooEarly);
  step.normal.resize(sites);
  if (flag == 1) step.side.resize(sites);
  if (flag == 1 && has_across) step.across.resize(sites);
  for (std::vector<int>* values : {&step.normal, &step.side, &step.across})
    for (int& value : *values) value = in.residual();
  return step;
}

/// Calls `each` with the steps, the coarsest level first, while it returns true: patch, number of the step in it, and
/// whether it is the turn of the points or that of the layers, which come after the points of their level.
template <class Model, class Each>
void for_each_step(Model& model, const Each& each) {
  int most = 0;
  for (const CompactPatch& patch : model.patches) most = std::max(most, patch.step_count);
  for (int level = most - 1; level >= 0; --level)
    for (const bool is_layers : {false, true}) {
      if (is_layers ? model.layers.empty() : level < model.bare_levels) continue;
      for (auto& patch : model.patches)
        if (patch.step_count > level && !each(patch, patch.step_count - 1 - level, is_layers)) return;
    }
}

/// A value of the coarse grid as those before it foretell: the left one, and how the row above goes on from there.
int expected_base(const CompactPatch& patch, std::size_t i) {
  const std::size_t row = 3 * static_cast<std::size_t>(patch.columns);
  const bool has_left = i % row >= 3, has_above = i >= row;
  if (has_left && has_above) return patch.base[i - 3] + patch.base[i - row] - patch.base[i - row - 3];
  return has_left ? patch.base[i - 3] : has_above ? patch.base[i - row] : 0;
}

void write_layers(ByteWriter& out, const CompactModel& model) {
  out.count(model.layers.size());
  for (const CompactLayer& layer : model.layers) {
    out.text(layer.name);
    out.count(layer.planes);
    out.byte(layer.is_bone_weights ? 1 : 0);
    out.real(layer.offset);
    out.real(layer.step);
  }
}

void read_layers(ByteReader& in, CompactModel& model) {
  model.layers.resize(in.count(kMostLayers));
  double planes = 0;
  for (CompactLayer& layer : model.layers) {
    layer.name = in.text(kMostName);
    if (std::count_if(model.layers.begin(), model.layers.end(),
                      [&](const CompactLayer& other) { return other.name == layer.name; }) > 1)
      throw IoError("a layer is named twice");
    layer.planes = static_cast<int>(in.count(kMostListed));
    layer.is_bone_weights = in.byte() != 0;
    layer.offset = in.real();
    layer.step = in.real();
    const bool is_number_or_colour = layer.planes == 1 || layer.planes == 3 || layer.planes == 4;
    if (layer.is_bone_weights ? layer.planes != static_cast<int>(model.skeleton.bones.size()) : !is_number_or_colour)
      throw IoError("a layer has an impossible number of planes");
    if (!(std::abs(layer.offset) < 1e30 && layer.step > 0 && layer.step < 1e30))
      throw IoError("a layer's step is impossible");
    planes += layer.planes;
  }
  double points = 0;
  for (const CompactPatch& patch : model.patches)
    points += std::ldexp(patch.columns * (patch.intervals + 1.0), patch.step_count);
  if (planes * points > kMostPoints) throw IoError("its layers are larger than 16384 x 16384 texels");
}

/// A plane's value in the coarse grid as those before it foretell.
int expected_value(const CompactPatch& patch, const std::vector<int>& base, std::size_t i) {
  if (i % patch.columns > 0) return base[i - 1];
  return i > 0 ? base[i - patch.columns] : 0;
}

void write_base_planes(ByteWriter& out, const CompactModel& model) {
  for (const CompactPatch& patch : model.patches)
    for (const CompactPlane& plane : patch.planes) {
      out.byte(plane.base.empty() ? 0 : 1);
      for (std::size_t i = 0; i < plane.base.size(); ++i)
        out.residual(plane.base[i] - expected_value(patch, plane.base, i));
    }
}

void read_base_planes(ByteReader& in, CompactModel& model) {
  for (CompactPatch& patch : model.patches) {
    patch.planes.resize(plane_count(model));
    for (CompactPlane& plane : patch.planes) {
      if (in.byte() == 0) continue;
      plane.base.resize(static_cast<std::size_t>(patch.intervals + 1) * patch.columns);
      for (std::size_t i = 0; i < plane.base.size(); ++i)
        plane.base[i] = std::clamp(in.residual() + expected_value(patch, plane.base, i),
                                   -static_cast<int>(kMostInteger), static_cast<int>(kMostInteger));
    }
  }
}

/// A step of all planes that are not empty: whether it has residuals, and those.
void write_plane_steps(ByteWriter& out, const CompactPatch& patch, int step) {
  for (const CompactPlane& plane : patch.planes) {
    if (plane.base.empty()) continue;
    const bool has_residuals = step < static_cast<int>(plane.steps.size()) && !plane.steps[step].empty();
    out.byte(has_residuals ? 1 : 0);
    if (!has_residuals) continue;
    for (const int residual : plane.steps[step]) out.residual(residual);
  }
}
void read_plane_steps(ByteReader& in, CompactPatch& patch, int step) {
  for (CompactPlane& plane : patch.planes) {
    if (plane.base.empty()) continue;
    std::vector<int>& residuals = plane.steps.emplace_back();
    if (in.byte() == 0) continue;
    const std::size_t count = value_count(patch, step);
    if (count > in.left()) throw IoError(kEndsTooEarly);
    residuals.resize(count);
    for (int& residual : residuals) residual = in.residual();
  }
}

/// The seams and the coarse grids.
void read_coarse(ByteReader& in, CompactModel& model) {
  for (CompactArc& arc : model.arcs) {
    if (arc.is_closed()) arc.base.resize(8);
    for (int& value : arc.base) value = static_cast<int>(in.number(kMostInteger));
    for (std::size_t step = 0; step < arc.steps.size(); ++step)
      arc.steps[step] = read_step(in, site_count(arc, static_cast<int>(step)), false);
  }
  for (CompactPatch& patch : model.patches) {
    patch.base.resize(3 * static_cast<std::size_t>(patch.intervals - 1) * patch.columns);
    for (std::size_t k = 0; k < 3; ++k)
      for (std::size_t i = k; i < patch.base.size(); i += 3)
        patch.base[i] = std::clamp(in.residual() + expected_base(patch, i), -static_cast<int>(kMostInteger),
                                   static_cast<int>(kMostInteger));
  }
}

void read_steps(ByteReader& in, CompactModel& model, PrefixRule rule) {
  const auto read = [](ByteReader& from, CompactPatch& patch, int step, bool is_layers) {
    if (is_layers)
      read_plane_steps(from, patch, step);
    else
      patch.steps.push_back(read_step(from, site_count(patch, step), true));
  };
  for_each_step(model, [&](CompactPatch& patch, int step, bool is_layers) {
    if (rule == PrefixRule::kWhole) {
      read(in, patch, step, is_layers);
      return true;
    }
    // A step of which a part is missing is left out: its points are where they are predicted.
    try {
      ByteReader ahead = in;
      CompactPatch read_patch = patch;
      read(ahead, read_patch, step, is_layers);
      patch = std::move(read_patch);
      in = ahead;
    } catch (const IoError&) {
      return false;
    }
    return true;
  });
}

CompactModel model_of(std::string_view payload, PrefixRule rule) {
  ByteReader in(payload);
  CompactModel model;
  model.skeleton = read_skeleton(in);
  model.stance = read_stance(in);
  model.step = in.real();
  if (!(model.step > 1e-9 && model.step < 1)) throw IoError("its step is no length");
  model.bare_levels = in.byte();
  for (OffsetWeights& weights : model.weights)
    for (int& weight : weights) weight = in.byte() - 128;
  read_seams(in, model);
  read_patches(in, model);
  read_layers(in, model);
  for_each_pole(model, [&](std::array<int, 3>& pole) {
    for (int& value : pole) value = static_cast<int>(in.number(kMostInteger));
  });
  read_coarse(in, model);
  read_base_planes(in, model);
  read_steps(in, model, rule);
  if (rule == PrefixRule::kWhole && !in.is_at_end()) throw IoError("there is more in it than a model");
  return model;
}

}  // namespace

bool is_compact(std::string_view first_bytes) { return first_bytes.substr(0, kMagic.size()) == kMagic; }

std::string compact_payload(const CompactModel& model) {
  ByteWriter out;
  write_skeleton(out, model.skeleton);
  write_stance(out, model.stance);
  out.real(model.step);
  out.byte(model.bare_levels);
  for (const OffsetWeights& weights : model.weights)
    for (const int weight : weights) out.byte(weight + 128);
  write_sides(out, model);
  write_layers(out, model);
  for_each_pole(model, [&](const std::array<int, 3>& pole) {
    for (const int value : pole) out.number(value);
  });
  for (const CompactArc& arc : model.arcs) {
    for (const int value : arc.base) out.number(value);
    for (const StepResiduals& step : arc.steps) write_step(out, step);
  }
  for (const CompactPatch& patch : model.patches)
    for (std::size_t k = 0; k < 3; ++k)
      for (std::size_t i = k; i < patch.base.size(); i += 3) out.residual(patch.base[i] - expected_base(patch, i));
  write_base_planes(out, model);
  for_each_step(model, [&](const CompactPatch& patch, int step, bool is_layers) {
    if (is_layers)
      write_plane_steps(out, patch, step);
    else
      write_step(out, patch.steps[step]);
    return true;
  });
  return out.bytes();
}

std::string compact_bytes(const CompactModel& model) {
  const std::string payload = compact_payload(model);
  ByteWriter body;
  body.count(payload.size());
  const std::string rest = body.bytes() + compress(payload);
  std::string file(kMagic);
  file += static_cast<char>(kCompactVersion);
  const std::uint64_t checksum = XXH64(rest.data(), rest.size(), 0);
  for (int i = 0; i < 8; ++i) file += static_cast<char>(checksum >> (8 * i) & 255);
  return file + rest;
}

CompactModel read_compact(std::string_view bytes, const std::string& where, PrefixRule rule) {
  try {
    if (!is_compact(bytes)) throw IoError("it is no compact model (.skx)");
    if (bytes.size() <= kHeader) throw IoError(kEndsTooEarly);
    const int version = static_cast<unsigned char>(bytes[kMagic.size()]);
    if (version != kCompactVersion)
      throw IoError(fmt::format("it is written in version {} of the format, this program reads version {}; {}", version,
                                kCompactVersion,
                                version > kCompactVersion ? "use a newer skeletex" : "pack the model again"));
    std::uint64_t written = 0;
    for (std::size_t i = 0; i < 8; ++i)
      written |= static_cast<std::uint64_t>(static_cast<unsigned char>(bytes[kMagic.size() + 1 + i])) << (8 * i);
    const std::string_view rest = bytes.substr(kHeader);
    if (rule == PrefixRule::kWhole && XXH64(rest.data(), rest.size(), 0) != written)
      throw IoError(
          "it is damaged or truncated: the checksum is another one. Copy it again; `skeletex unpack --bytes` reads the "
          "first part of a file");
    ByteReader head(rest);
    const std::size_t size = head.count(kMostPayload);
    return model_of(decompress(rest.substr(rest.size() - head.left()), size, rule == PrefixRule::kPrefix), rule);
  } catch (const Error& error) {
    const bool is_short = rule == PrefixRule::kPrefix && std::string_view(error.what()) == kEndsTooEarly;
    throw IoError(fmt::format("{}: {}{}", where, error.what(),
                              is_short ? "; the skeleton and the coarsest level come first: take more bytes" : ""));
  }
}

}  // namespace skeletex
