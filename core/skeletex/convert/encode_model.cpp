// SPDX-License-Identifier: MIT
#include "skeletex/convert/encode_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <utility>

#include "skeletex/convert/layout/pack_atlas.h"
#include "skeletex/convert/layout/ray_profile.h"
#include "skeletex/convert/layout/row_profile.h"
#include "skeletex/convert/map_surface.h"
#include "skeletex/convert/sample/sample_seams.h"
#include "skeletex/convert/segment/segment_mesh.h"
#include "skeletex/convert/subdivide/split_edges.h"
#include "skeletex/device/stopwatch.h"
#include "skeletex/geometry/parallel.h"
#include "skeletex/model/error.h"
#include "skeletex/model/memory.h"
#include "skeletex/reconstruct/prepared_model.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/skeleton/check_skeleton.h"
#include "skeletex/skeleton/find_bone.h"

namespace skeletex {
namespace {

constexpr double kHardlyWorse = 1.1;           // hybrid: of a distance, for SPD
constexpr double kMostFitted = 8192.0 * 8192;  // texels: the fit counts numbers of them with 32 bits
constexpr double kLeastDihedral = 0.004;       // radians: flatter edges are no creases to snap to
// Edges of large triangles are split where they are longer: the map is linear on every triangle, and on few large ones
// it cannot be even. Small triangles keep their edges, as more vertices would need the texels of others. Where large
// triangles are a smaller share of the surface nothing is split, as vertices would be denser there than around them.
constexpr double kLongestEdge = 16;       // texels
constexpr double kLeastSplitArea = 80;    // of a large triangle, texels
constexpr double kLeastSplitShare = 0.5;  // of the surface

void check_options(const EncodeOptions& options, const Skeleton& skeleton) {
  if (options.vsm.iterations < 0 || options.vsm.iterations > 100)
    throw InputError(fmt::format("{} VSM iterations; give 0 to 100", options.vsm.iterations));
  if (!(options.vsm.alpha >= 0 && options.vsm.alpha <= 1))
    throw InputError(fmt::format("VSM alpha is {}; give 0 to 1", options.vsm.alpha));
  if (options.has_fit.value_or(false) && static_cast<double>(options.width) * options.height > kMostFitted)
    throw InputError(fmt::format("the fit takes at most 8192 x 8192 texels, not {} x {}; leave it out, or take fewer",
                                 options.width, options.height));
  if (!(options.hybrid_unseen_threshold >= 0))
    throw InputError("the hybrid threshold is negative; give a share of area, such as 0.01");
  for (const auto& override : options.hybrid_overrides)
    if (!find_bone(skeleton, override.first))
      throw InputError(
          fmt::format("a method is given for bone \"{}\", which the skeleton does not have", override.first));
}

/// What encoding takes at its peak, as measured, less a tenth.
double estimated_bytes(const EncodeOptions& options, const TriangleMesh& mesh) {
  constexpr double kPerTexel = 380, kPerFitted = 416, kPerRay = 80, kPerTriangle = 600;
  const bool has_maps = !options.method || !is_height_field(*options.method);
  const double per_texel = has_maps ? kPerTexel + (options.has_fit.value_or(false) ? kPerFitted : 0) : kPerRay;
  return per_texel * options.width * options.height + kPerTriangle * static_cast<double>(mesh.triangles.size());
}

/// SPD patches are neither snapped nor fitted; without the prefilter texels stay on the mesh unless the fit is asked
/// for.
TexelPlacing placing_of(const EncodeOptions& options, const TriangleMesh& mesh, bool is_all_spd) {
  if (is_all_spd) return {};
  const std::optional<bool> has_fit = options.has_fit || options.has_prefilter ? options.has_fit : std::optional(false);
  return choose_placing(static_cast<std::size_t>(options.width) * static_cast<std::size_t>(options.height),
                        mesh.positions.size(), options.has_snap, has_fit);
}

nlohmann::json settings_json(const EncodeOptions& options, const TexelPlacing& placing,
                             const std::vector<double>& unseen) {
  nlohmann::json json{{"method", options.method ? to_string(*options.method) : "hybrid"},
                      {"size", {options.width, options.height}},
                      {"vsm",
                       {{"iterations", options.vsm.iterations},
                        {"alpha", options.vsm.alpha},
                        {"stop_spread_change", options.vsm.stop_spread_change}}},
                      {"rows", options.row_spacing == RowSpacing::kSurfaceLength ? "surface" : "uniform"},
                      {"prefilter", options.has_prefilter},
                      {"unfold", options.has_unfold},
                      {"snap", placing.has_snap},
                      {"fit", placing.is_fitted()},
                      {"fit_steps", placing.fit_steps},
                      {"spd_hit", options.spd_hit == SpdHit::kFirst ? "first" : "last"}};
  if (!options.method) json["hybrid_unseen_threshold"] = options.hybrid_unseen_threshold;
  if (!unseen.empty()) json["unseen_area_fractions"] = unseen;
  return json;
}

/// What snapping, fit and rounding did, for the record.
void add_results(const TexelReport& report, double diagonal, nlohmann::json& json) {
  const auto share = [](int part, int whole) { return whole > 0 ? static_cast<double>(part) / whole : 1.0; };
  if (report.snap)
    json["snapped"] = {{"vertices", share(report.snap->snapped_vertices, report.snap->vertices)},
                       {"edges", share(report.snap->snapped_edges, report.snap->edges)},
                       {"texels_reverted", report.snap->reverted_texels}};
  if (report.fit) {
    nlohmann::json residuals = nlohmann::json::array();
    for (const double residual : report.fit->residuals) residuals.push_back(residual / diagonal);
    json["fitted"] = {{"residuals", std::move(residuals)}, {"texels_reverted", report.fit->reverted_texels}};
  }
  if (report.rounding)
    json["rounded"] = {{"nearest", report.rounding->nearest / diagonal},
                       {"chosen", report.rounding->chosen / diagonal}};
  if (report.revert)
    json["inverted_triangles"] = {{"lattice", report.revert->inverted_triangles},
                                  {"regular", report.revert->regular_inverted_triangles}};
}

/// Vertices where the pole of a chart's free end lies.
int pole_of(const Chart& chart, ChartVertex kind) {
  return static_cast<int>(std::find(chart.kinds.begin(), chart.kinds.end(), kind) - chart.kinds.begin());
}

/// The model as it is before its surface is mapped: frame, and the skeleton with its angles of 0.
SkeletexModel start_model(const TriangleMesh& mesh, const Skeleton& skeleton) {
  SkeletexModel model;
  model.skeleton = skeleton;
  const std::vector<BoneBasis> bases = bone_bases(model.skeleton);
  for (std::size_t bone = 0; bone < bases.size(); ++bone) model.skeleton.bones[bone].s = bases[bone].s;
  const BoundingBox box = bounding_box(mesh);
  model.origin = box.centre();
  model.diagonal = box.diagonal();
  if (!(model.diagonal >= kSmallestDiagonal && model.diagonal <= kLargestDiagonal))
    throw InputError(
        fmt::format("the mesh's bounding box has a diagonal of {:.3g}; the device computes in single precision, which "
                    "needs {:g} to {:g}: give mesh and skeleton in the unit frame of the mesh",
                    model.diagonal, kSmallestDiagonal, kLargestDiagonal));
  return model;
}

/// Of mapped bones their own, of the others those of their rays.
std::vector<RowProfile> row_profiles(ClContext& context, const Skeleton& skeleton, const SeparationPlanes& separation,
                                     const MappedSurface& surface, SpdHit hit) {
  if (std::none_of(surface.methods.begin(), surface.methods.end(), is_height_field)) return surface.profiles;
  std::vector<RowProfile> profiles = ray_profiles(context, skeleton, separation, surface.charts, hit);
  for (std::size_t i = 0; i < profiles.size(); ++i)
    if (!is_height_field(surface.methods[i])) profiles[i] = surface.profiles[i];
  return profiles;
}

/// Shares texels out by detail, to rectangles with sides in the ratio of girth to length, and spreads their rows.
/// \return the used share of the texture
double lay_out_patches(const MappedSurface& surface, std::span<const RowProfile> profiles, const EncodeOptions& options,
                       SkeletexModel& model) {
  const std::vector<Segment>& segments = surface.segmentation.segments;
  std::vector<PatchSource> sources;
  for (std::size_t bone = 0; bone < segments.size(); ++bone)
    sources.push_back({is_height_field(surface.methods[bone]) ? nullptr : &surface.errors[bone],
                       static_cast<double>(segments[bone].mesh.triangles.size()), surface_area(segments[bone].mesh),
                       std::max(profiles[bone].length, 1e-9 * model.diagonal)});
  const bool has_uniform_rows = options.row_spacing == RowSpacing::kUniform;
  const bool has_maps = !std::all_of(surface.methods.begin(), surface.methods.end(), is_height_field);
  const AtlasLayout layout = pack_atlas(
      patch_requests(sources, options.texel_share.value_or(has_maps ? TexelShare::kError : TexelShare::kArea)),
      options.width, options.height);
  for (std::size_t bone = 0; bone < segments.size(); ++bone) {
    Patch patch{layout.rectangles[bone], surface.methods[bone], segments[bone].topology, {}};
    patch.row_u = has_uniform_rows ? spread_rows_uniformly(patch.rectangle.height)
                                   : spread_rows_by_length(profiles[bone], patch.rectangle.height);
    model.patches.push_back(std::move(patch));
  }
  model.texture.width = options.width, model.texture.height = options.height;
  return layout.used_fraction;
}

void add_seams(const Segmentation& segmentation, const SeparationPlanes& separation, SeamSampling sampling,
               SkeletexModel& model) {
  std::vector<Rectangle> rectangles;
  for (const Patch& patch : model.patches) rectangles.push_back(patch.rectangle);
  Seams seams = sample_seams(segmentation, model.skeleton, separation, rectangles, sampling);
  model.arcs = std::move(seams.arcs);
  model.corners = std::move(seams.corners);
  model.ends = std::move(seams.ends);
  model.genus = genus_of(model);
}

/// Per bone what the rays of its texels hit; nothing for a bone with a map.
std::vector<SpdHits> cast_rays(ClContext& context, const SkeletexModel& model, const SeparationPlanes& separation,
                               std::span<const Chart> charts, SpdHit hit) {
  std::vector<SpdHits> hits(charts.size());
  std::vector<Chart> cast_charts;
  std::vector<Patch> cast_patches;
  for (std::size_t bone = 0; bone < charts.size(); ++bone)
    if (is_height_field(model.patches[bone].method)) {
      cast_charts.push_back(charts[bone]);
      cast_patches.push_back(model.patches[bone]);
    }
  if (cast_charts.empty()) return hits;
  std::vector<SpdHits> cast = cast_spd_rays(context, model.skeleton, separation, cast_charts, cast_patches, hit);
  for (std::size_t bone = 0, i = 0; bone < charts.size(); ++bone)
    if (is_height_field(model.patches[bone].method)) hits[bone] = std::move(cast[i++]);
  return hits;
}

/// Per bone and end the points of its row: on the seam, or the pole.
std::vector<std::array<std::vector<Vec3>, 2>> find_end_points(const SkeletexModel& model,
                                                              const SeparationPlanes& separation,
                                                              const MappedSurface& surface) {
  std::vector<std::array<std::vector<Vec3>, 2>> end_points(model.patches.size());
  for (BoneIndex bone = 0; bone < static_cast<int>(model.patches.size()); ++bone)
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) {
      const Chart& chart = surface.charts[bone];
      auto& points = end_points[bone][static_cast<int>(end)];
      if (separation.is_free(bone, end))
        points = {
            chart.positions[pole_of(chart, end == BoneEnd::kHead ? ChartVertex::kHeadPole : ChartVertex::kTailPole)]};
      else
        points = points_on_loop(surface.segmentation.segments[bone], model.skeleton, separation, end,
                                model.patches[bone].rectangle.width);
    }
  return end_points;
}

/// The input with its long edges split, and what is made of it once, whatever the methods.
struct EncodeJob {
  ClContext& context;
  const TriangleMesh& mesh;
  const TriangleTree& tree;  ///< of the mesh
  const SeparationPlanes& separation;
  const EncodeOptions& options;
};

/// Reads the texels of a model that is laid out.
TexelResult read_model_texels(const EncodeJob& job, const SkeletexModel& model, const MappedSurface& surface,
                              const TexelPlacing& placing) {
  ClContext& context = job.context;
  const EncodeOptions& options = job.options;
  std::optional<DeviceSnapTables> features;
  if (placing.has_snap)
    features =
        upload_tables(context, tables_of(place_features(find_features(surface.charts, surface.methods, kLeastDihedral),
                                                        surface.charts, model.patches),
                                         model.patches));
  const std::vector<SpdHits> hits = cast_rays(context, model, job.separation, surface.charts, options.spd_hit);
  const auto end_points = find_end_points(model, job.separation, surface);
  std::optional<RevertSources> revert;
  if (!placing.is_regular_grid()) revert.emplace(RevertSources{model, job.mesh, job.tree, surface.charts});
  TexelOptions texel_options{
      .has_prefilter = options.has_prefilter, .has_unfold = options.has_unfold, .fit_steps = placing.fit_steps};
  if (options.has_half_texels) texel_options.half_rule = model.diagonals;
  return read_texels(
      context, model.skeleton, job.separation,
      {surface.charts, model.patches, hits, end_points, revert ? &*revert : nullptr, features ? &*features : nullptr},
      options.width, options.height, model.origin, texel_options);
}

/// A model whose surface is mapped, encoded with the methods of its bones.
struct Encoding {
  SkeletexModel model;
  TexelReport texels;
  TexelPlacing placing;
  std::vector<Method> methods;
  double used_fraction = 0;
};
/// \param model  see start_model
Encoding encode_surface(const EncodeJob& job, SkeletexModel model, const MappedSurface& surface) {
  const EncodeOptions& options = job.options;
  Encoding encoding{std::move(model), {}, {}, surface.methods, 0};
  encoding.placing =
      placing_of(options, job.mesh, std::all_of(surface.methods.begin(), surface.methods.end(), is_height_field));
  const TexelPlacing& placing = encoding.placing;
  encoding.used_fraction = lay_out_patches(
      surface, row_profiles(job.context, encoding.model.skeleton, job.separation, surface, options.spd_hit), options,
      encoding.model);
  encoding.model.diagonals =
      options.diagonals.value_or(placing.is_regular_grid() ? DiagonalRule::kNearest : DiagonalRule::kSmooth);
  add_seams(surface.segmentation, job.separation, placing.has_snap ? SeamSampling::kSnapped : SeamSampling::kEven,
            encoding.model);
  TexelResult texels = read_model_texels(job, encoding.model, surface, placing);
  encoding.model.texture = std::move(texels.texture);
  encoding.model.sampling = {options.has_prefilter, placing.has_snap, placing.is_fitted()};
  encoding.texels = std::move(texels.report);
  return encoding;
}

/// How far the model is from the input and the input from the model, per bone.
struct BothDistances {
  std::vector<BoneDistance> from, to;
  double mean = 0, furthest = 0;  ///< of all bones; the mean by area

  double mean_of(std::size_t bone) const { return from[bone].mean + to[bone].mean; }
  double furthest_of(std::size_t bone) const { return std::max(from[bone].furthest, to[bone].furthest); }
};
BothDistances measure_both(const EncodeJob& job, const SkeletexModel& model, const MappedSurface& surface) {
  const PreparedModel prepared(model);
  const TriangleMesh mesh = reconstruct_bind_mesh(job.context, prepared).mesh;
  BothDistances both{distances_from_bones(job.context, surface.charts, mesh, build_triangle_tree(mesh), 0),
                     distances_to_surface(job.context, model, prepared.lattice, mesh, job.mesh, job.tree)};
  double total = 0;
  for (std::size_t bone = 0; bone < both.from.size(); ++bone) {
    const double area = surface_area(surface.segmentation.segments[bone].mesh);
    both.mean += area * both.mean_of(bone), total += area;
    both.furthest = std::max(both.furthest, both.furthest_of(bone));
  }
  both.mean /= total;
  return both;
}

/// Each bone takes SPD where its rays see enough, and the result is hardly further from the input than that of VSM,
/// which is measured with models of either. The better of these is taken if the mixed model is a tenth worse.
/// \param surface  mapped by VSM; the methods are those of the result then
Encoding encode_hybrid(const EncodeJob& job, const SkeletexModel& start, MappedSurface& surface) {
  const EncodeOptions& options = job.options;
  const std::size_t count = surface.methods.size();
  Encoding by_vsm = encode_surface(job, start, surface);
  surface.methods.assign(count, Method::kSpd);
  Encoding by_spd = encode_surface(job, start, surface);
  const BothDistances vsm = measure_both(job, by_vsm.model, surface), spd = measure_both(job, by_spd.model, surface);
  for (std::size_t bone = 0; bone < count; ++bone)
    surface.methods[bone] = surface.unseen[bone] <= options.hybrid_unseen_threshold &&
                                    spd.mean_of(bone) <= kHardlyWorse * vsm.mean_of(bone) &&
                                    spd.furthest_of(bone) <= kHardlyWorse * vsm.furthest_of(bone)
                                ? Method::kSpd
                                : Method::kVsm;
  for (const auto& [name, method] : options.hybrid_overrides)
    surface.methods[find_bone(start.skeleton, name).value()] = method;
  if (surface.methods == by_vsm.methods && spd.mean >= vsm.mean) return by_vsm;
  if (surface.methods == by_spd.methods) return by_spd;
  Encoding mixed = encode_surface(job, start, surface);
  if (!options.hybrid_overrides.empty()) return mixed;
  const bool is_spd_better = spd.mean < vsm.mean;
  Encoding& pure = is_spd_better ? by_spd : by_vsm;
  if (measure_both(job, mixed.model, surface).mean <= kHardlyWorse * (is_spd_better ? spd : vsm).mean) return mixed;
  surface.methods = pure.methods;
  return std::move(pure);
}

void report_result(const EncodeJob& job, const Encoding& encoding, const MappedSurface& surface, EncodeReport& report) {
  const SkeletexModel& model = encoding.model;
  const TexelReport& texels = encoding.texels;
  report.genus = model.genus;
  report.diagonal = model.diagonal;
  report.scale = model.skeleton.frame.scale;
  report.used_fraction = encoding.used_fraction;
  report.placing = encoding.placing;
  report.unfold = texels.unfold;
  report.snap = texels.snap;
  report.fit = texels.fit;
  report.rounding = texels.rounding;
  report.revert = texels.revert;
  const bool has_heights = std::any_of(encoding.methods.begin(), encoding.methods.end(), is_height_field);
  std::vector<BoneDistance> distances, excess;
  if (texels.revert) distances = texels.revert->distances;
  if (!texels.revert || has_heights) {
    const PreparedModel prepared(model);
    const TriangleMesh decoded = reconstruct_bind_mesh(job.context, prepared).mesh;
    if (!texels.revert)
      distances = distances_from_bones(job.context, surface.charts, decoded, build_triangle_tree(decoded),
                                       kNearEnough * model.diagonal);
    if (has_heights) excess = distances_to_surface(job.context, model, prepared.lattice, decoded, job.mesh, job.tree);
  }
  for (std::size_t bone = 0; bone < model.patches.size(); ++bone) {
    const Segment& segment = surface.segmentation.segments[bone];
    BoneReport entry;
    entry.name = model.skeleton.bones[bone].name;
    entry.method = encoding.methods[bone];
    entry.topology = segment.topology;
    entry.area = surface_area(segment.mesh) * model.skeleton.frame.scale * model.skeleton.frame.scale;
    entry.vertices = static_cast<int>(segment.mesh.positions.size());
    entry.triangles = static_cast<int>(segment.mesh.triangles.size());
    entry.rectangle = model.patches[bone].rectangle;
    entry.unseen_area_fraction = surface.unseen[bone];
    entry.flipped_triangles = surface.reports[bone].flipped_triangles;
    entry.sampled_triangle_fraction = texels.sampled_triangle_fractions[bone];
    entry.missed_texels = texels.missed_texels[bone];
    entry.distance = distances[bone];
    entry.distance.place = model.skeleton.frame.to_user(distances[bone].place);
    if (is_height_field(entry.method)) {
      entry.excess = excess[bone];
      entry.excess.place = model.skeleton.frame.to_user(excess[bone].place);
    }
    entry.map = surface.reports[bone];
    report.bones.push_back(std::move(entry));
  }
}

}  // namespace

EncodeResult encode_model(ClContext& context, const TriangleMesh& input, const Skeleton& skeleton,
                          const EncodeOptions& options) {
  check_options(options, skeleton);
  check_size(skeleton.nodes.size(), skeleton.bones.size());
  if (options.tree && options.tree->order.size() != input.triangles.size())
    throw InputError(fmt::format("the tree is of {} triangles, the mesh has {}; give the mesh's own, or none",
                                 options.tree->order.size(), input.triangles.size()));
  require_memory(estimated_bytes(options, input), fmt::format("encoding {} triangles to {} x {} texels",
                                                              input.triangles.size(), options.width, options.height));
  const auto progress = [&](const char* stage, double done) {
    if (options.progress && !options.progress(stage, done)) throw Error("cancelled");
  };
  EncodeReport report;
  const SkeletexModel model = start_model(input, skeleton);
  const SeparationPlanes separation(model.skeleton);  // refers to it
  Stopwatch watch;

  progress("half edges", 0);
  const double texel_area = surface_area(input) / (static_cast<double>(options.width) * options.height);
  const double longest_edge = kLongestEdge * std::sqrt(texel_area), least_area = kLeastSplitArea * texel_area;
  std::optional<TriangleMesh> split;
  if (share_to_split(input, longest_edge, least_area) >= kLeastSplitShare)
    split = split_long_edges(input, longest_edge, least_area);
  const TriangleMesh& mesh = split ? *split : input;
  report.vertices = static_cast<int>(input.positions.size());
  report.triangles = static_cast<int>(input.triangles.size());
  if (split) report.split_triangles = static_cast<int>(split->triangles.size());
  CutMesh half_edges = cut_mesh_of(mesh);
  report.half_edge_ms = watch.lap_ms();
  progress("segmentation", 0.05);
  Segmentation segmentation = segment_mesh(context, std::move(half_edges), model.skeleton);
  report.segmentation_ms = watch.lap_ms();
  progress("parameterization", 0.2);
  MappedSurface surface =
      map_surface(context, std::move(segmentation),
                  std::vector<Method>(skeleton.bones.size(), options.method.value_or(Method::kVsm)), model.skeleton,
                  separation, {options.vsm, options.reweights_squeezed, options.row_spacing == RowSpacing::kUniform});
  report.parameterization_ms = watch.lap_ms();

  progress("encoding", 0.6);
  std::optional<TriangleTree> own_tree, split_tree;
  if (!options.tree) own_tree = build_triangle_tree(input);
  if (split) split_tree = build_triangle_tree(*split);
  const TriangleTree& input_tree = own_tree ? *own_tree : *options.tree;
  const EncodeJob job{context, mesh, split_tree ? *split_tree : input_tree, separation, options};
  Encoding encoding = options.method ? encode_surface(job, model, surface) : encode_hybrid(job, model, surface);
  nlohmann::json settings = settings_json(options, encoding.placing, surface.unseen);
  add_results(encoding.texels, encoding.model.diagonal, settings);
  encoding.model.encoder_settings = settings.dump();
  report.encoding_ms = watch.lap_ms();

  encoding.model.stance = options.stance;
  const MeshAttributes none;
  const MeshAttributes& attributes = options.attributes ? *options.attributes : none;
  if (has_layers(attributes, options.layers)) {
    progress("layers", 0.95);
    ReadLayers layers = read_layers(context, encoding.model, input, input_tree, attributes, options.layers);
    encoding.model.layers = std::move(layers.layers);
    report.layer_notes = std::move(layers.notes);
    report.layers_ms = watch.lap_ms();
  }
  report.device = context.device().name;
  report_result(job, encoding, surface, report);
  progress("done", 1);
  return {std::move(encoding.model), std::move(report)};
}

}  // namespace skeletex
