// SPDX-License-Identifier: MIT
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <charconv>
#include <cmath>
#include <filesystem>
#include <future>
#include <memory>
#include <numbers>
#include <optional>

#include "close_mesh.h"
#include "command.h"
#include "compact_output.h"
#include "encode_report.h"
#include "files.h"
#include "progress_bar.h"
#include "rig_file.h"
#include "skeletex/analysis/manifold.h"
#include "skeletex/analysis/validate_input.h"
#include "skeletex/convert/encode_model.h"
#include "skeletex/convert/guess_stance.h"
#include "skeletex/convert/subdivide/loop_surface.h"
#include "skeletex/io/model_file.h"
#include "skeletex/io/skeleton_file.h"
#include "skeletex/io/suggestion.h"
#include "skeletex/model/error.h"
#include "skeletex/skeletonize/skeletonize.h"

namespace skeletex::cli {
namespace {

constexpr const char* kHybrid = "hybrid";  // each bone has a method of its own

struct Arguments {
  std::string mesh, skeleton, output, device, json, size = "512", method = "vsm";
  int iterations = 4, subdivisions = 0;
  double alpha = 0.5, stop_spread = 0, hybrid_threshold = EncodeOptions{}.hybrid_unseen_threshold;
  std::string rows = "surface", spd_hit = "last", share, diagonals, compression = "auto", rounding = "surface";
  bool has_no_prefilter = false, has_no_unfold = false, is_snapped = false, is_fitted = false, is_paper_recipe = false,
       is_half = false, is_verbose = false, has_no_normals = false, has_no_colours = false, has_no_numbers = false;
  std::optional<double> crease;
  std::string up, front;
  std::vector<std::string> bone_methods;
  CloseOptions close;
  CompactArguments compact;
};

std::vector<std::pair<std::string, Method>> parse_bone_methods(const std::vector<std::string>& texts) {
  std::vector<std::pair<std::string, Method>> methods;
  for (const std::string& text : texts) {
    const auto equals = text.rfind('=');
    const std::string method = equals == std::string::npos ? "" : text.substr(equals + 1);
    const std::vector<std::string> names = method_names();
    if (std::find(names.begin(), names.end(), method) == names.end())
      throw CLI::ValidationError("--bone-method",
                                 fmt::format("\"{}\" is not BONE={}", text, fmt::join(names, " or BONE=")));
    methods.emplace_back(text.substr(0, equals), method_named(method));
  }
  return methods;
}

TexelShare share_of(const std::string& name) {
  return name == "area" ? TexelShare::kArea : name == "triangles" ? TexelShare::kTriangles : TexelShare::kError;
}

void take_paper_recipe(EncodeOptions& options) {
  options.vsm = {.iterations = 1, .alpha = 0};
  options.reweights_squeezed = false;
  options.row_spacing = RowSpacing::kUniform;
  options.has_prefilter = false;
  options.has_unfold = false;
  options.has_snap = false;
  options.has_fit = false;
  if (!options.method || !is_height_field(*options.method)) options.texel_share = TexelShare::kTriangles;
}

/// A compact file is made from a dense regular grid: what lies along the surface in it costs nothing, and what the
/// other placings gain is below its quantization.
void take_compact_recipe(EncodeOptions& options) {
  options.width = options.height = std::clamp(2 * std::max(options.width, options.height), 1024, 4096);
  options.has_prefilter = false;
  options.has_snap = false;
  options.has_fit = false;
}

/// What is given beats the paper's recipe.
void set_texel_options(const Arguments& arguments, const CLI::App& command, EncodeOptions& options) {
  const auto is_given = [&](const char* name) { return command.count(name) > 0; };
  if (is_given("--iterations")) options.vsm.iterations = arguments.iterations, options.reweights_squeezed = false;
  if (is_given("--alpha")) options.vsm.alpha = arguments.alpha;
  options.vsm.stop_spread_change = arguments.stop_spread;
  if (is_given("--rows"))
    options.row_spacing = arguments.rows == "uniform" ? RowSpacing::kUniform : RowSpacing::kSurfaceLength;
  if (arguments.has_no_prefilter) options.has_prefilter = false;
  if (arguments.has_no_unfold) options.has_unfold = false;
  if (is_given("--snap")) options.has_snap = arguments.is_snapped;
  if (is_given("--fit")) options.has_fit = arguments.is_fitted;
  if (is_given("--diagonals"))
    options.diagonals = arguments.diagonals == "smooth" ? DiagonalRule::kSmooth : DiagonalRule::kNearest;
  options.spd_hit = arguments.spd_hit == "first" ? SpdHit::kFirst : SpdHit::kLast;
  if (is_given("--rounding") && !arguments.is_half) throw CLI::ValidationError("--rounding", "needs --half");
  options.has_half_texels = arguments.is_half && arguments.rounding == "surface";
  if (is_given("--share")) options.texel_share = share_of(arguments.share);
  options.layers.has_normals = !arguments.has_no_normals;
  options.layers.has_colours = !arguments.has_no_colours;
  options.layers.has_numbers = !arguments.has_no_numbers;
  if (arguments.crease) options.layers.crease_angle = *arguments.crease * std::numbers::pi / 180;
}

EncodeOptions encode_options(const Arguments& arguments, const CLI::App& command) {
  EncodeOptions options;
  const auto size = parse_size(arguments.size, 4, 16384, "texels");
  options.width = size[0];
  options.height = size[1];
  options.method = arguments.method == kHybrid ? std::nullopt : std::optional(method_named(arguments.method));
  options.hybrid_unseen_threshold = arguments.hybrid_threshold;
  options.hybrid_overrides = parse_bone_methods(arguments.bone_methods);
  if (options.method && (!arguments.bone_methods.empty() || command.count("--hybrid-threshold") > 0))
    throw CLI::ValidationError("--bone-method and --hybrid-threshold", "need --method hybrid");
  if (arguments.is_paper_recipe) take_paper_recipe(options);
  if (is_compact_path(arguments.output)) take_compact_recipe(options);
  set_texel_options(arguments, command, options);
  return options;
}

void check_bone_names(const Arguments& arguments, const EncodeOptions& options, const Skeleton& skeleton) {
  std::vector<std::string> names;
  for (const Bone& bone : skeleton.bones) names.push_back(bone.name);
  for (const auto& [name, method] : options.hybrid_overrides)
    if (std::find(names.begin(), names.end(), name) == names.end())
      throw InputError(fmt::format("--bone-method: {} has no bone \"{}\"{}",
                                   arguments.skeleton.empty() ? "the made skeleton" : arguments.skeleton, name,
                                   did_you_mean(name, names)));
}

/// Mesh and skeleton in the unit frame of the mesh.
struct Input {
  TriangleMesh mesh;
  MeshAttributes attributes;
  VertexBoneWeights weights;  ///< of a rig, see ImportedRig
  std::optional<TriangleTree> tree;
  Skeleton skeleton;
  Json closing;  ///< what --close did; null: nothing
};

/// Replaces the mesh by its Loop subdivision surface. Its weights are linear over its triangles, as named numbers are.
void subdivide(Input& input, int rounds) {
  std::vector<VertexNumbers>& numbers = input.attributes.numbers;
  const std::size_t own_numbers = numbers.size();
  const bool has_weights = !input.weights.empty() && !weighted_original(input.attributes);
  if (has_weights) {
    for (std::size_t bone = 0; bone < input.skeleton.bones.size(); ++bone)
      numbers.push_back({"", std::vector<float>(input.weights.size(), 0.f)});
    for (std::size_t v = 0; v < input.weights.size(); ++v)
      for (const auto& [bone, weight] : input.weights[v])
        numbers[own_numbers + bone].values[v] = static_cast<float>(weight);
  }
  AttributedMesh smooth = loop_surface(input.mesh, input.attributes, rounds);
  input.mesh = std::move(smooth.mesh);
  input.attributes = std::move(smooth.attributes);
  if (!has_weights) return;
  input.weights.assign(input.mesh.positions.size(), {});
  for (std::size_t bone = 0; own_numbers + bone < numbers.size(); ++bone)
    for (std::size_t v = 0; v < input.weights.size(); ++v)
      if (const float weight = numbers[own_numbers + bone].values[v]; weight > 0)
        input.weights[v].push_back({static_cast<int>(bone), weight});
  numbers.resize(own_numbers);
}

void move_to_unit_frame(Input& input) {
  const UnitFrame frame = unit_frame(input.mesh);
  input.mesh = in_unit_frame(std::move(input.mesh), frame);
  input.skeleton = in_unit_frame(std::move(input.skeleton), frame);
  if (input.tree) {  // what it holds is in this frame already
    input.tree->origin = Vec3::Zero();
    input.tree->scale = 1;
  }
}

Input read_input(ClContext& context, const Arguments& arguments, const EncodeOptions& options) {
  Input input;
  if (is_gltf_file(arguments.mesh)) {
    RigFile file = load_rig(arguments.mesh, arguments.close);
    if (arguments.skeleton.empty()) {
      // Joints are repaired only where the mesh has no errors. Else they are not worth a message yet.
      if (TriangleMesh mesh = file.surface.mesh; has_errors(validate_mesh(mesh))) require_closed(mesh);
      ImportedRig rig = import_rig(context, file);
      input.skeleton = std::move(rig.skeleton);
      input.weights = std::move(rig.weights);
    }
    input.mesh = std::move(file.surface.mesh);
    input.attributes = std::move(file.surface.attributes);
    input.closing = std::move(file.closing);
  } else {
    MeshFile file = load_mesh_file(arguments.mesh);
    MeshParts parts{std::move(file.mesh), std::move(file.attributes), {}};
    if (arguments.close.is_on) input.closing = close_mesh(parts, arguments.close);
    input.mesh = std::move(parts.mesh);
    input.attributes = std::move(parts.attributes);
  }
  if (!arguments.skeleton.empty()) input.skeleton = read_skeleton(arguments.skeleton);
  const std::vector<Triangle> triangles = input.mesh.triangles;
  if (arguments.skeleton.empty() && input.skeleton.bones.empty()) {
    input.tree = require_closed(input.mesh);
  } else {
    check_bone_names(arguments, options, input.skeleton);
    require_valid(input.mesh, input.skeleton, &input.tree);
  }
  if (input.mesh.triangles != triangles) turn_over(input.attributes);
  if (arguments.subdivisions > 0) {
    subdivide(input, arguments.subdivisions);
    // The surface lies inside of what is convex: bones and nodes may leave it.
    if (input.skeleton.bones.empty())
      input.tree = require_closed(input.mesh);
    else
      require_valid(input.mesh, input.skeleton, &input.tree);
  }
  move_to_unit_frame(input);
  return input;
}

/// As given, else guessed.
Stance stance_of(const Arguments& arguments, const Input& input) {
  // glTF says: up is y, and front is z.
  Stance guess = is_gltf_file(arguments.mesh) ? Stance{} : guess_stance(input.mesh, input.skeleton);
  if (arguments.up.empty() && arguments.front.empty()) return guess;
  std::optional<Vec3> front;
  if (!arguments.front.empty()) front = parse_direction("--front", arguments.front);
  return make_stance(arguments.up.empty() ? guess.up : parse_direction("--up", arguments.up), front);
}

/// "y", "-z" or "0.6,0.8,0".
std::string name_of(const Vec3& direction) {
  for (int axis = 0; axis < 3; ++axis)
    if (std::abs(std::abs(direction[axis]) - 1) < 1e-9)
      return std::string(direction[axis] < 0 ? "-" : "") + "xyz"[axis];
  return fmt::format("{:.3g},{:.3g},{:.3g}", direction.x(), direction.y(), direction.z());
}

/// A skeleton for a mesh without one, and says so.
Skeleton make_skeleton(ClContext& context, const Input& input, ProgressBar& bar) {
  SkeletonizeOptions options;
  options.progress = [&](const std::string& stage, double done) {
    bar.show(stage, done);
    return true;
  };
  SkeletonizeResult result = skeletonize(context, input.mesh, *input.tree, options);
  bar.show("reading and checking the input", 0);
  spdlog::info("no skeleton was given: made one of {} bone{} (skeletex skeletonize has options for it)",
               result.skeleton.bones.size(), result.skeleton.bones.size() == 1 ? "" : "s");
  result.skeleton.frame = input.skeleton.frame;  // of the mesh that it was made for
  return std::move(result.skeleton);
}

/// Makes a skeleton. Where none works because of handles, `--close` cuts all of them off unless it was told which.
void add_skeleton(ClContext& context, const Arguments& arguments, ProgressBar& bar, Input& input) {
  try {
    input.skeleton = make_skeleton(context, input, bar);
  } catch (const TopologyError&) {
    const int handles = measure_manifold(input.mesh).genus;
    if (!arguments.close.is_on || arguments.close.handles || handles == 0) throw;
    warn(fmt::format(
        "no skeleton works with the {} handle{} of the mesh, so all are cut off, as --close-handles {} does", handles,
        handles == 1 ? "" : "s", kLongestHandleLoop));
    MeshParts parts{in_user_units(std::move(input.mesh), input.skeleton.frame), std::move(input.attributes),
                    std::move(input.weights)};
    for (Json& loop : cut_handles_off(parts, kLongestHandleLoop)) input.closing["cut_loops"].push_back(std::move(loop));
    input.mesh = std::move(parts.mesh);
    input.attributes = std::move(parts.attributes);
    input.weights = std::move(parts.weights);
    input.tree = require_closed(input.mesh);
    move_to_unit_frame(input);
    input.skeleton = make_skeleton(context, input, bar);
  }
}

ExrCompression compression_of(const std::string& name) {
  return name == "none"  ? ExrCompression::kNone
         : name == "zip" ? ExrCompression::kZip
         : name == "piz" ? ExrCompression::kPiz
                         : ExrCompression::kAuto;
}

void warn_of_result(const EncodeReport& report) {
  for (const std::string& note : report.layer_notes) warn(note);
  for (const BoneReport& bone : report.bones) {
    if (lacks_part(bone, report.diagonal))
      warn(fmt::format(
          "bone \"{}\": a part of its surface is {:.1f} % of the diagonal away from the model, at ({:g}, {:g}, "
          "{:g})\n  remedy: more texels, or a bone of its own for that part",
          bone.name, 100 * bone.distance.furthest / report.diagonal, bone.distance.place[0], bone.distance.place[1],
          bone.distance.place[2]));
    if (has_false_surface(bone, report.diagonal))
      warn(
          fmt::format("bone \"{}\": its part of the model is {:.1f} % of the diagonal away from the mesh on average, "
                      "and {:.1f} % at "
                      "({:g}, {:g}, {:g})\n  remedy: --method hybrid or vsm, or more texels",
                      bone.name, 100 * bone.excess.mean / report.diagonal, 100 * bone.excess.furthest / report.diagonal,
                      bone.excess.place[0], bone.excess.place[1], bone.excess.place[2]));
    if (bone.flipped_triangles > 0)
      warn(fmt::format("bone \"{}\": {} triangles are flipped in its map\n  remedy: {}", bone.name,
                       bone.flipped_triangles,
                       is_height_field(bone.method) ? "--method hybrid or vsm"
                                                    : "bones of their own for parts that stick out far from it"));
    if (is_height_field(bone.method) && bone.unseen_area_fraction > EncodeOptions{}.hybrid_unseen_threshold)
      warn(fmt::format("bone \"{}\": rays do not see {:.1f} % of its surface; --method hybrid or vsm does", bone.name,
                       100 * bone.unseen_area_fraction));
  }
}

void run(const Arguments& arguments, const CLI::App& command) {
  if (has_compact_option(command) && !is_compact_path(arguments.output))
    throw CLI::ValidationError("--max-error, --max-bytes and --quality", "need an --output that ends in .skx");
  if (arguments.is_half && is_compact_path(arguments.output))
    throw CLI::ValidationError("--half", "needs an --output that ends in .skx.exr");
  EncodeOptions options = encode_options(arguments, command);
  Stopwatch watch;
  ClContext context(arguments.device);
  std::optional<ProgressBar> bar(std::in_place, context);
  bar->show("reading and checking the input", 0);
  // Loading the kernels takes as long as reading the input: a tenth of the command each. A rig's skeleton may need
  // repair, which takes the context itself.
  std::future<Input> reading = std::async(std::launch::async, [&] { return read_input(context, arguments, options); });
  if (!is_gltf_file(arguments.mesh)) context.prepare({"encode.cl", "read_surface"});
  Input input = reading.get();
  if (input.skeleton.bones.empty()) {
    add_skeleton(context, arguments, *bar, input);
    check_bone_names(arguments, options, input.skeleton);
  }
  options.attributes = &input.attributes;
  // A compact file has none: those that the mesh has not are not made to be left out.
  if (is_compact_path(arguments.output) && input.attributes.normals.empty()) options.layers.has_normals = false;
  options.stance = stance_of(arguments, input);
  options.tree = input.tree ? &*input.tree : nullptr;
  options.progress = [&](const std::string& stage, double done) {
    bar->show(stage, done);
    return true;
  };
  EncodeResult result = encode_model(context, input.mesh, input.skeleton, options);
  if (!input.weights.empty())
    result.model.bone_weights =
        weight_planes(context, result.model, input.mesh, input.tree ? *input.tree : build_triangle_tree(input.mesh),
                      weighted_original(input.attributes), input.weights);
  if (is_compact_path(arguments.output)) {
    bar->show("compressing", 0.9);
    const auto size = parse_size(arguments.size, 4, 16384, "texels");
    const Json compact = write_compact(context, result.model, &input.mesh, arguments.compact, command,
                                       std::max(size[0], size[1]), arguments.output);
    bar.reset();
    warn_of_result(result.report);
    print(arguments.json, compact_text(compact));
    write_json(arguments.json,
               {{"output", compact}, {"times_ms", {{"total", watch.lap_ms()}}}, {"kernels", profile_json(context)}});
    return;
  }
  bar->show("writing", 1);
  write_model(arguments.output, result.model,
              {.format = arguments.is_half ? TexelFormat::kHalf : TexelFormat::kFloat,
               .compression = compression_of(arguments.compression)});
  bar.reset();
  warn_of_result(result.report);
  const EncodedFile file{arguments.output, options.width, options.height, watch.lap_ms() / 1000};
  Json json = encode_report_json(result.report, file);
  if (!input.closing.is_null()) json["close"] = input.closing;
  json["kernels"] = profile_json(context);
  print(arguments.json, arguments.is_verbose ? encode_details_text(result.report) : "");
  print(arguments.json, encode_report_text(result.report, file));
  const bool is_guess = arguments.up.empty() && arguments.front.empty() && !is_gltf_file(arguments.mesh);
  print(arguments.json,
        fmt::format("up is {}, front is {}{}\n", name_of(result.model.stance->up), name_of(result.model.stance->front),
                    is_guess ? " (a guess; --up and --front say otherwise)" : ""));
  write_json(arguments.json, json);
}

CLI::Option& add(CLI::App& command, const char* group, const char* name, auto& value, const char* description) {
  return *command.add_option(name, value, description)->group(group);
}

void add_map_options(CLI::App& command, Arguments& a) {
  add(command, "VSM", "--iterations", a.iterations,
      "reweightings after the first solve, 0 to 100; 0 is the plain barycentric map; unless given, bones with squeezed "
      "parts get more")
      .type_name("N")
      ->check(number_in(0, 100));
  add(command, "VSM", "--alpha", a.alpha,
      "weights grow by texture area / surface area ^ alpha, 0 to 2; 0 evens out texture areas (the paper), 1 density "
      "on the surface")
      .type_name("X")
      ->check(number_in(0.0, 2.0));
  add(command, "VSM", "--stop-spread", a.stop_spread,
      "stop when a reweighting changes the spread of texture areas by less than this share, e.g. 0.01; 0: never")
      .type_name("X")
      ->check(number_in(0.0, 1.0));
  take_one_of(add(command, "SPD", "--spd-hit", a.spd_hit, "which hit of a ray counts where there are several"),
              {"first", "last"});
  add(command, "Hybrid", "--hybrid-threshold", a.hybrid_threshold,
      "bones take vsm where spd does not see more than this share of their area, 0 to 1, or is further from the mesh")
      .type_name("X")
      ->check(number_in(0.0, 1.0));
  add(command, "Hybrid", "--bone-method", a.bone_methods, "method of a bone by its name; repeat for more bones")
      .type_name(fmt::format("BONE={}", fmt::join(method_names(), "|")))
      ->expected(1)
      ->take_all();
}

void add_texel_options(CLI::App& command, Arguments& a) {
  take_one_of(add(command, "Texels", "--rows", a.rows,
                  "where rows lie along a bone: evenly in surface length, or uniform in the map (the paper)"),
              {"surface", "uniform"});
  take_one_of(add(command, "Texels", "--share", a.share,
                  "what a bone's share of the texels follows, and by error its columns per row as well; unless given: "
                  "area with --method spd, error otherwise"),
              {"error", "triangles", "area"});
  command.add_flag("--no-unfold", a.has_no_unfold, "the regular grid as it is, also where it folds in space");
  command
      .add_flag("--no-prefilter", a.has_no_prefilter,
                "texels exactly on the mesh, so that flat triangles lie inside its curved parts")
      ->group("Texels");
  command
      .add_flag("--snap,!--no-snap", a.is_snapped,
                "texels of VSM patches sit on the mesh's own vertices and edges where they can; instead of the "
                "prefilter (default: where it is expected to lower the error, from about 0.6 texels per vertex on)")
      ->group("Texels");
  command
      .add_flag(
          "--fit,!--no-fit", a.is_fitted,
          "their points move so that the triangles between them are nearer to the mesh; instead of the prefilter "
          "(default: up to 256 x 256 texels; up to 1280 x 1280 below 7 texels per vertex, in fewer steps from 4.5 on)")
      ->group("Texels");
  take_one_of(add(command, "Texels", "--diagonals", a.diagonals,
                  "how the decoder cuts quads: nearest to the surface that texels around foretell, or smooth, going on "
                  "best into the quads around; unless "
                  "given: smooth where texels are snapped or fitted, else nearest"),
              {"nearest", "smooth"});
  command
      .add_flag("--paper-recipe", a.is_paper_recipe,
                "as close to the paper as the options allow (one reweighting, as it gives no number, and shares by "
                "triangles instead of lengths of bones): --rows uniform --share triangles --alpha 0 --iterations 1 "
                "--no-unfold --no-prefilter --no-snap --no-fit (unfold and prefilter stay off, the others can still be "
                "given)")
      ->group("Texels");
}

void add_file_options(CLI::App& command, Arguments& a) {
  command
      .add_flag("--half", a.is_half,
                "16 bits a channel: half the file, or a third, for an error of some 2e-6 of the diagonal more")
      ->group("File");
  take_one_of(add(command, "File", "--rounding", a.rounding,
                  "with --half, which half floats: those near a texel whose point stays nearest to the surface, or the "
                  "nearest ones"),
              {"surface", "nearest"});
  take_one_of(add(command, "File", "--compression", a.compression,
                  "lossless compression of the file; auto: zip where it saves an eighth or more, else none"),
              {"auto", "none", "zip", "piz"});
}

void add_layer_options(CLI::App& command, Arguments& a) {
  CLI::Option* none = command.add_flag("--no-normals", a.has_no_normals, "store no shading normals")->group("Layers");
  add(command, "Layers", "--crease", a.crease,
      "degrees: edges that turn more are sharp; of meshes whose file has no normals (default: none is)")
      .type_name("DEG")
      ->check(number_in(0.0, 180.0))
      ->excludes(none);
  command.add_flag("--no-colours", a.has_no_colours, "store no colours: vertex colours, materials and their pictures")
      ->group("Layers");
  command.add_flag("--no-numbers", a.has_no_numbers, "store no other numbers of the vertices (PLY)")->group("Layers");
}

}  // namespace

void add_encode_command(CLI::App& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand(
      "encode", "Turn a closed mesh and its skeleton into a model: one texture in an OpenEXR file, or a compact file");
  command.option_defaults()->always_capture_default();
  Arguments& a = *arguments;
  declare_input(command, &add(command, "Positionals", "MESH", a.mesh,
                              "closed triangle mesh: .obj, .ply, .off, .stl; or a rigged character: .glb, .gltf, .vrm"))
      ->required();
  declare_input(command, &add(command, "Positionals", "SKELETON", a.skeleton,
                              "skeleton: JSON with nodes and bones, in the mesh's coordinates; without, that of a rig, "
                              "or one is made (see skeletonize)"));
  declare_output(command,
                 &add(command, "Options", "-o,--output", a.output, "the model: .skx.exr, or a compact file: .skx"),
                 {".exr", ".skx"})
      ->required()
      ->type_name("FILE");
  add(command, "Options", "--size", a.size, "texels: N for N x N, or WIDTHxHEIGHT").type_name("N|WxH");
  add(command, "Options", "--subdivide", a.subdivisions,
      "encode the smooth surface that Loop subdivision makes of the mesh, divided N times, 0 to 6: more texels make it "
      "smoother. Distances are then to that surface")
      .type_name("N")
      ->check(number_in(0, 6));
  std::vector<std::string> methods = method_names();
  methods.push_back(kHybrid);
  take_one_of(add(command, "Options", "--method", a.method,
                  "how bones are mapped: spd casts rays from the bone (a height field), vsm spreads the triangles over "
                  "the texels, hybrid takes spd "
                  "where it is as near to the mesh as vsm"),
              methods);
  add(command, "Options", "--up", a.up, "where the mesh's up is (default: a guess, which is told)")
      .type_name("x|-y|..|X,Y,Z");
  add(command, "Options", "--front", a.front, "where it looks (default: a guess, which is told)")
      .type_name("x|-y|..|X,Y,Z");
  add_map_options(command, a);
  add_texel_options(command, a);
  add_layer_options(command, a);
  add_file_options(command, a);
  add_compact_options(command, a.compact);
  add_close_options(command, a.close);
  command.add_flag("--verbose", a.is_verbose, "print what was done for each bone and how long each stage took, too");
  add_device_option(command, arguments->device);
  add_json_option(command, arguments->json);
  command.footer(
      "Examples:\n"
      "  skeletex encode bear.off bear.skeleton.json -o bear.skx.exr\n"
      "  skeletex encode bear.off -o bear.skx.exr\n"
      "  skeletex encode bear.off bear.skeleton.json -o bear.skx.exr --method hybrid --bone-method head=vsm --size "
      "1024\n"
      "  skeletex encode bear.off bear.skeleton.json -o bear.skx --max-error 5e-5\n"
      "  skeletex encode robot.glb -o robot.skx.exr\n"
      "  skeletex encode bear.off bear.skeleton.json -o bear.skx.exr --json - | jq .times_ms\n"
      "Areas are in the mesh's units squared, times in milliseconds.");
  command.callback([arguments, &command] { run(*arguments, command); });
}

}  // namespace skeletex::cli
