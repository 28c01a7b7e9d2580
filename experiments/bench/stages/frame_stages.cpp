// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <numbers>

#include "skeletex/edit/filter/filter.h"
#include "skeletex/edit/live.h"
#include "skeletex/edit/transfer/part.h"
#include "skeletex/edit/transfer/transfer.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/pose/pose_mesh.h"
#include "skeletex/reconstruct/pose/skin.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/skeleton/correspondence.h"
#include "stages.h"

namespace skeletex {
namespace {

constexpr std::size_t kPlanes = 3;
constexpr const char* kCopy = "device copy of the same bytes";

/// A model's inner rows on the device, and room for their points.
struct Frame {
  explicit Frame(ClContext& context, TextureInputPointer from)
      : input(std::move(from)),
        prepared(input->model),
        lattice(upload_lattice(context, prepared, RowChoice::kInner)),
        points(allocate_planes(context, lattice.vertex_count)) {}
  const SkeletexModel& model() const { return input->model; }

  TextureInputPointer input;
  PreparedModel prepared;
  DeviceLattice lattice;
  DevicePlanes points;
};

int longer_side(const SkeletexModel& model) { return std::max(model.texture.width, model.texture.height); }
std::size_t texels_of(const SkeletexModel& model) {
  return static_cast<std::size_t>(model.texture.width) * model.texture.height;
}

Stage stage_of(const char* name, const TextureInput& input) {
  Stage stage;
  stage.name = name;
  stage.model = input.name;
  stage.size = longer_side(input.model);
  stage.reference = kCopy;
  stage.is_device_time = true;
  return stage;
}

Pose bent(const Skeleton& skeleton) {
  std::vector<Vec3> nodes;
  for (const auto& node : skeleton.nodes) nodes.push_back(node.position);
  const BoundingBox box = bounding_box(nodes);
  const Vec3 extent = box.upper - box.lower;
  int axis = 0;
  extent.maxCoeff(&axis);
  Vec3 about = Vec3::Zero();
  about[(axis + 1) % 3] = 1;
  Pose pose;
  for (const Vec3& p : nodes) {
    const double angle = extent[axis] > 0 ? std::numbers::pi / 4.5 * (p[axis] - box.lower[axis]) / extent[axis] : 0;
    pose.nodes.push_back(box.lower + Eigen::AngleAxisd(angle, about) * (p - box.lower));
  }
  return pose;
}

Correspondence correspond(const TextureInput& a, const TextureInput& b) {
  try {
    return find_correspondence(a.model.skeleton, b.model.skeleton);
  } catch (const InputError& error) {
    throw InputError(a.name + " and " + b.name + ": " + error.what());
  }
}

}  // namespace

Stage reconstruct_stage(ClContext& context, TextureInputPointer input) {
  Stage stage = stage_of("reconstruct", *input);
  const auto frame = std::make_shared<Frame>(context, std::move(input));
  stage.run = [&context, frame] { displace(context, frame->lattice, frame->points); };
  stage.run_reference = device_copy(context, 2 * kPlanes * frame->lattice.vertex_count);
  return stage;
}

namespace {

Stage smooth_pose_stage(ClContext& context, TextureInputPointer input, const std::optional<Pose>& given) {
  Stage stage = stage_of("pose", *input);
  const SkeletexModel& model = input->model;
  const Pose pose = given ? *given : bent(model.skeleton);
  const auto frame = std::make_shared<Frame>(context, input);
  std::shared_ptr<const Skin> skin;
  std::shared_ptr<const DeviceSkin> device;
  const double prepare_ms = wall_ms([&] {
    DevicePlanes bind = row_points(context, frame->prepared, RowChoice::kInner);
    skin = std::make_shared<const Skin>(make_skin(context, frame->prepared, bind));
    device = std::make_shared<const DeviceSkin>(upload_skin(context, *skin, std::move(bind)));
    context.finish();
  });
  stage.run = [&context, frame, skin, device, pose] {
    const Skeleton& bind = frame->model().skeleton;
    const Skeleton posed = apply_pose(bind, pose);
    pose_skin(context, *skin, *device, bone_motions(bind, posed), middle_of_nodes(posed), frame->points);
  };
  stage.run_reference = device_copy(context, 2 * kPlanes * frame->lattice.vertex_count);
  const double bones = static_cast<double>(skin->block_bones.size()) /
                       static_cast<double>(std::max<std::size_t>(1, skin->blocks.size()));
  stage.details = [prepare_ms, bones] {
    return std::vector<std::pair<std::string, double>>{{"prepare_ms", prepare_ms}, {"bones_per_block", bones}};
  };
  return stage;
}

Stage paper_pose_stage(ClContext& context, TextureInputPointer input, const std::optional<Pose>& given) {
  Stage stage = stage_of("pose", *input);
  const Pose pose = given ? *given : bent(input->model.skeleton);
  const auto frame = std::make_shared<Frame>(context, std::move(input));
  stage.run = [&context, frame, pose] {
    const SkeletexModel& model = frame->model();
    const Skeleton posed = apply_pose(model.skeleton, pose);
    displace_posed(
        context, frame->lattice,
        upload_pose(context, frame->prepared, PosedPlanes(model, posed), RowChoice::kInner, DistanceRule::kFromBone),
        frame->points);
  };
  stage.run_reference = device_copy(context, 2 * kPlanes * frame->lattice.vertex_count);
  return stage;
}

}  // namespace

Stage pose_stage(ClContext& context, TextureInputPointer input, const std::optional<Pose>& pose,
                 Deformation deformation) {
  switch (deformation) {
    case Deformation::kSmooth: return smooth_pose_stage(context, std::move(input), pose);
    case Deformation::kPaper: return paper_pose_stage(context, std::move(input), pose);
    case Deformation::kCoordinates:
    case Deformation::kLinear: break;
  }
  throw InputError("the pose stage measures --deform smooth and paper");
}

namespace {

/// Reconstruction of a model whose texels come from a live edit.
struct LiveFrame {
  DeviceLattice lattice;
  DevicePlanes points;

  void reconstruct(ClContext& context, const SkeletexModel& model) {
    if (lattice.vertex_count == 0) {
      const std::vector<LatticeRow> rows = lattice_rows(model.patches, RowChoice::kInner);
      for (const LatticeRow& row : rows) lattice.vertex_count += model.patches[row[0]].rectangle.width;
      lattice.texture_width = model.texture.width;
      lattice.rows = context.upload(rows);
      points = allocate_planes(context, lattice.vertex_count);
    }
    lattice.tables = upload_tables(
        context, frame_tables(model.skeleton, SeparationPlanes(model.skeleton), model.patches, model.origin));
    displace(context, lattice, points);
  }
};

/// Frames of a live edit, each at another place of its way, against a copy of two textures in and one lattice of points
/// out.
/// \param queue  (share, texels) -> model
template <class Queue>
void set_live(Stage& stage, ClContext& context, const Queue& queue, std::size_t texels, double prepare_ms) {
  stage.run = [&context, queue, frame = std::make_shared<LiveFrame>(), t = 0.0]() mutable {
    t = std::fmod(t + 0.37, 1.0);
    frame->reconstruct(context, queue(t, frame->lattice.texels));
  };
  stage.run_reference = device_copy(context, 3 * kPlanes * texels);
  stage.details = [prepare_ms] { return std::vector<std::pair<std::string, double>>{{"prepare_ms", prepare_ms}}; };
}

}  // namespace

Stage morph_stage(ClContext& context, TextureInputPointer first, TextureInputPointer second) {
  Stage stage = stage_of("morph", *first);
  stage.model += " to " + second->name;
  MorphOptions options;
  options.layout = 0;
  const auto morph = std::make_shared<const Morph>(context, std::vector{first->model, second->model},
                                                   std::vector{correspond(*first, *second)}, options);
  std::shared_ptr<const LiveMorph> live;
  const double prepare_ms = wall_ms([&] {
    live = std::make_shared<const LiveMorph>(context, *morph, std::vector<std::vector<double>>{{1, 0}, {0, 1}});
    context.finish();
  });
  set_live(
      stage, context, [morph, live](double t, DevicePlanes& texels) { return live->queue(t, texels); },
      texels_of(morph->models()[0]), prepare_ms);
  return stage;
}

Stage transfer_stage(ClContext& context, TextureInputPointer source, TextureInputPointer target) {
  Stage stage = stage_of("transfer", *target);
  stage.model = source->name + " to " + stage.model;
  const Correspondence to_source = correspond(*target, *source);
  int chosen = -1;
  const auto texels = [&](int bone) {
    return target->model.patches[bone].rectangle.width * target->model.patches[bone].rectangle.height;
  };
  for (int bone = 0; bone < static_cast<int>(target->model.patches.size()); ++bone)
    if (is_free_end(target->model, bone, BoneEnd::kHead) != is_free_end(target->model, bone, BoneEnd::kTail) &&
        (chosen < 0 || texels(bone) > texels(chosen)))
      chosen = bone;
  if (chosen < 0) throw InputError(target->name + " has no bone with a free end to transfer");
  const std::vector<std::pair<std::string, std::string>> pairs{
      {source->model.skeleton.bones[to_source.bones[chosen]].name, target->model.skeleton.bones[chosen].name}};
  std::shared_ptr<const LiveBlend> live;
  const double prepare_ms = wall_ms([&] {
    live = std::make_shared<const LiveBlend>(context, target->model,
                                             transfer(context, source->model, target->model, pairs));
    context.finish();
  });
  set_live(
      stage, context, [live](double share, DevicePlanes& planes) { return live->queue(share, planes); },
      texels_of(target->model), prepare_ms);
  return stage;
}

Stage filter_stage(ClContext& context, TextureInputPointer input) {
  Stage stage = stage_of("filter", *input);
  stage.reference = "device copy of the points, once per step of the solver";
  const auto steps = std::make_shared<int>(smooth_model(context, input->model).report.solver.steps);
  const auto copy = device_copy(context, 2 * kPlanes * texels_of(input->model));
  stage.run = [&context, input, steps] { *steps = smooth_model(context, input->model).report.solver.steps; };
  stage.run_reference = [copy, steps] {
    double ms = 0;
    for (int i = 0; i < *steps; ++i) ms += copy();
    return ms;
  };
  stage.details = [steps] { return std::vector<std::pair<std::string, double>>{{"steps", *steps}}; };
  return stage;
}

}  // namespace skeletex
