// SPDX-License-Identifier: MIT
#include "encode_report.h"

#include <fmt/format.h>

#include <filesystem>

#include "table.h"

namespace skeletex::cli {
namespace {

Json distance_json(const BoneDistance& distance, double diagonal) {
  return {{"mean", distance.mean / diagonal},
          {"furthest", distance.furthest / diagonal},
          {"place", {distance.place[0], distance.place[1], distance.place[2]}}};
}

Json bone_json(const BoneReport& bone, double diagonal) {
  const Rectangle& r = bone.rectangle;
  Json json{{"name", bone.name},
            {"method", to_string(bone.method)},
            {"topology", to_string(bone.topology)},
            {"area", bone.area},
            {"vertices", bone.vertices},
            {"triangles", bone.triangles},
            {"rectangle", {r.x, r.y, r.width, r.height}},
            {"unseen_area_fraction", bone.unseen_area_fraction},
            {"flipped_triangles", bone.flipped_triangles},
            {"sampled_triangle_fraction", bone.sampled_triangle_fraction},
            {"missed_texels", bone.missed_texels},
            {"distance", distance_json(bone.distance, diagonal)}};
  if (is_height_field(bone.method))
    json["excess"] = distance_json(bone.excess, diagonal);
  else
    json[to_string(bone.method)] = {{"iterations", bone.map.iterations},
                                    {"spread", bone.map.spread},
                                    {"solver_steps", bone.map.solver_steps},
                                    {"residual", bone.map.residual},
                                    {"used_direct_solver", bone.map.used_direct_solver}};
  return json;
}

double percent(int part, int whole) { return whole > 0 ? 100.0 * part / whole : 100.0; }

/// Share of all triangles that texels read, in percent.
double read_percent(const EncodeReport& report) {
  double read = 0, all = 0;
  for (const BoneReport& bone : report.bones) {
    read += bone.sampled_triangle_fraction * bone.triangles;
    all += bone.triangles;
  }
  return all > 0 ? 100 * read / all : 100;
}

/// What was chosen for the texels, and why.
std::string placing_text(const TexelPlacing& placing) {
  if (placing.texels_per_vertex == 0) return "texels: where the rays from the bones meet the mesh\n";
  const char* const what = placing.has_snap      ? placing.is_fitted() ? "snapped and fitted" : "snapped"
                           : placing.is_fitted() ? "fitted"
                                                 : "on a regular grid";
  return fmt::format("texels: {}, as there are {:.1f} per vertex; expected error {:.2g} of a regular grid's\n", what,
                     placing.texels_per_vertex, placing.expected_error);
}

}  // namespace

Json encode_report_json(const EncodeReport& report, const EncodedFile& file) {
  Json bones = Json::array();
  for (const BoneReport& bone : report.bones) bones.push_back(bone_json(bone, report.diagonal));
  Json json{{"mesh",
             {{"vertices", report.vertices},
              {"triangles", report.triangles},
              {"split_triangles", report.split_triangles},
              {"diagonal", report.scale * report.diagonal},
              {"genus", report.genus}}},
            {"bones", std::move(bones)},
            {"placing",
             {{"snapped", report.placing.has_snap},
              {"fit_steps", report.placing.fit_steps},
              {"texels_per_vertex", report.placing.texels_per_vertex},
              {"expected_error", report.placing.expected_error}}},
            {"atlas", {{"size", {file.width, file.height}}, {"used_fraction", report.used_fraction}}},
            {"times_ms",
             {{"half_edge", report.half_edge_ms},
              {"segmentation", report.segmentation_ms},
              {"parameterization", report.parameterization_ms},
              {"encoding", report.encoding_ms},
              {"layers", report.layers_ms}}},
            {"seconds", file.seconds},
            {"device", report.device}};
  if (report.unfold) json["lattice"] = {{"folded_quads", report.unfold->folded_quads}, {"left", report.unfold->left}};
  if (report.snap)
    json["snap"] = {{"vertices", report.snap->vertices},
                    {"snapped_vertices", report.snap->snapped_vertices},
                    {"edges", report.snap->edges},
                    {"snapped_edges", report.snap->snapped_edges},
                    {"texels_on_edges", report.snap->texels_on_edges},
                    {"texels_reverted", report.snap->reverted_texels}};
  if (report.fit) {
    Json residuals = Json::array();
    for (const double residual : report.fit->residuals) residuals.push_back(residual / report.diagonal);
    json["fit"] = {{"residuals", std::move(residuals)}, {"texels_reverted", report.fit->reverted_texels}};
  }
  if (report.rounding)
    json["rounding"] = {{"nearest", report.rounding->nearest / report.diagonal},
                        {"chosen", report.rounding->chosen / report.diagonal}};
  if (report.revert)
    json["inverted_triangles"] = {{"lattice", report.revert->inverted_triangles},
                                  {"regular", report.revert->regular_inverted_triangles}};
  return json;
}

std::string encode_report_text(const EncodeReport& report, const EncodedFile& file) {
  std::error_code ignored;
  std::string text = fmt::format("{}: {} x {} texels, {:.1f} MiB, {:.1f} s on {}\n", file.path, file.width, file.height,
                                 static_cast<double>(std::filesystem::file_size(file.path, ignored)) / (1 << 20),
                                 file.seconds, report.device);
  text += fmt::format(
      "mesh: {} vertices, {} triangles{}, genus {}; texels lie in {:.0f} % of the triangles", report.vertices,
      report.triangles,
      report.split_triangles > 0 ? fmt::format(" (split into {}, as some are large)", report.split_triangles) : "",
      report.genus, read_percent(report));
  if (report.snap)
    text +=
        fmt::format(" and on {:.1f} % of the vertices", percent(report.snap->snapped_vertices, report.snap->vertices));
  text += '\n' + placing_text(report.placing);
  if (report.fit && !report.fit->residuals.empty())
    text +=
        fmt::format("mean distance to the mesh: {:.1e} diagonals\n", report.fit->residuals.back() / report.diagonal);
  if (report.rounding)
    text += fmt::format("error of the half floats: {:.1e} diagonals\n", report.rounding->chosen / report.diagonal);
  if (report.revert && report.revert->inverted_triangles > 0)
    text += fmt::format("inverted triangles: {} of {}\n", report.revert->inverted_triangles, report.revert->triangles);
  return text;
}

std::string encode_details_text(const EncodeReport& report) {
  Table table({"bone", "method", "surface", "triangles", "texels", "columns x rows", "unseen %", "read %"});
  for (const BoneReport& bone : report.bones) {
    const Rectangle& r = bone.rectangle;
    table.add({bone.name, to_string(bone.method), to_string(bone.topology), fmt::format("{}", bone.triangles),
               fmt::format("{}", r.width * r.height), fmt::format("{} x {}", r.width, r.height),
               fmt::format("{:.1f}", 100 * bone.unseen_area_fraction),
               fmt::format("{:.0f}", 100 * bone.sampled_triangle_fraction)});
  }
  std::string text = table.text() + fmt::format("\n{:.1f} % of the texture is used\n", 100 * report.used_fraction);
  if (report.snap)
    text += fmt::format("snapped to {:.1f} % of {} vertices and {:.1f} % of {} edges; {} texels reverted\n",
                        percent(report.snap->snapped_vertices, report.snap->vertices), report.snap->vertices,
                        percent(report.snap->snapped_edges, report.snap->edges), report.snap->edges,
                        report.snap->reverted_texels);
  if (report.fit) {
    text += "fitted: mean distance / diagonal";
    for (std::size_t i = 0; i < report.fit->residuals.size(); ++i)
      text += fmt::format("{} {:.3e}", i == 0 ? "" : " ->", report.fit->residuals[i] / report.diagonal);
    text += fmt::format("; {} texels reverted\n", report.fit->reverted_texels);
  }
  if (report.rounding)
    text += fmt::format(
        "half floats: {:.1e} of the diagonal off the triangles, the nearest ones {:.1e} (root mean squares)\n",
        report.rounding->chosen / report.diagonal, report.rounding->nearest / report.diagonal);
  if (report.revert)
    text += fmt::format("{} inverted triangles, {} on the regular grid\n", report.revert->inverted_triangles,
                        report.revert->regular_inverted_triangles);
  return text +
         fmt::format(
             "half edges {:.0f} ms, segmentation {:.0f} ms, parameterization {:.0f} ms, encoding {:.0f} ms, layers "
             "{:.0f} ms\n",
             report.half_edge_ms, report.segmentation_ms, report.parameterization_ms, report.encoding_ms,
             report.layers_ms);
}

}  // namespace skeletex::cli
