// SPDX-License-Identifier: MIT
#include "skeletex/convert/encode_model.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "skeletex/convert/layout/pack_atlas.h"
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
  for (const auto& [name, method] : options.hybrid_overrides)
    if (std::none_of(skeleton.bones.begin(), skeleton.bones.end(), [&](const Bone& b) { return b.name == name; }))
      throw InputError(fmt::format("a method is given for bone \"{}\", which the skeleton does not have", name));
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

/// The rays' own points on an regular grid in u: how surface length grows along an SPD patch.
std::vector<RowProfile> spd_profiles(ClContext& context, const Skeleton& skeleton, const SeparationPlanes& separation,
                                     std::span<const Chart> charts, SpdHit hit) {
  constexpr int kRows = 257, kColumns = 64;
  std::vector<Patch> probes(charts.size());
  for (std::size_t i = 0; i < charts.size(); ++i) {
    probes[i].rectangle = {0, 0, kColumns, kRows};
    probes[i].row_u = spread_rows_uniformly(kRows);
  }
  const std::vector<SpdHits> hits = cast_spd_rays(context, skeleton, separation, charts, probes, hit);
  std::vector<RowProfile> profiles;
  for (std::size_t i = 0; i < charts.size(); ++i) {
    std::vector<Vec3> points(static_cast<std::size_t>(kRows) * kColumns);
    for (int j = 0; j < kColumns; ++j) {
      // A ray that misses repeats the point before it, and adds no length.
      int last_hit = -1;
      for (int r = 0; r < kRows; ++r) {
        const std::size_t at = static_cast<std::size_t>(r) * kColumns + j;
        if (hits[i].triangles[at] >= 0) {
          const TangentFrame frame = tangent_frame(skeleton, separation, charts[i].bone, probes[i].row_u[r],
                                                   static_cast<double>(j) / kColumns);
          points[at] = frame.foot + static_cast<double>(hits[i].distances[at]) * frame.out;
          for (int q = last_hit < 0 ? 0 : r; q < r; ++q)
            points[static_cast<std::size_t>(q) * kColumns + j] = points[at];
          last_hit = r;
        } else if (last_hit >= 0) {
          points[at] = points[static_cast<std::size_t>(last_hit) * kColumns + j];
        }
      }
    }
    profiles.push_back(row_profile(points, kRows, kColumns));
  }
  return profiles;
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

}  // namespace

EncodeResult encode_model(ClContext& context, const TriangleMesh& mesh, const Skeleton& input_skeleton,
                          const EncodeOptions& options) {
  check_options(options, input_skeleton);
  if (options.tree && options.tree->order.size() != mesh.triangles.size())
    throw InputError(fmt::format("the tree is of {} triangles, the mesh has {}; give the mesh's own, or none",
                                 options.tree->order.size(), mesh.triangles.size()));
  const auto progress = [&](const char* stage, double done) {
    if (options.progress && !options.progress(stage, done)) throw Error("cancelled");
  };
  EncodeResult result;
  EncodeReport& report = result.report;
  SkeletexModel& model = result.model;
  const int bones = static_cast<int>(input_skeleton.bones.size());

  // The model's skeleton carries its angles of 0 with it.
  model.skeleton = input_skeleton;
  {
    const std::vector<BoneBasis> bases = bone_bases(model.skeleton);
    for (int bone = 0; bone < bones; ++bone) model.skeleton.bones[bone].s = bases[bone].s;
  }
  const Skeleton& skeleton = model.skeleton;
  const SeparationPlanes separation(skeleton);
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

  Stopwatch watch;
  progress("half edges", 0);
  CutMesh half_edges = cut_mesh_of(mesh);
  report.half_edge_ms = watch.lap_ms();
  progress("segmentation", 0.05);
  const Segmentation segmentation = segment_mesh(context, std::move(half_edges), skeleton);
  report.segmentation_ms = watch.lap_ms();

  progress("parameterization", 0.2);
  std::vector<Chart> charts(bones);
  for_each_block(charts.size(), 1, [&](std::size_t i, std::size_t, std::size_t) {
    charts[i] = make_chart(segmentation.segments[i], skeleton, separation);
  });
  const std::vector<double> unseen = unseen_area_fractions(context, skeleton, separation, charts);
  const std::vector<Method> methods = choose_methods(options, skeleton, unseen);
  const std::vector<MapReport> map_reports = map_charts(context, methods, charts, {options.vsm});
  report.parameterization_ms = watch.lap_ms();

  progress("encoding", 0.6);
  // Texels are shared out by detail; rectangles have the sides' ratio of girth to length.
  const std::vector<RowProfile> rays = std::any_of(methods.begin(), methods.end(), is_height_field)
                                           ? spd_profiles(context, skeleton, separation, charts, options.spd_hit)
                                           : std::vector<RowProfile>(bones);
  const bool is_all_spd = std::all_of(methods.begin(), methods.end(), is_height_field);
  std::vector<RowProfile> profiles(bones);
  for_each_block(profiles.size(), 1, [&](std::size_t i, std::size_t, std::size_t) {
    profiles[i] = is_height_field(methods[i]) ? rays[i] : row_profile(charts[i]);
  });
  std::vector<PatchSource> sources;
  std::vector<double> areas;
  for (int bone = 0; bone < bones; ++bone) {
    const TriangleMesh& part = segmentation.segments[bone].mesh;
    areas.push_back(surface_area(part));
    sources.push_back({is_height_field(methods[bone]) ? nullptr : &charts[bone],
                       static_cast<double>(part.triangles.size()), areas[bone],
                       std::max(profiles[bone].length, 1e-9 * model.diagonal)});
  }
  const bool has_even_rows = options.row_spacing == RowSpacing::kUniform;
  const std::vector<PatchRequest> requests =
      patch_requests(sources, has_even_rows ? std::span<const RowProfile>() : profiles,
                     options.texel_share.value_or(is_all_spd ? TexelShare::kArea : TexelShare::kError));
  const TexelPlacing placing = choose_placing(options, mesh, is_all_spd);
  const AtlasLayout layout = pack_atlas(requests, options.width, options.height);
  report.used_fraction = layout.used_fraction;

  for (int bone = 0; bone < bones; ++bone) {
    Patch patch{layout.rectangles[bone], methods[bone], segmentation.segments[bone].topology, {}};
    patch.row_u = options.row_spacing == RowSpacing::kSurfaceLength
                      ? spread_rows_by_length(profiles[bone], patch.rectangle.height)
                      : spread_rows_uniformly(patch.rectangle.height);
    model.patches.push_back(std::move(patch));
  }
  std::optional<DeviceSnapTables> features;
  if (placing.has_snap)
    features = upload_tables(
        context, tables_of(place_features(find_features(charts, methods, kLeastDihedral), charts, model.patches),
                           model.patches));
  model.diagonals =
      options.diagonals.value_or(placing.has_snap || placing.has_fit ? DiagonalRule::kSmooth : DiagonalRule::kNearest);
  Seams seams = sample_seams(segmentation, skeleton, separation, layout.rectangles,
                             placing.has_snap ? SeamSampling::kSnapped : SeamSampling::kEven);
  model.arcs = std::move(seams.arcs);
  model.corners = std::move(seams.corners);
  model.ends = std::move(seams.ends);
  model.texture.width = options.width, model.texture.height = options.height;
  std::vector<SpdHits> hits(bones);
  {
    std::vector<Chart> cast_charts;
    std::vector<Patch> cast_patches;
    for (int bone = 0; bone < bones; ++bone)
      if (is_height_field(methods[bone])) {
        cast_charts.push_back(charts[bone]);
        cast_patches.push_back(model.patches[bone]);
      }
    std::vector<SpdHits> cast =
        cast_charts.empty() ? std::vector<SpdHits>{}
                            : cast_spd_rays(context, skeleton, separation, cast_charts, cast_patches, options.spd_hit);
    for (int bone = 0, i = 0; bone < bones; ++bone)
      if (is_height_field(methods[bone])) hits[bone] = std::move(cast[i++]);
  }
  std::vector<std::array<std::vector<Vec3>, 2>> end_points(bones);
  for (int bone = 0; bone < bones; ++bone)
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) {
      auto& points = end_points[bone][static_cast<int>(end)];
      if (separation.is_free(bone, end))
        points = {charts[bone].positions[pole_of(
            charts[bone], end == BoneEnd::kHead ? ChartVertex::kHeadPole : ChartVertex::kTailPole)]};
      else
        points =
            points_on_loop(segmentation.segments[bone], skeleton, separation, end, model.patches[bone].rectangle.width);
    }
  progress("encoding", 0.8);
  std::optional<TriangleTree> own_tree;
  if ((placing.has_snap || placing.has_fit) && !options.tree) own_tree = build_triangle_tree(mesh);
  std::optional<RevertSources> revert;
  if (placing.has_snap || placing.has_fit)
    revert.emplace(RevertSources{model, mesh, options.tree ? *options.tree : *own_tree, charts});
  TexelOptions texel_options{
      .has_prefilter = options.has_prefilter, .has_unfold = options.has_unfold, .has_fit = placing.has_fit};
  if (options.has_half_texels) texel_options.half_rule = model.diagonals;
  TexelResult texels = read_texels(
      context, skeleton, separation,
      {charts, model.patches, hits, end_points, revert ? &*revert : nullptr, features ? &*features : nullptr},
      options.width, options.height, model.origin, texel_options);
  model.texture = std::move(texels.texture);
  model.sampling = {options.has_prefilter, placing.has_snap, placing.has_fit};
  {
    nlohmann::json settings = settings_json(options, placing, unseen);
    add_results(texels.report, model.diagonal, settings);
    model.encoder_settings = settings.dump();
  }
  report.encoding_ms = watch.lap_ms();

  report.vertices = static_cast<int>(mesh.positions.size());
  report.triangles = static_cast<int>(mesh.triangles.size());
  report.genus = model.genus;
  report.diagonal = model.diagonal;
  report.unfold = texels.report.unfold;
  report.snap = texels.report.snap;
  report.fit = texels.report.fit;
  report.rounding = texels.report.rounding;
  report.revert = texels.report.revert;
  report.device = context.device().name;
  for (int bone = 0; bone < bones; ++bone) {
    const Segment& segment = segmentation.segments[bone];
    BoneReport entry;
    entry.name = skeleton.bones[bone].name;
    entry.method = methods[bone];
    entry.topology = segment.topology;
    entry.area = areas[bone];
    entry.vertices = static_cast<int>(segment.mesh.positions.size());
    entry.triangles = static_cast<int>(segment.mesh.triangles.size());
    entry.rectangle = layout.rectangles[bone];
    entry.unseen_area_fraction = unseen[bone];
    entry.flipped_triangles = map_reports[bone].flipped_triangles;
    entry.sampled_triangle_fraction = texels.report.sampled_triangle_fractions[bone];
    entry.missed_texels = texels.report.missed_texels[bone];
    entry.map = map_reports[bone];
    report.bones.push_back(std::move(entry));
  }
  progress("done", 1);
  return result;
}

}  // namespace skeletex
