// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "command.h"
#include "files.h"
#include "progress_bar.h"
#include "skeletex/convert/guess_stance.h"
#include "skeletex/convert/resample/resample.h"
#include "skeletex/edit/regular_grid.h"
#include "skeletex/io/gltf/write_gltf.h"
#include "skeletex/io/model_file.h"
#include "skeletex/io/pose_file.h"
#include "skeletex/io/same_file.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/reconstruct/texture/bake_displacement.h"
#include "skeletex/render/image.h"
#include "skeletex/rig/export_rig.h"
#include "skeletex/skeleton/free_name.h"

namespace skeletex::cli {
namespace {

constexpr int kBaseSize = 64;  // texels along the longer side of a mesh with a displacement, without --lod

struct Arguments {
  std::string model, output, displacement, displacement_for = "blender", format = "rig", device, json, up;
  std::vector<std::string> animations;
  int size = 0, level = 0, texture = 0;
};

/// Animations are named as their files, each name once.
std::vector<NamedAnimation> read_animations(const std::vector<std::string>& paths, const Skeleton& skeleton) {
  std::vector<NamedAnimation> animations;
  std::set<std::string> taken;
  for (const std::string& path : paths) {
    const std::string name = free_name(std::filesystem::path(path).stem().string(), taken);
    animations.push_back({name, read_animation(path, skeleton)});
  }
  return animations;
}

/// Turns the model so that it stands along y and looks along z, as glTF has it.
/// \param up  the axis that is up in the model; what looks along -y of a z axis then looks along z. Empty: as the model
///            stands
Eigen::Quaterniond placement_of(const std::string& up, const std::optional<Stance>& own) {
  if (up.empty()) {
    const Stance stance = own ? make_stance(own->up, own->front) : Stance{};
    Eigen::Matrix3d from_scene;
    from_scene << stance.up.cross(stance.front), stance.up, stance.front;
    return Eigen::Quaterniond(from_scene.transpose());
  }
  Vec3 axis = Vec3::Zero();
  axis[up.back() - 'x'] = up.front() == '-' ? -1 : 1;
  if (axis == -Vec3::UnitY()) return Eigen::Quaterniond(0, 1, 0, 0);  // half a turn about x
  return Eigen::Quaterniond::FromTwoVectors(axis, Vec3::UnitY());
}

std::string model_name(const std::string& path) {
  std::string name = std::filesystem::path(path).filename().string();
  for (const char* ending : {".exr", ".skx"})
    if (has_ending(name, ending)) name.resize(name.size() - 4);
  return name;
}

bool is_in_tangent_space(const std::string& program) { return program != "blender" && program != "object"; }

/// Writes the vectors as the channels R, G, B of an OpenEXR file.
/// \param program  of --displacement-for
/// \throw IoError
void write_displacement(const std::string& path, const DisplacementPicture& picture, const std::string& program) {
  Image image = make_image(picture.width, picture.height);
  for (std::size_t i = 0; i < picture.values.size(); ++i) {
    Eigen::Vector3f value = picture.values[i];
    if (program == "blender") value = {value.x(), -value.z(), value.y()};  // it turns glTF from y up to z up
    if (program == "materialx") std::swap(value.y(), value.z());           // tangent, bitangent, normal
    std::copy_n(value.data(), 3, image.rgba.data() + 4 * i);
    image.rgba[4 * i + 3] = 1;
  }
  write_exr_image(path, image);
}

/// --format base+vdm: the picture beside the mesh, where --displacement names no other place.
void name_displacement(const CLI::App& command, Arguments& arguments) {
  if (arguments.format == "base+vdm" && arguments.displacement.empty()) {
    if (command.count("--texture") > 0) throw CLI::ExcludesError("--format base+vdm", "--texture");
    arguments.displacement = std::filesystem::path(arguments.output).replace_extension(".exr").string();
    if (is_same_file(arguments.displacement, arguments.model))
      throw CLI::ValidationError("--format", arguments.displacement + " is MODEL; name another with --displacement");
  }
  if (command.count("--displacement-for") > 0 && arguments.displacement.empty())
    throw CLI::RequiresError("--displacement-for", "--displacement");
}

void run(const Arguments& arguments) {
  Stopwatch watch;
  SkeletexModel original = read_model(arguments.model, arguments.level);
  const std::vector<NamedAnimation> animations = read_animations(arguments.animations, original.skeleton);
  ClContext context(arguments.device);
  ProgressBar bar(context);
  std::optional<SkeletexModel> resized;
  const bool is_displaced = !arguments.displacement.empty();
  if (is_displaced)
    original = regular_grid(context, original);  // snapped texels lie unevenly and would fold between pixels
  const int size = arguments.size > 0 ? arguments.size : is_displaced ? kBaseSize : 0;
  if (size > 0 && size != std::max(original.texture.width, original.texture.height)) {
    bar.show("resampling", 0.1);
    resized = resample_model(context, original, size);
  }
  bar.show("reconstructing", 0.3);
  std::optional<DisplacementPicture> displacement;
  if (is_displaced)
    displacement = bake_displacement(
        context, original, resized ? *resized : original,
        is_in_tangent_space(arguments.displacement_for) ? DisplacementSpace::kTangent : DisplacementSpace::kObject);
  const GltfScene scene = export_rig(context, resized ? *resized : original,
                                     {.name = model_name(arguments.model),
                                      .placement = placement_of(arguments.up, original.stance),
                                      .animations = animations,
                                      .texture_size = arguments.texture,
                                      .original = &original,
                                      .displacement = displacement ? &*displacement : nullptr});
  bar.show("writing", 0.7);
  if (displacement) write_displacement(arguments.displacement, *displacement, arguments.displacement_for);
  write_gltf(arguments.output, scene);
  const double ms = watch.lap_ms();
  const GltfPrimitive& surface = scene.meshes[0].primitives[0];
  Json clips = Json::array();
  std::string clips_text;
  for (const GltfAnimation& animation : scene.animations) {
    std::size_t frames = 0;
    for (const GltfTrack& track : animation.tracks) frames = std::max(frames, track.times.size());
    clips.push_back({{"name", animation.name}, {"frames", frames}, {"tracks", animation.tracks.size()}});
    clips_text += fmt::format("animation {}: {} frames, {} tracks\n", animation.name, frames, animation.tracks.size());
  }
  print(arguments.json,
        fmt::format("{} vertices, {} triangles, {} joints\n{}{}\n", surface.positions.size(), surface.triangles.size(),
                    scene.skins[0].joints.size(), clips_text, arguments.output));
  const Json picture =
      displacement
          ? Json{{"path", arguments.displacement}, {"width", displacement->width}, {"height", displacement->height}}
          : Json();
  write_json(arguments.json, {{"output", arguments.output},
                              {"displacement", picture},
                              {"vertices", surface.positions.size()},
                              {"triangles", surface.triangles.size()},
                              {"joints", scene.skins[0].joints.size()},
                              {"animations", std::move(clips)},
                              {"times_ms", {{"total", ms}}},
                              {"device", context.device().name},
                              {"kernels", profile_json(context)}});
}

}  // namespace

void add_export_command(CLI::App& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand(
      "export", "Write a model as a rigged character for other programs: mesh, skeleton, skin and animations as glTF");
  declare_input(command, command.add_option("MODEL", arguments->model, "model: .skx.exr or .skx"))->required();
  declare_output(command, command.add_option("-o,--output", arguments->output, "glTF 2.0, binary: .glb"), {".glb"})
      ->required()
      ->type_name("FILE");
  declare_input(command, command.add_option("--animation", arguments->animations,
                                            "pose or animation that the rig brings along: .json; repeat for more"))
      ->type_name("FILE")
      ->expected(1)
      ->take_all();
  command
      .add_option("--lod", arguments->size,
                  "mesh of fewer or more texels, along the longer side, 4 to 16384 (default: the model's own size)")
      ->check(number_in(4, 16384))
      ->type_name("N");
  command
      .add_option("--level", arguments->level,
                  "level of a file that `skeletex lod --levels` has written (default: 0, the finest)")
      ->check(number_from(0))
      ->type_name("K");
  command
      .add_option("--texture", arguments->texture,
                  "colours as a picture of so many texels along the model's longer side, 16 to 8192 (default: colours "
                  "by vertex)")
      ->check(number_in(16, 8192))
      ->type_name("N");
  take_one_of(*command.add_option("--up", arguments->up,
                                  "axis of the model that is up; y is in glTF (default: the model's own)"),
              {"x", "y", "z", "-x", "-y", "-z"});
  declare_output(
      command,
      command.add_option("--displacement", arguments->displacement,
                         "write the mesh coarse (--lod, default 64), and beside it a picture of the vectors to the "
                         "model's own surface: .exr"),
      {".exr"})
      ->type_name("FILE")
      ->excludes("--texture");
  take_one_of(*command.add_option("--format", arguments->format,
                                  "rig: the mesh alone (default); base+vdm: a coarse mesh, and its displacement beside "
                                  "it, X.exr of X.glb"),
              {"rig", "base+vdm"});
  take_one_of(
      *command.add_option("--displacement-for", arguments->displacement_for,
                          "what the vectors of the picture refer to. blender: object space, z up, as its Displace "
                          "modifier takes them (default); object: object space, y up; maya, arnold: tangent space, "
                          "as tangent, normal, bitangent; materialx: tangent space, as tangent, bitangent, normal"),
      {"blender", "object", "maya", "arnold", "materialx"});
  add_device_option(command, arguments->device);
  add_json_option(command, arguments->json);
  command.footer(
      "Examples:\n"
      "  skeletex export bear.skx.exr -o bear.glb --lod 128\n"
      "  skeletex export man.skx.exr -o man.glb --animation walk.json --animation sit.json\n"
      "  skeletex export bear.skx.exr -o bear.glb --lod 64 --format base+vdm\n"
      "Other programs move the surface by linear blend skinning with the four strongest weights of smooth poses; "
      "`reconstruct --deform linear` shows the same. Each bone is a joint of its own name.");
  command.callback([arguments, &command] {
    name_displacement(command, *arguments);
    run(*arguments);
  });
}

}  // namespace skeletex::cli
