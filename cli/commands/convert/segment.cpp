// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <memory>

#include "command.h"
#include "files.h"
#include "progress_bar.h"
#include "skeletex/convert/segment/segment_mesh.h"
#include "skeletex/io/mesh_file.h"
#include "skeletex/io/skeleton_file.h"
#include "skeletex/model/error.h"
#include "skeletex/model/texture.h"
#include "skeletex/render/colours.h"
#include "table.h"

namespace skeletex::cli {
namespace {

struct Arguments {
  std::string mesh, skeleton, output, device, json;
};

void run(const Arguments& arguments) {
  if (!has_ending(arguments.output, ".ply"))
    throw CLI::ValidationError("--output",
                               "\"" + arguments.output + "\" does not end in .ply, which carries the colours");
  TriangleMesh mesh = load_mesh(arguments.mesh);
  const Skeleton skeleton = read_skeleton(arguments.skeleton);
  ClContext context(arguments.device);
  UnitFrame frame;
  Segmentation segmentation;
  double half_edge_ms = 0, segmentation_ms = 0;
  {
    ProgressBar bar(context);
    bar.show("checking the input", 0);
    require_valid(mesh, skeleton);
    frame = unit_frame(mesh);
    context.reset_profile();
    bar.show("segmenting", 0.5);
    Stopwatch watch;
    CutMesh half_edges = cut_mesh_of(in_unit_frame(mesh, frame));
    half_edge_ms = watch.lap_ms();
    segmentation = segment_mesh(context, std::move(half_edges), in_unit_frame(skeleton, frame));
    segmentation_ms = watch.lap_ms();
    bar.show("writing", 0.9);
    std::vector<VertexColour> colours;
    for (const int bone : segmentation.triangle_bones) colours.push_back(bone_colour(bone));
    WrittenAttributes attributes;
    attributes.face_colours = colours;
    write_mesh(arguments.output, in_user_units(segmentation.cut_mesh, frame), attributes);
  }
  Table table({"bone", "colour", "surface", "vertices", "triangles", "area"});
  Json bones = Json::array();
  for (const Segment& segment : segmentation.segments) {
    const std::string& name = skeleton.bones[segment.bone].name;
    const VertexColour colour = bone_colour(segment.bone);
    const double area = surface_area(segment.mesh) * frame.scale * frame.scale;
    table.add({name, hex(colour), to_string(segment.topology), fmt::format("{}", segment.mesh.positions.size()),
               fmt::format("{}", segment.mesh.triangles.size()), fmt::format("{:.6g}", area)});
    bones.push_back({{"name", name},
                     {"colour", hex(colour)},
                     {"topology", to_string(segment.topology)},
                     {"vertices", segment.mesh.positions.size()},
                     {"triangles", segment.mesh.triangles.size()},
                     {"area", area}});
  }
  print(arguments.json,
        fmt::format(
            "{}\n{} triangles, {} after the cuts; {} seams; half edges {:.0f} ms, segmentation {:.0f} ms on {}\n{}\n",
            table.text(), mesh.triangles.size(), segmentation.cut_mesh.triangles.size(), segmentation.arcs.size(),
            half_edge_ms, segmentation_ms, context.device().name, arguments.output));
  write_json(arguments.json, {{"bones", std::move(bones)},
                              {"arcs", segmentation.arcs.size()},
                              {"vertices", segmentation.cut_mesh.positions.size()},
                              {"triangles", segmentation.cut_mesh.triangles.size()},
                              {"times_ms", {{"half_edge", half_edge_ms}, {"segmentation", segmentation_ms}}},
                              {"device", context.device().name},
                              {"kernels", profile_json(context)}});
}

}  // namespace

void add_segment_command(CLI::App& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand("segment", "Cut a mesh into one piece per bone and colour the pieces");
  declare_input(command, command.add_option("MESH", arguments->mesh,
                                            "closed triangle mesh: .obj, .ply, .off, .stl, .glb, .gltf or .vrm"))
      ->required();
  declare_input(command, command.add_option("SKELETON", arguments->skeleton,
                                            "skeleton: JSON with nodes and bones, in the mesh's coordinates"))
      ->required();
  declare_output(command, command.add_option("-o,--output", arguments->output, "cut mesh with a colour per face: .ply"),
                 {".ply"})
      ->required()
      ->type_name("FILE");
  add_device_option(command, arguments->device);
  add_json_option(command, arguments->json);
  command.footer(
      "Example:\n"
      "  skeletex segment bear.off bear.skeleton.json -o segments.ply --json legend.json\n"
      "The table and the JSON say which colour is which bone; the i-th bone of a skeleton always has the same one. "
      "Areas are in the mesh's units "
      "squared.");
  command.callback([arguments] { run(*arguments); });
}

}  // namespace skeletex::cli
