// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <memory>
#include <numbers>

#include "bone_pairs.h"
#include "command.h"
#include "skeletex/edit/morph.h"
#include "skeletex/io/model_file.h"
#include "skeletex/io/pose_file.h"
#include "skeletex/reconstruct/pose_mesh.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "table.h"

namespace skeletex::cli {
namespace {

struct Arguments {
  std::vector<std::string> models;
  std::string pose, device, json;
  int size = 0, repeats = 15;
};

double wall_ms(const std::function<void()>& work) {
  const auto begin = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
}

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

/// Device and wall time of one frame, and of a copy that moves the same bytes, alternating.
struct Stage {
  std::string name;
  std::vector<double> device_ms, wall_ms, copy_ms;
};

Stage measure(ClContext& context, const std::string& name, std::size_t floats_moved, int repeats, const std::function<void()>& frame) {
  // A copy reads and writes: half as many floats make the same traffic.
  const std::size_t size = (floats_moved + 1) / 2;
  const auto from = context.allocate<float>(size), to = context.allocate<float>(size);
  Stage stage{name, {}, {}, {}};
  constexpr int kWarmUps = 2;
  for (int i = 0; i < kWarmUps + repeats; ++i) {
    ::cl::Event event;
    context.queue().enqueueCopyBuffer(from.memory, to.memory, 0, 0, size * sizeof(float), nullptr, &event);
    event.wait();
    context.reset_profile();
    const double wall = wall_ms([&] {
      frame();
      context.finish();
    });
    if (i < kWarmUps) continue;
    double device = 0;
    for (const ClProfileEntry& entry : context.profile()) device += entry.milliseconds;
    stage.device_ms.push_back(device);
    stage.wall_ms.push_back(wall);
    stage.copy_ms.push_back(1e-6 * static_cast<double>(event.getProfilingInfo<CL_PROFILING_COMMAND_END>() - event.getProfilingInfo<CL_PROFILING_COMMAND_START>()));
  }
  return stage;
}

/// Where no pose is given: the skeleton bent by 40 degrees over its longest axis.
Pose bent(const Skeleton& skeleton) {
  TriangleMesh nodes;
  for (const auto& node : skeleton.nodes) nodes.positions.push_back(node.position);
  const BoundingBox box = bounding_box(nodes);
  const Vec3 extent = box.upper - box.lower;
  int axis = 0;
  extent.maxCoeff(&axis);
  Vec3 about = Vec3::Zero();
  about[(axis + 1) % 3] = 1;
  Pose pose;
  for (const Vec3& p : nodes.positions) {
    const double angle = extent[axis] > 0 ? std::numbers::pi / 4.5 * (p[axis] - box.lower[axis]) / extent[axis] : 0;
    pose.nodes.push_back(box.lower + Eigen::AngleAxisd(angle, about) * (p - box.lower));
  }
  return pose;
}

void run(const Arguments& arguments) {
  if (arguments.models.size() > 2) throw CLI::ValidationError("one model, or two that correspond");
  check_json_target(arguments.json);
  ClContext context(arguments.device);
  std::vector<SkeletexModel> models;
  for (const std::string& path : arguments.models) {
    SkeletexModel model = read_model(path);
    models.push_back(arguments.size > 0 ? resample_model(context, model, arguments.size) : std::move(model));
  }
  const SkeletexModel& model = models.front();
  const Walls walls(model.skeleton);
  const auto upload = [&context](const SkeletexModel& m) {
    return upload_lattice(context, frame_tables(m.skeleton, Walls(m.skeleton), m.patches, m.origin), m.patches, m.texture, RowChoice::kInner);
  };
  const DeviceLattice lattice = upload(model);
  DevicePlanes points = allocate_planes(context, lattice.vertex_count);
  constexpr std::size_t kPlanes = 3;

  std::vector<Stage> stages;
  stages.push_back(measure(context, "reconstruct", 2 * kPlanes * lattice.vertex_count, arguments.repeats, [&] { displace(context, lattice, points); }));

  const Pose pose = arguments.pose.empty() ? bent(model.skeleton) : pose_at(model.skeleton, read_animation(arguments.pose, model.skeleton), 0);
  stages.push_back(measure(context, "pose", 2 * kPlanes * lattice.vertex_count, arguments.repeats, [&] {
    const Skeleton posed = apply_pose(model.skeleton, pose);
    displace_posed(context, lattice, upload_pose(context, model, PosedWalls(model, posed), RowChoice::kInner, DistanceRule::kFromBone), points);
  }));

  if (models.size() == 2) {
    const Correspondence bones = correspond(arguments.models[0], models[0].skeleton, arguments.models[1], models[1].skeleton, {});
    MorphOptions options;
    options.layout = 0;
    const Morph morph(context, models, std::vector{bones}, options);
    double t = 0;
    stages.push_back(measure(context, "morph", 3 * kPlanes * lattice.vertex_count, arguments.repeats, [&] {
      t = std::fmod(t + 0.37, 1.0);
      DeviceLattice live;
      const SkeletexModel between = morph.queue(std::vector{1 - t, t}, live.texels);
      live.texture_width = between.texture.width;
      live.vertex_count = lattice.vertex_count;
      live.tables = upload_tables(context, frame_tables(between.skeleton, Walls(between.skeleton), between.patches, between.origin));
      live.rows = context.upload(lattice_rows(between.patches, RowChoice::kInner));
      displace(context, live, points);
    }));
  }

  Table table({"stage", "frames/s", "wall ms", "device ms", "min", "max", "copy ms", "ratio"});
  Json json = Json::array();
  for (const Stage& stage : stages) {
    const double ms = median(stage.device_ms), wall = median(stage.wall_ms), copy = median(stage.copy_ms);
    const auto [least, most] = std::minmax_element(stage.device_ms.begin(), stage.device_ms.end());
    table.add({stage.name, fmt::format("{:.1f}", 1000 / wall), fmt::format("{:.2f}", wall), fmt::format("{:.2f}", ms), fmt::format("{:.2f}", *least), fmt::format("{:.2f}", *most),
               fmt::format("{:.2f}", copy), fmt::format("{:.2f}", ms / copy)});
    json.push_back({{"stage", stage.name}, {"model", arguments.models[0]}, {"size", model.texture.width}, {"ms", ms}, {"reference", "device copy of the same bytes"},
                    {"reference_ms", copy}, {"ratio", ms / copy}, {"wall_ms", wall}, {"frames_per_second", 1000 / wall}, {"device", context.device().name}});
  }
  print(arguments.json, table.text() + fmt::format("{} x {} texels, medians of {}; on {}\n", model.texture.width, model.texture.height, arguments.repeats, context.device().name));
  write_json(arguments.json, json);
  context.save_programs();
}

}  // namespace

void add_bench_command(CLI::App& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand("bench", "Time frames of a model: reconstruction, a pose, a morph");
  command.add_option("MODEL", arguments->models, "model (.skx.exr), and for the morph another one whose skeleton corresponds")->required();
  command.add_option("--size", arguments->size, "texels along the longer side (default: the model's)")->check(CLI::Range(4, 16384).description(""))->type_name("N");
  command.add_option("--pose", arguments->pose, "pose: .json (default: the skeleton bent by 40 degrees)")->type_name("FILE");
  command.add_option("--repeats", arguments->repeats, "frames that are timed, after two that are not (default: 15)")
      ->check(CLI::Range(1, 10000).description(""))
      ->type_name("N");
  add_device_option(command, arguments->device);
  add_json_option(command, arguments->json);
  command.footer(
      "Example:\n"
      "  skeletex bench bear.skx.exr bear_bis.skx.exr --size 2048\n"
      "A frame ends with all vertices of the lattice on the device. Wall time has the host's part (walls and tables of the pose), device time the\n"
      "kernels alone; the copy moves as many bytes as they must: texels in, points out.");
  command.callback([arguments] { run(*arguments); });
}

}  // namespace skeletex::cli
