// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <memory>
#include <optional>

#include "command.h"
#include "deform_option.h"
#include "files.h"
#include "output_names.h"
#include "picture_format.h"
#include "progress_bar.h"
#include "skeletex/analysis/metro.h"
#include "skeletex/convert/resample/resample.h"
#include "skeletex/convert/segment/segment_mesh.h"
#include "skeletex/edit/polish.h"
#include "skeletex/io/json_file.h"
#include "skeletex/io/model_config.h"
#include "skeletex/io/model_file.h"
#include "skeletex/io/read_file.h"
#include "skeletex/io/skeleton_file.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/layers/layer_values.h"
#include "skeletex/reconstruct/layers/turn_normals.h"
#include "skeletex/reconstruct/pose/pose_mesh.h"
#include "skeletex/reconstruct/pose/skin.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/render/colours.h"
#include "skeletex/render/draw.h"
#include "skeletex/render/gpu_model.h"
#include "skeletex/render/scene.h"
#include "skeletex/render/texture_image.h"
#include "view_options.h"

namespace skeletex::cli {
namespace {

constexpr int kCheckerCells = 24;

struct Arguments {
  std::string deform = "smooth", input, output, skeleton, pose, against, device, gl_device, json, bone;
  std::string mode = "shaded", size = "1200x900", background = "white";
  ViewArguments view;
  std::optional<double> time;
  double error_max = 0;
  int lattice = 0, samples = 2;
  bool is_flat = false, has_wires = false, shows_skeleton = false, is_distance_dropped = false, is_polished = false,
       is_smoothed = false, is_plain = false;
};

/// What is drawn, from either kind of input, in the model's frame or the unit frame of the mesh.
struct Subject {
  TriangleMesh mesh;
  UnitFrame frame;
  MeshAttributes attributes;  ///< by vertex
  std::vector<int> bones;     ///< per triangle, where the mode asks for it
  std::optional<SkeletexModel> model;
  std::optional<Skeleton> skeleton;  ///< as posed
  bool is_posed = false;             ///< not in the bind pose
};

Subject load_subject(const Arguments& arguments, ClContext& context) {
  Subject subject;
  if (!arguments.skeleton.empty()) subject.skeleton = read_skeleton(arguments.skeleton);
  if (!is_model_path(arguments.input)) {
    if (arguments.mode != "segments") {
      MeshFile file = load_mesh_file(arguments.input);
      if (file.attributes.normals.empty() || arguments.is_smoothed)
        file.attributes.normals = {vertex_normals(file.mesh), {}};
      SplitMesh split = split_vertices(file.mesh, file.attributes);
      subject.mesh = std::move(split.mesh);
      subject.attributes = std::move(split.attributes);
    } else {
      subject.mesh = load_mesh(arguments.input);
      require_valid(subject.mesh, *subject.skeleton);
    }
    subject.frame = unit_frame(subject.mesh);
    subject.mesh = in_frame(std::move(subject.mesh), subject.frame);
    if (subject.skeleton) subject.skeleton = in_frame(std::move(*subject.skeleton), subject.frame);
    if (arguments.mode == "segments") {
      Segmentation segmentation = segment_mesh(context, subject.mesh, *subject.skeleton);
      subject.mesh = std::move(segmentation.cut_mesh);
      subject.bones = std::move(segmentation.triangle_bones);
    }
    return subject;
  }
  subject.model = read_model(arguments.input);
  if (arguments.lattice > 0 &&
      arguments.lattice != std::max(subject.model->texture.width, subject.model->texture.height))
    subject.model = resample_model(context, *subject.model, arguments.lattice);
  subject.skeleton = subject.model->skeleton;
  subject.is_posed = !arguments.pose.empty();
  subject.frame = subject.skeleton->frame;
  const PreparedModel prepared(*subject.model);
  subject.mesh = reconstruct_bind_mesh(context, prepared).mesh;
  subject.attributes = vertex_attributes(prepared);
  if (arguments.is_smoothed) subject.attributes.normals = {};
  if (arguments.mode == "segments")
    subject.bones = triangle_bones(number_lattice(*subject.model), subject.mesh.triangles);
  return subject;
}

struct ErrorScale {
  std::vector<VertexColour> colours;  ///< of the bar
  double highest = 0;                 ///< of the diagonal
};

Skin skin_of(ClContext& context, const PreparedModel& model) {
  return make_skin(context, model, row_points(context, model, RowChoice::kInner));
}

SurfacePaint paint_of(const Arguments& arguments, const Subject& subject, ClContext& context, ErrorScale& scale) {
  SurfacePaint paint;
  if (arguments.mode == "shaded" && !arguments.is_plain && has_colour(subject.attributes))
    return colour_paint(subject.mesh, subject.attributes);
  if (arguments.mode == "segments") {
    paint.paint = Paint::kFace;
    std::vector<VertexColour> colours;
    for (const int bone : subject.bones) colours.push_back(bone_colour(bone));
    paint.colours = upload_colours(colours);
  } else if (arguments.mode == "normals") {
    paint.paint = Paint::kNormal;
  } else if (arguments.mode == "checker") {
    paint.paint = Paint::kChecker;
    paint.corner_uv = gl_buffer(checker_coordinates(*subject.model, subject.mesh, kCheckerCells));
  } else if (arguments.mode == "weights") {
    const int bone = bone_by_name(subject.model->skeleton, arguments.bone);
    std::vector<VertexColour> colours;
    for (const float weight : vertex_weights(skin_of(context, *subject.model), bone))
      colours.push_back(viridis(weight));
    paint.paint = Paint::kVertex;
    paint.colours = upload_colours(colours);
  } else if (arguments.mode == "error") {
    const TriangleMesh other = in_frame(load_mesh(arguments.against), subject.frame);
    const double diagonal = bounding_box(other).diagonal();
    std::vector<float> distances = closest_distances(context, other, subject.mesh.positions);
    scale.highest = arguments.error_max;
    if (!(scale.highest > 0)) {
      std::vector<float> sorted = distances;
      const auto at = sorted.begin() + static_cast<std::ptrdiff_t>((sorted.size() - 1) * 99 / 100);
      std::nth_element(sorted.begin(), at, sorted.end());
      scale.highest = std::max(*at / diagonal, 1e-12);
    }
    std::vector<VertexColour> colours;
    for (const float distance : distances) colours.push_back(viridis(distance / (scale.highest * diagonal)));
    paint.paint = Paint::kVertex;
    paint.colours = upload_colours(colours);
    for (int i = 0; i < 64; ++i) scale.colours.push_back(viridis((i + 0.5) / 64));
  }
  return paint;
}

void write_picture(const std::string& path, const Image& image) {
  if (has_ending(path, ".exr"))
    write_exr_image(path, image);
  else
    write_png(path, image);
}

void check_arguments(const Arguments& arguments) {
  check_distance_option(arguments.is_distance_dropped, arguments.deform);
  const bool is_texture = arguments.mode == "map" || arguments.mode == "layout";
  if (is_texture && (arguments.view.turntable > 0 || is_pattern(arguments.pose)))
    throw CLI::ValidationError("--mode", arguments.mode + " shows the texture, which no turntable and no pose changes");
  if (!is_model_path(arguments.input)) {
    if (arguments.mode == "weights") throw CLI::ValidationError("--mode", "weights are a model's; a mesh has none");
    if (is_texture || arguments.mode == "checker")
      throw CLI::ValidationError("--mode", arguments.mode + " shows a model's texture; a mesh has none");
    if (!arguments.pose.empty())
      throw CLI::ValidationError("--pose", "only a model can be posed; encode the mesh first");
    if (arguments.lattice > 0) throw CLI::ValidationError("--lattice", "only a model has a lattice");
    if (arguments.mode == "segments" && arguments.skeleton.empty())
      throw CLI::ValidationError("--mode", "segments of a mesh need its --skeleton");
    if (arguments.shows_skeleton && arguments.skeleton.empty())
      throw CLI::ValidationError("--show-skeleton", "a mesh brings no skeleton; give --skeleton");
  } else if (!arguments.skeleton.empty()) {
    throw CLI::ValidationError("--skeleton", "a model brings its own skeleton; --show-skeleton draws it");
  }
  if (arguments.bone.empty() == (arguments.mode == "weights"))
    throw CLI::ValidationError("--mode", "weights and --bone need each other: how much the bone moves the surface");
  if (arguments.mode == "error" && arguments.against.empty())
    throw CLI::ValidationError("--mode", "error needs the mesh to measure --against");
}

/// Moves the surface of a model to its pose on the GL device.
void pose_surface(GlContext& gl, ClContext& context, const Arguments& arguments, const Subject& subject,
                  GpuSurface& surface) {
  const PreparedModel model(*subject.model);
  const Deformation deformation = deformation_of(arguments.deform);
  const DistanceRule distance = arguments.is_distance_dropped ? DistanceRule::kFromFoot : DistanceRule::kFromBone;
  const auto posed_mesh = [&] {
    return in_frame(reconstruct_mesh(context, model, *subject.skeleton, {deformation, distance}), subject.frame);
  };
  if (arguments.is_polished) {
    TriangleMesh posed = posed_mesh();
    polish_pose(subject.mesh, posed.positions);
    surface = upload_surface(gl, posed);
    return;
  }
  if (!subject.is_posed || deformation == Deformation::kPaper) {
    displace(gl, upload_model(model), model, *subject.skeleton, distance, surface);
    return;
  }
  if (deformation != Deformation::kSmooth) {
    surface = upload_surface(gl, posed_mesh());
    return;
  }
  const Skin skin = skin_of(context, model);
  pose_skin(gl, upload_skin(skin, subject.mesh), skin, bone_motions(model.model.skeleton, *subject.skeleton),
            *subject.skeleton, surface);
}

/// Places the surface and its normals as a model's texture and the pose say; that of a mesh stays.
/// \return its points
std::vector<Vec3> place_surface(GlContext& gl, ClContext& context, const Arguments& arguments, const Subject& subject,
                                GpuSurface& surface) {
  const std::vector<Vec3>& normals = subject.attributes.normals.values;
  if (!normals.empty()) write_normals(surface, normals);
  if (!subject.model) return subject.mesh.positions;
  pose_surface(gl, context, arguments, subject, surface);
  std::vector<Vec3> points = download_positions(surface);
  if (!normals.empty())
    write_normals(surface, !subject.is_posed ? normals : turn_normals(subject.mesh, normals, points));
  return points;
}

/// Takes mesh, skeleton and view from a file of configs/models.
/// \return the view, null where there is none
nlohmann::json resolve_config(Arguments& arguments, const CLI::App& command) {
  if (!has_ending(arguments.input, ".json")) return {};
  const ModelConfig config = read_model_config(arguments.input);
  check_named_input(command, config.mesh.string(), "the mesh of " + arguments.input);
  if (!config.skeleton.empty())
    check_named_input(command, config.skeleton.string(), "the skeleton of " + arguments.input);
  arguments.input = config.mesh.string();
  if (arguments.skeleton.empty() && (arguments.shows_skeleton || arguments.mode == "segments"))
    arguments.skeleton = config.skeleton.string();
  return config.view;
}

/// The texture, or where its patches lie.
void run_texture(const Arguments& arguments, int size) {
  const SkeletexModel model = read_model(arguments.input);
  write_picture(arguments.output, arguments.mode == "map" ? map_image(model, size) : layout_image(model, size));
  print(arguments.json, arguments.output + '\n');
  write_json(
      arguments.json,
      {{"picture", arguments.output}, {"mode", arguments.mode}, {"size", {model.texture.width, model.texture.height}}});
}

/// What the pictures of a command have in common.
struct Studio {
  const Arguments& arguments;
  ClContext& context;
  GlContext& gl;
  ProgressBar& bar;
  DrawOptions options;
  std::optional<LinearRgb> background;
  SurfacePaint paint;
  ErrorScale scale;
};

/// One picture, of views side by side.
Image draw_picture(Studio& studio, const Subject& subject, const GpuSurface& surface,
                   const std::vector<Camera>& cameras) {
  const Arguments& arguments = studio.arguments;
  const bool shows_skeleton =
      subject.skeleton && (arguments.shows_skeleton || (!arguments.skeleton.empty() && arguments.mode != "segments"));
  std::vector<Image> images;
  for (const Camera& camera : cameras) {
    Image image = draw(studio.gl, surface, studio.paint, camera, studio.options);
    if (shows_skeleton)
      draw_skeleton(studio.gl, *subject.skeleton, bounding_box(subject.mesh).diagonal(), camera, studio.options, image);
    images.push_back(std::move(image));
  }
  Image picture = tile(images, static_cast<int>(cameras.size()));
  const std::optional<LinearRgb>& background = studio.background;
  if (background) fill_background(picture, *background);
  const bool is_dark = background && (*background)[1] < 0.2f;
  if (!studio.scale.colours.empty())
    draw_scale(picture, studio.scale.colours, 0, studio.scale.highest, "error / diagonal",
               is_dark ? std::array{0.9, 0.9, 0.9} : std::array{0.1, 0.1, 0.1});
  return picture;
}

/// All pictures of the subject as it is posed.
/// \return for the JSON
Json draw_subject(Studio& studio, const Subject& subject, const View& view, const std::string& output,
                  double prepare_ms) {
  const Arguments& arguments = studio.arguments;
  Stopwatch watch;
  GpuSurface surface = upload_surface(studio.gl, subject.mesh);
  watch.lap_ms();
  const std::vector<Vec3> points = place_surface(studio.gl, studio.context, arguments, subject, surface);
  const double displace_ms = subject.model ? watch.lap_ms() : 0;
  const auto pictures = cameras_of(arguments.view, view, points, studio.options.width, studio.options.height);
  std::vector<std::string> paths;
  Json size;
  double draw_ms = 0;
  watch.lap_ms();
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    studio.bar.show("drawing", 0.3 + 0.6 * static_cast<double>(i) / static_cast<double>(pictures.size()));
    const Image picture = draw_picture(studio, subject, surface, pictures[i]);
    draw_ms += watch.lap_ms();
    paths.push_back(arguments.view.turntable > 0 ? numbered(output, i) : output);
    write_picture(paths.back(), picture);
    size = {picture.width, picture.height};
    watch.lap_ms();
  }
  Json json;
  if (arguments.view.turntable > 0)
    json["pictures"] = paths;
  else
    json["picture"] = output;
  json["mode"] = arguments.mode;
  json["size"] = size;
  json["vertices"] = surface.vertex_count;
  json["triangles"] = surface.triangle_count;
  json["times_ms"] = {{"prepare", prepare_ms}, {"displace", displace_ms}, {"draw", draw_ms}};
  json["renderer"] = studio.gl.renderer();
  if (!studio.scale.colours.empty()) json["error_max"] = studio.scale.highest;
  return json;
}

std::string text_of(const Json& json, const std::string& output) {
  const std::string files = json.contains("pictures")
                                ? fmt::format("{} .. {}", json["pictures"].front().get<std::string>(),
                                              json["pictures"].back().get<std::string>())
                                : output;
  const Json& times = json["times_ms"];
  return fmt::format(
      "{} ({} x {}): {} vertices, {} triangles; prepare {:.0f} ms, displace {:.0f} ms, draw {:.0f} ms on {}\n", files,
      json["size"][0].get<int>(), json["size"][1].get<int>(), json["vertices"].get<std::size_t>(),
      json["triangles"].get<std::size_t>(), times["prepare"].get<double>(), times["displace"].get<double>(),
      times["draw"].get<double>(), json["renderer"].get<std::string>());
}

/// A file for each picture of a turntable may be none that is read, and must be writable.
void check_turntable(const CLI::App& command, const std::string& output, int count) {
  for (int i = 0; i < count; ++i) check_made_output(command, numbered(output, static_cast<std::size_t>(i)));
}

void run(Arguments arguments, const CLI::App& command) {
  const nlohmann::json own_view = resolve_config(arguments, command);
  check_arguments(arguments);
  const auto [width, height] = parse_size(arguments.size, 16, 8192, "pixels");
  const std::optional<LinearRgb> background = parse_background(arguments.background);
  Stopwatch watch;
  if (arguments.mode == "map" || arguments.mode == "layout") {
    run_texture(arguments, std::max(width, height));
    return;
  }
  const std::vector<PoseOutput> outputs = pose_outputs(command, arguments.pose, arguments.output);
  for (const PoseOutput& one : outputs) check_turntable(command, one.output, arguments.view.turntable);
  ClContext context(arguments.device);
  std::optional<ProgressBar> bar(std::in_place, context);
  bar->show("reading", 0.05);
  Subject subject = load_subject(arguments, context);
  View view = view_of(arguments.view, own_view, arguments.input, subject.model ? subject.model->stance : std::nullopt);
  for (std::optional<Vec3>* point : {&view.target, &view.eye})
    if (*point) *point = subject.frame.from_user(**point);
  GlContext gl(arguments.gl_device);
  const double prepare_ms = watch.lap_ms();
  bar->show("drawing", 0.3);
  Studio studio{.arguments = arguments,
                .context = context,
                .gl = gl,
                .bar = *bar,
                .options = {},
                .background = background,
                .paint = {},
                .scale = {}};
  studio.options = {.width = width, .height = height, .samples = arguments.samples, .is_flat = arguments.is_flat};
  if (arguments.has_wires) studio.options.wire_pixels = 0.45;
  if (arguments.mode == "error" || arguments.mode == "weights") studio.options.lighting = 0.55;
  studio.paint = paint_of(arguments, subject, context, studio.scale);
  std::vector<std::optional<Skeleton>> posed;
  for (const PoseOutput& one : outputs)
    posed.push_back(one.pose.empty() ? std::nullopt : posed_skeleton(*subject.skeleton, one.pose, arguments.time));
  Json all = Json::array();
  std::string text;
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    if (posed[i]) subject.skeleton = std::move(posed[i]);
    Json json = draw_subject(studio, subject, view, outputs[i].output, prepare_ms);
    text += text_of(json, outputs[i].output);
    all.push_back(std::move(json));
  }
  bar.reset();
  print(arguments.json, text);
  write_json(arguments.json, is_pattern(arguments.pose) ? all : all[0]);
}

void add_pose_options(CLI::App& command, Arguments& arguments) {
  CLI::Option* pose = add_pose_option(command, arguments.pose);
  command.add_option("--time", arguments.time, "time in the animation (default: its first frame)")
      ->check(any_number())
      ->type_name("T")
      ->needs(pose);
  add_deform_option(command, arguments.deform)->needs(pose);
  command
      .add_flag("--no-distance", arguments.is_distance_dropped,
                "with --deform paper or coordinates: do not restore the distances to the bones")
      ->needs(pose);
  add_polish_option(command, arguments.is_polished, pose);
}

}  // namespace

void add_render_command(CLI::App& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand("render", "Draw a model or a mesh to a picture");
  declare_input(
      command,
      command.add_option("MODEL|MESH", arguments->input,
                         "model (.skx.exr, .skx), mesh, or .json that names mesh, skeleton and view (configs/models)"))
      ->required();
  declare_output(command,
                 command.add_option("-o,--output", arguments->output, "picture: .png, or .exr for linear floats"),
                 {".png", ".exr"})
      ->required()
      ->type_name("FILE");
  const std::vector<std::string> modes{"shaded", "segments", "normals", "checker", "error", "weights", "map", "layout"};
  take_one_of(*command.add_option("--mode", arguments->mode,
                                  "what is shown: shaded, segments, normals, checker, error, weights, map or layout"),
              modes);
  command.add_option("--bone", arguments->bone, "--mode weights: the bone, by its name")->type_name("NAME");
  CLI::Option* flat = command.add_flag("--flat", arguments->is_flat, "a normal per triangle");
  command
      .add_flag("--geometry-normals", arguments->is_smoothed,
                "normals of the triangles around each vertex instead of those that the model or file has")
      ->excludes(flat);
  command.add_flag("--wireframe", arguments->has_wires, "draw the triangles' edges");
  command.add_flag("--no-colours", arguments->is_plain, "grey, whatever colours the model or mesh has");
  declare_input(command, command.add_option("--skeleton", arguments->skeleton,
                                            "skeleton of a mesh: .json; drawn inside, or used by --mode segments"))
      ->type_name("FILE");
  command.add_flag("--show-skeleton", arguments->shows_skeleton, "draw the skeleton inside");
  declare_input(command, command.add_option("--against", arguments->against,
                                            "--mode error: the mesh that distances are measured to"))
      ->type_name("MESH");
  command
      .add_option("--error-max", arguments->error_max,
                  "upper end of the colours, share of the diagonal (default: 99 % lie below)")
      ->check(number_above(0))
      ->type_name("X");
  add_pose_options(command, *arguments);
  command.add_option("--lattice", arguments->lattice, "draw a model at another texture size, 4 to 16384 texels")
      ->check(number_in(4, 16384))
      ->type_name("N");
  add_view_options(command, arguments->view);
  command
      .add_option("--size", arguments->size, "of one view, pixels: N for N x N, or WIDTHxHEIGHT (default: 1200x900)")
      ->type_name("N|WxH");
  command.add_option("--samples", arguments->samples, "per pixel and direction, 1 to 8 (default: 2)")
      ->check(number_in(1, 8))
      ->type_name("N");
  command.add_option("--background", arguments->background, "white, black, transparent or #rrggbb")
      ->type_name("COLOUR");
  command
      .add_option("--gl-device", arguments->gl_device,
                  "EGL device: number or part of its name (default: hardware, else software)")
      ->type_name("DEVICE");
  add_device_option(command, arguments->device);
  add_json_option(command, arguments->json);
  command.footer(
      "Examples:\n"
      "  skeletex render bear.skx.exr -o bear.png\n"
      "  skeletex render configs/models/bear.json --mode segments --show-skeleton -o bear.png\n"
      "  skeletex render bear.off --skeleton bear.skeleton.json --mode segments --show-skeleton -o segments.png\n"
      "  skeletex render bear.off --mode error --against bear.ply -o error.png\n"
      "  skeletex render bear.skx.exr --pose wave.json --views 4 --size 600x800 -o round.png\n"
      "  skeletex render bear.skx.exr --view left --pose 'poses/*.json' -o pictures/{name}.png\n"
      "  skeletex render bear.skx.exr --turntable 36 -o turn.png\n"
      "No display is needed. Models are placed on the GL device, straight from their texture.");
  command.callback([arguments, &command] { run(*arguments, command); });
}

}  // namespace skeletex::cli
