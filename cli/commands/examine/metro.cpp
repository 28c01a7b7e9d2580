// SPDX-License-Identifier: MIT
#include "skeletex/analysis/metro.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <memory>

#include "command.h"
#include "files.h"
#include "progress_bar.h"
#include "skeletex/convert/resample/resample.h"
#include "skeletex/io/atomic_file.h"
#include "skeletex/io/mesh_file.h"
#include "skeletex/io/model_file.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/layers/layer_values.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/render/colours.h"
#include "table.h"

namespace skeletex::cli {
namespace {

struct Arguments {
  std::string a, b, device, json, csv, ply;
  long samples = 0;
  int size = 0;
  double ply_max = 0;
};

Json statistics_json(const DistanceStatistics& s) {
  return {{"mean", s.mean}, {"std", s.std}, {"rms", s.rms}, {"max", s.max}};
}

/// A surface with its own normals, where it has some.
struct Surface {
  TriangleMesh mesh;
  CornerValues<Vec3> normals;
};

/// A mesh as it stands in its file, or that of a model.
/// \param size  of a model's texture; 0: its own
Surface load_surface(ClContext& context, const std::string& path, int size) {
  if (is_model_path(path)) {
    SkeletexModel model = read_model(path);
    if (size > 0 && size != std::max(model.texture.width, model.texture.height))
      model = resample_model(context, model, size);
    const PreparedModel prepared(model);
    return {reconstruct_mesh(context, prepared), vertex_attributes(prepared).normals};
  }
  MeshFile file = load_mesh_file(path, false);
  if (file.mesh.triangles.empty()) throw InputError(path + ": no triangles, so there is no surface to measure from");
  return {std::move(file.mesh), std::move(file.attributes.normals)};
}

Json angles_json(const AngleStatistics& s) { return {{"mean", s.mean}, {"p95", s.percent95}, {"p99", s.percent99}}; }
Json normals_json(const NormalStatistics& s) {
  return {{"surface", angles_json(s.surface)}, {"shading", angles_json(s.shading)}};
}

std::string normals_text(const MetroReport& report) {
  Table table({"degrees between normals", "mean", "95 % below", "99 % below"});
  const auto add = [&table](const char* name, const AngleStatistics& s) {
    table.add(
        {name, fmt::format("{:.3f}", s.mean), fmt::format("{:.2f}", s.percent95), fmt::format("{:.2f}", s.percent99)});
  };
  add("surface, A to B", report.forward_normals.surface);
  add("surface, B to A", report.backward_normals.surface);
  add("shading, A to B", report.forward_normals.shading);
  add("shading, B to A", report.backward_normals.shading);
  return table.text();
}

void write_csv(const std::string& path, const TriangleMesh& mesh, const std::vector<float>& distances) {
  std::string text = "vertex,x,y,z,distance\n";
  for (std::size_t i = 0; i < distances.size(); ++i) {
    const Vec3& p = mesh.positions[i];
    fmt::format_to(std::back_inserter(text), "{},{},{},{},{}\n", i, p.x(), p.y(), p.z(), distances[i]);
  }
  write_text_atomically(path, text);
}

/// Upper end of the colour scale where the user gave none: what 99 of 100 vertices lie below.
double colour_scale(std::vector<float> distances) {
  if (distances.empty()) return 0;
  const auto at = distances.begin() + static_cast<std::ptrdiff_t>((distances.size() - 1) * 99 / 100);
  std::nth_element(distances.begin(), at, distances.end());
  return *at;
}

void write_coloured(const std::string& path, const TriangleMesh& mesh, const std::vector<float>& distances,
                    double scale) {
  std::vector<VertexColour> colours;
  for (const float distance : distances) colours.push_back(viridis(scale > 0 ? distance / scale : 0));
  WrittenAttributes attributes;
  attributes.vertex_colours = colours;
  attributes.vertex_numbers = {{"distance", distances}};
  write_mesh(path, mesh, attributes);
}

void run(const Arguments& arguments) {
  if (!arguments.ply.empty() && !has_ending(arguments.ply, ".ply"))
    throw CLI::ValidationError("--ply", "\"" + arguments.ply + "\" does not end in .ply");
  if (arguments.size > 0 && !is_model_path(arguments.a) && !is_model_path(arguments.b))
    throw CLI::ValidationError("--size", "is of models; neither A nor B is one (.skx.exr, .skx)");
  const auto own_normals = [](const Surface& surface) { return surface.normals.empty() ? nullptr : &surface.normals; };
  ClContext context(arguments.device);
  Surface surface_a, surface_b;
  MetroReport report;
  {
    ProgressBar bar(context);
    bar.show("reading", 0.1);
    surface_a = load_surface(context, arguments.a, arguments.size);
    surface_b = load_surface(context, arguments.b, arguments.size);
    bar.show("measuring", 0.3);
    report = measure_metro(
        context, surface_a.mesh, surface_b.mesh,
        {.samples = arguments.samples, .normals_a = own_normals(surface_a), .normals_b = own_normals(surface_b)});
  }
  if (std::min(report.forward_normals.surface.mean, report.backward_normals.surface.mean) > 90)
    warn(fmt::format("the normals of A and B point opposite ways: {} is inside out; reverse the order of its triangles",
                     signed_volume(surface_a.mesh) < 0 ? "A" : "B"));
  const TriangleMesh& a = surface_a.mesh;
  if (!arguments.csv.empty()) write_csv(arguments.csv, a, report.vertex_distances);
  const double scale =
      arguments.ply_max > 0 ? arguments.ply_max * report.diagonal : colour_scale(report.vertex_distances);
  if (!arguments.ply.empty()) write_coloured(arguments.ply, a, report.vertex_distances, scale);

  Table table({"divided by the diagonal", "mean", "std", "rms", "max"});
  const auto add = [&table](const char* name, const DistanceStatistics& s) {
    table.add({name, fmt::format("{:.3e}", s.mean), fmt::format("{:.3e}", s.std), fmt::format("{:.3e}", s.rms),
               fmt::format("{:.3e}", s.max)});
  };
  add("A's surface to B", report.forward);
  add("B's surface to A", report.backward);
  add("A's vertices to B", report.vertex);
  std::string text =
      table.text() + normals_text(report) +
      fmt::format("symmetric surface mean {:.3e}, maximum {:.3e}; diagonal of A {:.6g}; {:.2f} s on {}\n",
                  symmetric_mean(report), std::max(report.forward.max, report.backward.max), report.diagonal,
                  report.seconds, context.device().name);
  if (!arguments.csv.empty()) text += fmt::format("{}: distances of A's vertices, in its units\n", arguments.csv);
  if (!arguments.ply.empty())
    text += fmt::format("{}: dark blue at 0 to yellow at {:.3e} ({:.3e} of the diagonal)\n", arguments.ply, scale,
                        scale / report.diagonal);
  print(arguments.json, text);
  Json json{{"diagonal", report.diagonal},
            {"forward", statistics_json(report.forward)},
            {"backward", statistics_json(report.backward)},
            {"vertex", statistics_json(report.vertex)},
            {"normals",
             {{"forward", normals_json(report.forward_normals)}, {"backward", normals_json(report.backward_normals)}}},
            {"seconds", report.seconds},
            {"device", context.device().name},
            {"kernels", profile_json(context)}};
  if (!arguments.ply.empty()) json["ply_scale"] = {0, scale};
  write_json(arguments.json, json);
}

}  // namespace

void add_metro_command(CLI::App& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand("metro", "Measure the distance between two surfaces, in both directions");
  declare_input(command,
                command.add_option("A", arguments->a, "mesh or model, usually the original: its diagonal is the unit"))
      ->required();
  declare_input(command, command.add_option("B", arguments->b, "mesh or model (.skx.exr, .skx), usually the result"))
      ->required();
  command
      .add_option("--size", arguments->size,
                  "texels along the longer side that models are reconstructed at, 4 to 16384 (default: their own)")
      ->check(number_in(4, 16384))
      ->type_name("N");
  command
      .add_option(
          "--samples", arguments->samples,
          "points spread evenly over each surface (default: ten per vertex of the larger mesh, at least 100000)")
      ->check(number_in(1, 1e9))
      ->type_name("N");
  declare_output(
      command, command.add_option("--csv", arguments->csv, "write A's vertices and their distances to B, in A's units"),
      {".csv"})
      ->type_name("FILE");
  declare_output(command,
                 command.add_option("--ply", arguments->ply,
                                    "write A with the property distance and colours from dark blue (0) to yellow"),
                 {".ply"})
      ->type_name("FILE");
  command
      .add_option("--ply-max", arguments->ply_max,
                  "distance that is yellow, divided by the diagonal (default: what 99 % of the vertices lie below)")
      ->check(number_above(0))
      ->type_name("X");
  add_device_option(command, arguments->device);
  add_json_option(command, arguments->json);
  command.footer(
      "Examples:\n"
      "  skeletex metro bear.off bear.ply\n"
      "  skeletex metro bear.off bear.skx.exr\n"
      "  skeletex metro bear.off bear.ply --ply error.ply --csv error.csv --json error.json\n"
      "Means, RMS and maxima are divided by the diagonal of A's bounding box. \"Surface\" measures from points spread "
      "evenly over a surface (as the "
      "tool\n"
      "metro does), \"vertices\" from A's vertices (as the paper does); the two differ, so say which one you quote.\n"
      "Angles are those between normals of the triangles (surface), and between normals that the files give for the "
      "vertices or that the triangles around them have (shading).");
  command.callback([arguments] { run(*arguments); });
}

}  // namespace skeletex::cli
