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
#include "output_names.h"
#include "progress_bar.h"
#include "skeletex/analysis/deformation.h"
#include "skeletex/convert/resample/resample.h"
#include "skeletex/edit/polish.h"
#include "skeletex/io/image_file.h"
#include "skeletex/io/mesh_file.h"
#include "skeletex/io/model_file.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/layers/layer_values.h"
#include "skeletex/reconstruct/layers/turn_normals.h"
#include "skeletex/reconstruct/pose/pose_mesh.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/reconstruct/texture/bake_texture.h"
#include "skeletex/reconstruct/thin_triangles.h"

namespace skeletex::cli {
namespace {

struct Arguments {
  std::string model, output, pose, device, json, texture, deform = "smooth";
  int size = 0, level = 0;
  std::optional<double> time, constant_offset;  ///< the offset in diagonals
  std::vector<std::string> bones;
  bool is_distance_dropped = false, has_no_report = false, is_polished = false, has_all_texels = false;
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

/// The model as it is reconstructed.
struct Source {
  ClContext& context;
  ProgressBar& bar;
  const PreparedModel prepared;
  double read_ms = 0, device_ms = 0, resample_ms = 0, reconstruct_ms = 0, reduce_ms = 0;
  TriangleMesh bind = {};                   ///< in the user's units
  std::optional<ReducedMesh> reduced = {};  ///< of it, without thin triangles
};

/// The surface in its pose, or at a constant distance from the bones.
TriangleMesh surface_of(const Source& source, const std::optional<Skeleton>& posed, const Arguments& arguments) {
  const SkeletexModel& model = source.prepared.model;
  const DistanceRule rule = arguments.is_distance_dropped ? DistanceRule::kFromFoot : DistanceRule::kFromBone;
  if (arguments.constant_offset)
    return constant_offset_mesh(source.context, source.prepared, posed ? *posed : model.skeleton,
                                bones_by_name(model.skeleton, arguments.bones),
                                *arguments.constant_offset * model.diagonal, rule);
  if (posed) return reconstruct_mesh(source.context, source.prepared, *posed, {deformation_of(arguments.deform), rule});
  return source.bind;
}

/// The path of a picture as a mesh file names it: from its own folder, where that is possible.
std::filesystem::path relative_to(const std::string& picture, const std::string& mesh) {
  const std::filesystem::path path = std::filesystem::absolute(picture).lexically_normal(),
                              folder = std::filesystem::absolute(mesh).lexically_normal().parent_path();
  const std::filesystem::path relative = path.lexically_relative(folder);
  return relative.empty() ? path : relative;
}

/// Writes the model's colours as a picture, and adds it and its coordinates in place of the vertex colours.
void add_texture(const Source& source, const Arguments& arguments, const std::string& output,
                 MeshAttributes& attributes) {
  const PreparedModel& prepared = source.prepared;
  BakedTexture baked = bake_texture(prepared.model, prepared, reconstruct_bind_mesh(source.context, prepared).mesh);
  attributes.colours = {};
  attributes.texture_coordinates = std::move(baked.coordinates);
  attributes.materials.emplace_back().image_file = relative_to(arguments.texture, output);
  write_image(arguments.texture, baked.image);
  attributes.materials[0].image = std::move(baked.image);  // a glTF file holds it as well
}

void check_arguments(const Arguments& arguments) {
  if (arguments.constant_offset && !arguments.texture.empty())
    throw CLI::ValidationError("--texture", "--constant-offset writes no surface that has colours");
  if (!arguments.texture.empty() && has_ending(arguments.output, ".stl"))
    throw CLI::ValidationError(
        "--texture", "\"" + arguments.output + "\" must end in .obj, .ply or .glb, which take texture coordinates");
  if (arguments.constant_offset && arguments.is_polished)
    throw CLI::ValidationError("--polish", "--constant-offset writes no surface that could be polished");
  if (!arguments.constant_offset) check_distance_option(arguments.is_distance_dropped, arguments.deform);
}

std::string text_of(const PolishReport& report, double diagonal) {
  return fmt::format("polish: {} new folds became {}, {} vertices moved by up to {:.2g} diagonals\n",
                     report.folds_before, report.folds_after, report.moved_vertices, report.farthest / diagonal);
}

Json json_of(const PolishReport& report, double diagonal) {
  return {{"new_folds_before", report.folds_before},
          {"new_folds", report.folds_after},
          {"rounds", report.rounds},
          {"moved_vertices", report.moved_vertices},
          {"farthest", report.farthest / diagonal}};
}

/// A surface, the same one in the bind pose, and what is written beside it.
struct Surface {
  TriangleMesh mesh, bind;
  MeshAttributes attributes;
};

/// Leaves out the vertices that the mesh does without.
void reduce(const ReducedMesh& reduced, Surface& surface) {
  for (TriangleMesh* const mesh : {&surface.mesh, &surface.bind})
    *mesh = {values_of(reduced, mesh->positions), reduced.triangles};
  const auto keep = [&](auto& values) {
    if (!values.empty()) values = values_of(reduced, values);
  };
  keep(surface.attributes.normals.values);
  keep(surface.attributes.colours.values);
  for (VertexNumbers& numbers : surface.attributes.numbers) keep(numbers.values);
}

/// Writes the surface in one pose, or in none.
/// \param posed  the skeleton
/// \param text   what is printed is added to it
/// \return for the JSON
Json write_surface(const Source& source, const Arguments& arguments, const std::optional<Skeleton>& posed,
                   const std::string& output, std::string& text) {
  const SkeletexModel& model = source.prepared.model;
  Stopwatch watch;
  Surface surface{surface_of(source, posed, arguments), source.bind, {}};
  if (!arguments.constant_offset) surface.attributes = vertex_attributes(source.prepared);
  if (source.reduced) reduce(*source.reduced, surface);
  std::optional<PolishReport> polish_report;
  if (arguments.is_polished) {
    source.bar.show("polishing", 0.5);
    polish_report = polish_pose(surface.bind, surface.mesh.positions);
  }
  std::vector<Vec3>& normals = surface.attributes.normals.values;
  if (posed && !normals.empty()) normals = turn_normals(surface.bind, normals, surface.mesh.positions);
  if (!arguments.texture.empty()) add_texture(source, arguments, output, surface.attributes);
  const double reconstruct_ms = source.reconstruct_ms + watch.lap_ms();
  std::optional<PoseReport> pose_report;
  if (posed && !arguments.constant_offset && !arguments.has_no_report) {
    source.bar.show("measuring the pose", 0.6);
    pose_report = report_pose(surface.bind, surface.mesh);
  }
  source.bar.show("writing", 0.8);
  watch.lap_ms();
  write_mesh(output, surface.mesh, surface.attributes);
  const double write_ms = watch.lap_ms();
  text += fmt::format(
      "{} vertices, {} triangles from {} x {} texels, on {}\n"
      "read {:.0f} ms, device {:.0f} ms, resample {:.0f} ms, reconstruct {:.0f} ms, reduce {:.0f} ms, "
      "write {:.0f} ms\n{}{}{}\n",
      surface.mesh.positions.size(), surface.mesh.triangles.size(), model.texture.width, model.texture.height,
      source.context.device().name, source.read_ms, source.device_ms, source.resample_ms, reconstruct_ms,
      source.reduce_ms, write_ms, polish_report ? text_of(*polish_report, model.diagonal) : "",
      pose_report ? pose_report->text : "", output);
  Json json{{"vertices", surface.mesh.positions.size()},
            {"triangles", surface.mesh.triangles.size()},
            {"size", {model.texture.width, model.texture.height}},
            {"times_ms",
             {{"read", source.read_ms},
              {"device", source.device_ms},
              {"resample", source.resample_ms},
              {"reconstruct", reconstruct_ms},
              {"reduce", source.reduce_ms},
              {"write", write_ms}}}};
  if (pose_report) json["pose"] = pose_report->json;
  if (polish_report) json["polish"] = json_of(*polish_report, model.diagonal);
  return json;
}

/// Reconstructs the mesh in its bind pose, and what is left of it without thin triangles.
void add_bind_mesh(const Arguments& arguments, Source& source) {
  if (arguments.constant_offset) return;
  source.bar.show("reconstructing", 0.3);
  Stopwatch watch;
  source.bind = reconstruct_bind_mesh(source.context, source.prepared).mesh;
  source.reconstruct_ms = watch.lap_ms();
  if (!arguments.has_all_texels && arguments.texture.empty()) source.reduced = without_thin_triangles(source.bind);
  source.reduce_ms = watch.lap_ms();
  source.bind = in_user_units(std::move(source.bind), source.prepared.model.skeleton.frame);
}

void run(const Arguments& arguments, const CLI::App& command) {
  check_arguments(arguments);
  const std::vector<PoseOutput> outputs = pose_outputs(command, arguments.pose, arguments.output);
  Stopwatch total, watch;
  SkeletexModel model = read_model(arguments.model, arguments.level);
  std::vector<std::optional<Skeleton>> posed;
  for (const PoseOutput& one : outputs) posed.push_back(posed_skeleton(model.skeleton, one.pose, arguments.time));
  const double read_ms = watch.lap_ms();
  ClContext context(arguments.device);
  const double device_ms = watch.lap_ms();
  std::optional<ProgressBar> bar(std::in_place, context);
  if (arguments.size > 0 && arguments.size != std::max(model.texture.width, model.texture.height)) {
    bar->show("resampling", 0.1);
    model = resample_model(context, model, arguments.size);
  }
  const double resample_ms = watch.lap_ms();
  Source source{context, *bar, PreparedModel(model), read_ms, device_ms, resample_ms};
  add_bind_mesh(arguments, source);
  std::string text;
  Json all = Json::array();
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    Json json = write_surface(source, arguments, posed[i], outputs[i].output, text);
    if (is_pattern(arguments.pose)) json["output"] = outputs[i].output;
    json["times_ms"]["total"] = total.lap_ms();
    json["device"] = context.device().name;
    json["kernels"] = profile_json(context);
    context.reset_profile();
    all.push_back(std::move(json));
  }
  bar.reset();
  print(arguments.json, text);
  write_json(arguments.json, is_pattern(arguments.pose) ? all : all[0]);
}

}  // namespace

void add_reconstruct_command(CLI::App& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command =
      *program.add_subcommand("reconstruct", "Turn a model back into a closed mesh, at any resolution and in any pose");
  declare_input(command, command.add_option("MODEL", arguments->model, "model: .skx.exr or .skx"))->required();
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
  CLI::Option* pose = add_pose_option(command, arguments->pose);
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
  command.add_flag("--all-texels", arguments->has_all_texels,
                   "keep thin triangles: a vertex for every texel, by rows and columns (always so with --texture and "
                   "--constant-offset)");
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
      "  skeletex reconstruct bear.skx.exr -o meshes/{name}.ply --pose 'poses/*.json'\n"
      "  skeletex reconstruct bear.skx.exr -o tubes.ply --pose wave.json --constant-offset 0.05\n"
      "The mesh is closed, oriented, 2-manifold and of the input's genus at every size and in every pose. Coordinates "
      "are in the input mesh's units.");
  command.callback([arguments, &command] { run(*arguments, command); });
}

}  // namespace skeletex::cli
