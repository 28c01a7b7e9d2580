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
#include "skeletex/convert/sample/sample_seams.h"
#include "skeletex/convert/segment/segment_mesh.h"
#include "skeletex/device/stopwatch.h"
#include "skeletex/geometry/parallel.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

// With fewer, vertices pull texels about without making edges between them; the fit makes up for some of that.
constexpr double kSnapTexelsPerVertex = 2, kFittedSnapTexelsPerVertex = 1.5;
constexpr double kLeastDihedral = 0.004;  // radians: flatter edges are no creases to snap to

void check_options(const EncodeOptions& options, const Skeleton& skeleton) {
  if (options.vsm.iterations < 0 || options.vsm.iterations > 100)
    throw InputError(fmt::format("{} VSM iterations; give 0 to 100", options.vsm.iterations));
  if (!(options.vsm.alpha >= 0 && options.vsm.alpha <= 1))
    throw InputError(fmt::format("VSM alpha is {}; give 0 to 1", options.vsm.alpha));
  if (!(options.hybrid_unseen_threshold >= 0))
    throw InputError("the hybrid threshold is negative; give a share of area, such as 0.01");
  for (const auto& override : options.hybrid_overrides)
    if (std::none_of(skeleton.bones.begin(), skeleton.bones.end(),
                     [&](const Bone& bone) { return bone.name == override.first; }))
      throw InputError(
          fmt::format("a method is given for bone \"{}\", which the skeleton does not have", override.first));
}

std::vector<Method> choose_methods(const EncodeOptions& options, const Skeleton& skeleton,
                                   std::span<const double> unseen) {
  std::vector<Method> methods(skeleton.bones.size(), options.method.value_or(Method::kVsm));
  if (options.method) return methods;
  for (std::size_t bone = 0; bone < methods.size(); ++bone)
    methods[bone] = unseen[bone] > options.hybrid_unseen_threshold ? Method::kVsm : Method::kSpd;
  for (const auto& [name, method] : options.hybrid_overrides)
    for (std::size_t bone = 0; bone < methods.size(); ++bone)
      if (skeleton.bones[bone].name == name) methods[bone] = method;
  return methods;
}

/// Where texels read, and where their points lie.
struct TexelPlacing {
  bool has_snap = false, has_fit = false;
};
/// SPD patches are neither snapped nor fitted.
TexelPlacing choose_placing(const EncodeOptions& options, const TriangleMesh& mesh, bool is_all_spd) {
  if (is_all_spd) return {};
  const auto texels = static_cast<std::size_t>(options.width) * static_cast<std::size_t>(options.height);
  const bool has_fit = options.has_fit.value_or(options.has_prefilter && texels <= kMostFittedTexels);
  const double least_texels =
      (has_fit ? kFittedSnapTexelsPerVertex : kSnapTexelsPerVertex) * static_cast<double>(mesh.positions.size());
  return {options.has_snap.value_or(static_cast<double>(texels) >= least_texels), has_fit};
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
                      {"fit", placing.has_fit},
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

/// The model as it is before its surface is mapped: frame, genus, and the skeleton with its angles of 0.
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
                    "needs {:g} to {:g}: scale mesh and skeleton",
                    model.diagonal, kSmallestDiagonal, kLargestDiagonal));
  // Euler's formula for a closed triangle mesh: edges are 3/2 of the triangles.
  model.genus = (2 - (static_cast<int>(mesh.positions.size()) - static_cast<int>(mesh.triangles.size()) / 2)) / 2;
  return model;
}

/// The surface by bones, and its maps.
struct MappedSurface {
  Segmentation segmentation;
  std::vector<Chart> charts;
  std::vector<double> unseen;  ///< share of each bone's area that its rays do not see
  std::vector<Method> methods;
  std::vector<MapReport> reports;
};

MappedSurface map_surface(ClContext& context, Segmentation segmentation, const Skeleton& skeleton,
                          const SeparationPlanes& separation, const EncodeOptions& options) {
  MappedSurface surface{std::move(segmentation), {}, {}, {}, {}};
  surface.charts.resize(skeleton.bones.size());
  for_each_block(surface.charts.size(), 1, [&](std::size_t i, std::size_t, std::size_t) {
    surface.charts[i] = make_chart(surface.segmentation.segments[i], skeleton, separation);
  });
  surface.unseen = unseen_area_fractions(context, skeleton, separation, surface.charts);
  surface.methods = choose_methods(options, skeleton, surface.unseen);
  surface.reports = map_charts(context, surface.methods, surface.charts, {options.vsm});
  return surface;
}

std::vector<RowProfile> row_profiles(ClContext& context, const Skeleton& skeleton, const SeparationPlanes& separation,
                                     const MappedSurface& surface, SpdHit hit) {
  std::vector<RowProfile> profiles(surface.charts.size());
  if (std::any_of(surface.methods.begin(), surface.methods.end(), is_height_field))
    profiles = ray_profiles(context, skeleton, separation, surface.charts, hit);
  for_each_block(profiles.size(), 1, [&](std::size_t i, std::size_t, std::size_t) {
    if (!is_height_field(surface.methods[i])) profiles[i] = row_profile(surface.charts[i]);
  });
  return profiles;
}

/// Shares texels out by detail, to rectangles with sides in the ratio of girth to length, and spreads their rows.
/// \return the used share of the texture
double lay_out_patches(const MappedSurface& surface, std::span<const RowProfile> profiles, const EncodeOptions& options,
                       SkeletexModel& model) {
  const std::vector<Segment>& segments = surface.segmentation.segments;
  std::vector<PatchSource> sources;
  for (std::size_t bone = 0; bone < segments.size(); ++bone)
    sources.push_back({is_height_field(surface.methods[bone]) ? nullptr : &surface.charts[bone],
                       static_cast<double>(segments[bone].mesh.triangles.size()), surface_area(segments[bone].mesh),
                       std::max(profiles[bone].length, 1e-9 * model.diagonal)});
  const bool has_uniform_rows = options.row_spacing == RowSpacing::kUniform;
  const bool has_maps = !std::all_of(surface.methods.begin(), surface.methods.end(), is_height_field);
  const AtlasLayout layout =
      pack_atlas(patch_requests(sources, has_uniform_rows ? std::span<const RowProfile>() : profiles,
                                options.texel_share.value_or(has_maps ? TexelShare::kError : TexelShare::kArea)),
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
  for (int bone = 0; bone < static_cast<int>(model.patches.size()); ++bone)
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

/// Reads the texels of a model that is laid out.
/// \param tree  of the mesh, with snapping or fit
TexelResult read_model_texels(ClContext& context, const SkeletexModel& model, const SeparationPlanes& separation,
                              const TriangleMesh& mesh, const TriangleTree* tree, const MappedSurface& surface,
                              const TexelPlacing& placing, const EncodeOptions& options) {
  std::optional<DeviceSnapTables> features;
  if (placing.has_snap)
    features =
        upload_tables(context, tables_of(place_features(find_features(surface.charts, surface.methods, kLeastDihedral),
                                                        surface.charts, model.patches),
                                         model.patches));
  const std::vector<SpdHits> hits = cast_rays(context, model, separation, surface.charts, options.spd_hit);
  const auto end_points = find_end_points(model, separation, surface);
  std::optional<RevertSources> revert;
  if (placing.has_snap || placing.has_fit) revert.emplace(RevertSources{model, mesh, *tree, surface.charts});
  TexelOptions texel_options{
      .has_prefilter = options.has_prefilter, .has_unfold = options.has_unfold, .has_fit = placing.has_fit};
  if (options.has_half_texels) texel_options.half_rule = model.diagonals;
  return read_texels(
      context, model.skeleton, separation,
      {surface.charts, model.patches, hits, end_points, revert ? &*revert : nullptr, features ? &*features : nullptr},
      options.width, options.height, model.origin, texel_options);
}

void report_result(const SkeletexModel& model, const TriangleMesh& mesh, const MappedSurface& surface,
                   const TexelReport& texels, EncodeReport& report) {
  report.vertices = static_cast<int>(mesh.positions.size());
  report.triangles = static_cast<int>(mesh.triangles.size());
  report.genus = model.genus;
  report.diagonal = model.diagonal;
  report.unfold = texels.unfold;
  report.snap = texels.snap;
  report.fit = texels.fit;
  report.rounding = texels.rounding;
  report.revert = texels.revert;
  for (std::size_t bone = 0; bone < model.patches.size(); ++bone) {
    const Segment& segment = surface.segmentation.segments[bone];
    BoneReport entry;
    entry.name = model.skeleton.bones[bone].name;
    entry.method = surface.methods[bone];
    entry.topology = segment.topology;
    entry.area = surface_area(segment.mesh);
    entry.vertices = static_cast<int>(segment.mesh.positions.size());
    entry.triangles = static_cast<int>(segment.mesh.triangles.size());
    entry.rectangle = model.patches[bone].rectangle;
    entry.unseen_area_fraction = surface.unseen[bone];
    entry.flipped_triangles = surface.reports[bone].flipped_triangles;
    entry.sampled_triangle_fraction = texels.sampled_triangle_fractions[bone];
    entry.missed_texels = texels.missed_texels[bone];
    entry.map = surface.reports[bone];
    report.bones.push_back(std::move(entry));
  }
}

}  // namespace

EncodeResult encode_model(ClContext& context, const TriangleMesh& mesh, const Skeleton& skeleton,
                          const EncodeOptions& options) {
  check_options(options, skeleton);
  if (options.tree && options.tree->order.size() != mesh.triangles.size())
    throw InputError(fmt::format("the tree is of {} triangles, the mesh has {}; give the mesh's own, or none",
                                 options.tree->order.size(), mesh.triangles.size()));
  const auto progress = [&](const char* stage, double done) {
    if (options.progress && !options.progress(stage, done)) throw Error("cancelled");
  };
  EncodeResult result{start_model(mesh, skeleton), {}};
  EncodeReport& report = result.report;
  SkeletexModel& model = result.model;
  model.stance = options.stance;
  const SeparationPlanes separation(model.skeleton);
  Stopwatch watch;

  progress("half edges", 0);
  CutMesh half_edges = cut_mesh_of(mesh);
  report.half_edge_ms = watch.lap_ms();
  progress("segmentation", 0.05);
  Segmentation segmentation = segment_mesh(context, std::move(half_edges), model.skeleton);
  report.segmentation_ms = watch.lap_ms();
  progress("parameterization", 0.2);
  const MappedSurface surface = map_surface(context, std::move(segmentation), model.skeleton, separation, options);
  report.parameterization_ms = watch.lap_ms();

  progress("layout", 0.6);
  const TexelPlacing placing =
      choose_placing(options, mesh, std::all_of(surface.methods.begin(), surface.methods.end(), is_height_field));
  const bool is_placed = placing.has_snap || placing.has_fit;
  report.used_fraction = lay_out_patches(
      surface, row_profiles(context, model.skeleton, separation, surface, options.spd_hit), options, model);
  model.diagonals = options.diagonals.value_or(is_placed ? DiagonalRule::kSmooth : DiagonalRule::kNearest);
  add_seams(surface.segmentation, separation, placing.has_snap ? SeamSampling::kSnapped : SeamSampling::kEven, model);

  progress("encoding", 0.7);
  const MeshAttributes none;
  const MeshAttributes& attributes = options.attributes ? *options.attributes : none;
  std::optional<TriangleTree> own_tree;
  if (!options.tree && (is_placed || has_layers(attributes, options.layers))) own_tree = build_triangle_tree(mesh);
  const TriangleTree* const tree = own_tree ? &*own_tree : options.tree;
  TexelResult texels = read_model_texels(context, model, separation, mesh, tree, surface, placing, options);
  model.texture = std::move(texels.texture);
  model.sampling = {options.has_prefilter, placing.has_snap, placing.has_fit};
  nlohmann::json settings = settings_json(options, placing, surface.unseen);
  add_results(texels.report, model.diagonal, settings);
  model.encoder_settings = settings.dump();
  report.encoding_ms = watch.lap_ms();

  if (has_layers(attributes, options.layers)) {
    progress("layers", 0.95);
    ReadLayers layers = read_layers(context, model, mesh, *tree, attributes, options.layers);
    model.layers = std::move(layers.layers);
    report.layer_notes = std::move(layers.notes);
    report.layers_ms = watch.lap_ms();
  }
  report.device = context.device().name;
  report_result(model, mesh, surface, texels.report, report);
  progress("done", 1);
  return result;
}

}  // namespace skeletex
