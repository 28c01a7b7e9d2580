// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "command.h"
#include "deform_option.h"
#include "files.h"
#include "progress_bar.h"
#include "skeletex/analysis/deformation.h"
#include "skeletex/io/image_file.h"
#include "skeletex/io/mesh_file.h"
#include "skeletex/io/model_file.h"
#include "skeletex/io/pose_file.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/layers/layer_values.h"
#include "skeletex/reconstruct/layers/turn_normals.h"
#include "skeletex/reconstruct/polish.h"
#include "skeletex/reconstruct/pose_mesh.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/reconstruct/texture/bake_texture.h"

namespace skeletex::cli {
namespace {

struct Arguments {
  std::string model, output, pose, device, json, texture, deform = "smooth";
  int size = 0, level = 0;
  std::optional<double> time, constant_offset;  ///< the offset in diagonals
  std::vector<std::string> bones;
  bool is_distance_dropped = false, has_no_report = false, is_polished = false;
};

/// What a pose does to the surface, in words and for the JSON.
struct PoseReport {
  std::string text;
  Json json;
};

PoseReport report_pose(const TriangleMesh& bind, const TriangleMesh& posed) {
  const DeformationReport report = measure_deformation(make_bind_surface(bind), posed.positions);
  return {fmt::format("pose: {} new folds, {} new intersections, volume {:+.1f} %, symmetric Dirichlet energy {:.2f} "
                      "(99 % of the area lies below)\n",
                      report.new_folds, report.new_intersections, 100 * (report.volume_ratio - 1), report.energy_99),
          {{"new_folds", report.new_folds},
           {"new_intersections", report.new_intersections},
           {"volume_ratio", report.volume_ratio},
           {"energy_mean", report.energy_mean},
           {"energy_99", report.energy_99}}};
}

std::vector<int> bones_by_name(const Skeleton& skeleton, const std::vector<std::string>& names) {
  std::vector<int> bones;
  for (const std::string& name : names) bones.push_back(bone_by_name(skeleton, name));
  return bones;
}

/// The surface in its pose, or at a constant distance from the bones.
TriangleMesh surface_of(ClContext& context, const PreparedModel& prepared, const std::optional<Skeleton>& posed,
                        const Arguments& arguments) {
  const SkeletexModel& model = prepared.model;
  const DistanceRule rule = arguments.is_distance_dropped ? DistanceRule::kFromFoot : DistanceRule::kFromBone;
  if (arguments.constant_offset)
    return constant_offset_mesh(context, prepared, posed ? *posed : model.skeleton,
                                bones_by_name(model.skeleton, arguments.bones),
                                *arguments.constant_offset * model.diagonal, rule);
  if (posed) return reconstruct_mesh(context, prepared, *posed, {deformation_of(arguments.deform), rule});
  return reconstruct_mesh(context, prepared);
}

/// The path of a picture as a mesh file names it: from its own folder, where that is possible.
std::filesystem::path relative_to(const std::string& picture, const std::string& mesh) {
  const std::filesystem::path path = std::filesystem::absolute(picture).lexically_normal(),
                              folder = std::filesystem::absolute(mesh).lexically_normal().parent_path();
  const std::filesystem::path relative = path.lexically_relative(folder);
  return relative.empty() ? path : relative;
}

/// What is written beside the surface; writes the picture, where one is asked for.
MeshAttributes attributes_of(ClContext& context, const PreparedModel& prepared, bool is_posed, const TriangleMesh& mesh,
                             const Arguments& arguments) {
  MeshAttributes attributes = vertex_attributes(prepared);
  const bool has_texture = !arguments.texture.empty();
  if (!is_posed && !has_texture) return attributes;
  const TriangleMesh bind = reconstruct_bind_mesh(context, prepared).mesh;
  if (is_posed && !attributes.normals.empty())
    attributes.normals.values = turn_normals(bind, attributes.normals.values, mesh.positions);
  if (!has_texture) return attributes;
  BakedTexture baked = bake_texture(prepared, bind);
  attributes.colours = {};
  attributes.texture_coordinates = std::move(baked.coordinates);
  attributes.materials.emplace_back().image_file = relative_to(arguments.texture, arguments.output);
  write_image(arguments.texture, baked.image);
  return attributes;
}

void check_arguments(const Arguments& arguments) {
  if (arguments.constant_offset && !arguments.texture.empty())
    throw CLI::ValidationError("--texture", "--constant-offset writes no surface that has colours");
  if (!arguments.texture.empty() && !has_ending(arguments.output, ".obj") && !has_ending(arguments.output, ".ply"))
    throw CLI::ValidationError("--texture",
                               "\"" + arguments.output + "\" must end in .obj or .ply, which take texture coordinates");
  if (arguments.constant_offset && arguments.is_polished)
    throw CLI::ValidationError("--polish", "--constant-offset writes no surface that could be polished");
  if (!arguments.constant_offset) check_distance_option(arguments.is_distance_dropped, arguments.deform);
}

void run(const Arguments& arguments) {
  check_arguments(arguments);
  Stopwatch total, watch;
  SkeletexModel model = read_model(arguments.model, arguments.level);
  std::optional<Skeleton> posed;
  if (!arguments.pose.empty()) {
    const PoseAnimation animation = read_animation(arguments.pose, model.skeleton);
    posed = apply_pose(model.skeleton,
                       pose_at(model.skeleton, animation, arguments.time.value_or(animation.frames.front().time)));
  }
  const double read_ms = watch.lap_ms();
  ClContext context(arguments.device);
  const double start_ms = watch.lap_ms();
  double resample_ms = 0, reconstruct_ms = 0, write_ms = 0;
  TriangleMesh mesh;
  std::optional<PoseReport> pose_report;
  std::optional<PolishReport> polish_report;
  {
    ProgressBar bar(context);
    if (arguments.size > 0 && arguments.size != std::max(model.texture.width, model.texture.height)) {
      bar.show("resampling", 0.1);
      model = resample_model(context, model, arguments.size);
    }
    resample_ms = watch.lap_ms();
    bar.show("reconstructing", 0.3);
    const PreparedModel prepared(model);
    mesh = surface_of(context, prepared, posed, arguments);
    if (arguments.is_polished) {
      bar.show("polishing", 0.5);
      polish_report = polish_pose(reconstruct_mesh(context, prepared), mesh.positions);
    }
    const MeshAttributes attributes = arguments.constant_offset
                                          ? MeshAttributes()
                                          : attributes_of(context, prepared, posed.has_value(), mesh, arguments);
    reconstruct_ms = watch.lap_ms();
    bar.show("writing", 0.7);
    write_mesh(arguments.output, mesh, attributes);
    write_ms = watch.lap_ms();
    if (posed && !arguments.constant_offset && !arguments.has_no_report) {
      bar.show("measuring the pose", 0.8);
      pose_report = report_pose(reconstruct_mesh(context, prepared), mesh);
    }
  }
  const double total_ms = total.lap_ms();
  std::string pose_text;
  if (polish_report)
    pose_text = fmt::format("polish: {} new folds became {}, {} vertices moved by up to {:.2g} diagonals\n",
                            polish_report->folds_before, polish_report->folds_after, polish_report->moved_vertices,
                            polish_report->farthest / model.diagonal);
  if (pose_report) pose_text += pose_report->text;
  print(arguments.json,
        fmt::format(
            "{} vertices, {} triangles from {} x {} texels, on {}\n"
            "read {:.0f} ms, device {:.0f} ms, resample {:.0f} ms, reconstruct {:.0f} ms, write {:.0f} ms\n{}{}\n",
            mesh.positions.size(), mesh.triangles.size(), model.texture.width, model.texture.height,
            context.device().name, read_ms, start_ms, resample_ms, reconstruct_ms, write_ms, pose_text,
            arguments.output));
  Json json{{"vertices", mesh.positions.size()},
            {"triangles", mesh.triangles.size()},
            {"size", {model.texture.width, model.texture.height}},
            {"times_ms",
             {{"read", read_ms},
              {"device", start_ms},
              {"resample", resample_ms},
              {"reconstruct", reconstruct_ms},
              {"write", write_ms},
              {"total", total_ms}}},
            {"device", context.device().name},
            {"kernels", profile_json(context)}};
  if (pose_report) json["pose"] = pose_report->json;
  if (polish_report)
    json["polish"] = {{"new_folds_before", polish_report->folds_before},
                      {"new_folds", polish_report->folds_after},
                      {"rounds", polish_report->rounds},
                      {"moved_vertices", polish_report->moved_vertices},
                      {"farthest", polish_report->farthest / model.diagonal}};
  write_json(arguments.json, json);
}

}  // namespace

void add_reconstruct_command(CLI::App& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command =
      *program.add_subcommand("reconstruct", "Turn a model back into a closed mesh, at any resolution and in any pose");
  declare_input(command, command.add_option("MODEL", arguments->model, "model: .skx.exr"))->required();
  declare_output(command,
                 command.add_option("-o,--output", arguments->output, "mesh: .ply, .stl (binary), .obj or .glb"),
                 {".ply", ".obj", ".stl", ".glb"})
      ->required()
      ->type_name("FILE");
  command
      .add_option("--size", arguments->size, "texels along the longer side, 4 to 16384 (default: the model's own size)")
      ->check(number_in(4, 16384))
      ->type_name("N");
  command
      .add_option("--level", arguments->level,
                  "level of a file that `skeletex lod --levels` has written (default: 0, the finest)")
      ->check(number_from(0))
      ->type_name("K");
  CLI::Option* pose = declare_input(command, command.add_option("--pose", arguments->pose, "pose or animation: .json"))
                          ->type_name("FILE");
  command.add_option("--time", arguments->time, "time in the animation (default: its first frame)")
      ->check(any_number())
      ->type_name("T")
      ->needs(pose);
  add_deform_option(command, arguments->deform)->needs(pose);
  command
      .add_flag("--no-distance", arguments->is_distance_dropped,
                "with --deform paper or coordinates: do not restore the distances to the bones")
      ->needs(pose);
  add_polish_option(command, arguments->is_polished, pose);
  declare_output(command,
                 command.add_option("--texture", arguments->texture,
                                    "write the model's colours as a picture, and texture coordinates instead of vertex "
                                    "colours; an OBJ comes with a material file"),
                 {".png"})
      ->type_name("PNG");
  command.add_flag("--no-report", arguments->has_no_report, "do not measure what the pose does to the surface")
      ->needs(pose);
  CLI::Option* offset =
      command
          .add_option(
              "--constant-offset", arguments->constant_offset,
              "instead of the surface the plane of bone tangent space that lies so far out: a tube around every bone, "
              "in diagonals, above 0 and up to 1")
          ->check(number_in(1e-6, 1.0))
          ->type_name("W");
  command.add_option("--bones", arguments->bones, "the plane around these bones only (names with commas between them)")
      ->delimiter(',')
      ->type_name("NAMES")
      ->needs(offset);
  add_device_option(command, arguments->device);
  add_json_option(command, arguments->json);
  command.footer(
      "Examples:\n"
      "  skeletex reconstruct bear.skx.exr -o bear.ply\n"
      "  skeletex reconstruct bear.skx.exr -o draft.obj --size 64\n"
      "  skeletex reconstruct bear.skx.exr -o waving.ply --pose wave.json --time 0.5\n"
      "  skeletex reconstruct bear.skx.exr -o tubes.ply --pose wave.json --constant-offset 0.05\n"
      "The mesh is closed, oriented, 2-manifold and of the input's genus at every size and in every pose. Coordinates "
      "are in the input mesh's units.");
  command.callback([arguments] { run(*arguments); });
}

}  // namespace skeletex::cli
