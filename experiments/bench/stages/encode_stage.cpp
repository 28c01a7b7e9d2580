// SPDX-License-Identifier: MIT
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfOutputFile.h>
#include <fmt/format.h>

#include <OpenMesh/Core/IO/MeshIO.hh>
#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>

#include "runner/process.h"
#include "runner/work_folder.h"
#include "skeletex/io/json_file.h"
#include "skeletex/io/mesh_file.h"
#include "skeletex/io/model_file.h"
#include "skeletex/io/read_file.h"
#include "skeletex/model/error.h"
#include "stages.h"

namespace skeletex {
namespace {

struct Command {
  WorkFolder folder;
  std::string mesh, program;
  std::vector<std::string> arguments;
  DisplacementTexture texels;
  double peak_memory_mb = 0;

  std::filesystem::path model() const { return folder.path() / "model.skx.exr"; }
  std::filesystem::path report() const { return folder.path() / "report.json"; }
  void run(std::initializer_list<const char*> more = {}) {
    std::vector<std::string> all = arguments;
    all.insert(all.end(), more.begin(), more.end());
    const ProcessResult result = run_process(program, all, {}, folder.path() / "errors.txt");
    if (result.exit_code != 0)
      throw Error(fmt::format("{} encode ended with {}: {}", program, result.exit_code, result.errors));
    peak_memory_mb = result.peak_memory_mb;
  }
  /// Of the last run.
  nlohmann::json read_report() const { return parse_json(read_file(report()), report().string()); }
};

std::shared_ptr<Command> make_command(const MeshInput& input, int size, const std::string& program,
                                      const std::string& device) {
  auto command = std::make_shared<Command>();
  command->program = program;
  command->mesh = input.mesh_path.string();
  if (read_mesh(input.mesh_path).mesh.triangles.size() != input.mesh.triangles.size()) {  // a subdivided one
    command->mesh = command->folder.path() / "mesh.ply";
    write_mesh(command->mesh, input.mesh);
  }
  command->arguments = {"encode",
                        command->mesh,
                        input.skeleton_path.string(),
                        "-o",
                        command->model().string(),
                        "--size",
                        fmt::format("{}", size),
                        "--json",
                        command->report().string()};
  if (!device.empty()) command->arguments.insert(command->arguments.end(), {"--device", device});
  return command;
}

void write_exr(const std::string& path, const DisplacementTexture& texels) {
  Imf::Header header(texels.width, texels.height);
  Imf::FrameBuffer frame;
  for (const auto& [name, plane] : {std::pair{"R", &texels.along}, {"G", &texels.around}, {"B", &texels.out}}) {
    header.channels().insert(name, Imf::Channel(Imf::FLOAT));
    frame.insert(name, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(const_cast<float*>(plane->data())), sizeof(float),
                                  sizeof(float) * texels.width));
  }
  Imf::OutputFile file(path.c_str(), header);
  file.setFrameBuffer(frame);
  file.writePixels(texels.height);
}

}  // namespace

Stage encode_stage(MeshInputPointer input, int size, const std::string& program, const std::string& device) {
  Stage stage;
  stage.name = "encode";
  stage.model = input->name;
  stage.size = size;
  stage.reference = "OpenMesh reading the mesh file, OpenEXR writing as many texels";
  const std::shared_ptr<Command> command = make_command(*input, size, program, device);
  command->run();
  command->texels = read_model(command->model().string()).texture;
  stage.run = [command] { command->run(); };
  stage.run_reference = [command] {
    return wall_ms([&] {
      OpenMesh::TriMesh_ArrayKernelT<> mesh;
      if (!OpenMesh::IO::read_mesh(mesh, command->mesh)) throw IoError(command->mesh + ": OpenMesh cannot read it");
      write_exr(command->folder.path() / "reference.exr", command->texels);
    });
  };
  stage.details = [command] {
    std::vector<std::pair<std::string, double>> details{{"peak_memory_mb", command->peak_memory_mb}};
    const nlohmann::json report = command->read_report();
    for (const auto& [name, ms] : report.at("times_ms").items()) details.emplace_back(name + "_ms", ms.get<double>());
    double kernels = 0;
    for (const auto& kernel : report.at("kernels")) kernels += kernel.at("ms").get<double>();
    details.emplace_back("kernels_ms", kernels);
    return details;
  };
  return stage;
}

Stage snap_stage(MeshInputPointer input, int size, const std::string& program, const std::string& device) {
  Stage stage;
  stage.name = "snap";
  stage.model = input->name;
  stage.size = size;
  stage.reference = "the command's whole parameterization";
  const std::shared_ptr<Command> command = make_command(*input, size, program, device);
  struct Times {
    double even = 0, snapped = 0;  // of the encoding
  };
  const auto times = std::make_shared<Times>();
  stage.run_reference = [command, times] {
    command->run({"--no-snap", "--no-fit"});
    const nlohmann::json ms = command->read_report().at("times_ms");
    times->even = ms.at("encoding").get<double>();
    return ms.at("parameterization").get<double>();
  };
  stage.run = [command, times] {
    command->run();
    times->snapped = command->read_report().at("times_ms").at("encoding").get<double>();
  };
  stage.counted_ms = [times] { return times->snapped - times->even; };
  stage.details = [times] {
    return std::vector<std::pair<std::string, double>>{{"encoding_ms", times->snapped},
                                                       {"even_encoding_ms", times->even}};
  };
  return stage;
}

}  // namespace skeletex
