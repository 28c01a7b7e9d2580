// SPDX-License-Identifier: MIT
// The fewest bytes with which Draco, alone or after a quadric simplification, stays within an error: what the compact
// format is compared with.
#include <draco/compression/decode.h>
#include <draco/compression/expert_encode.h>
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "simplify.h"
#include "skeletex/analysis/metro.h"
#include "skeletex/geometry/self_intersection.h"
#include "skeletex/io/atomic_file.h"
#include "skeletex/io/mesh_file.h"
#include "skeletex/io/same_file.h"
#include "skeletex/model/error.h"

namespace {

using namespace skeletex;

struct Arguments {
  std::string mesh, output, json;
  double max_error = 1e-4;
};

std::unique_ptr<draco::Mesh> draco_mesh(const TriangleMesh& mesh) {
  auto result = std::make_unique<draco::Mesh>();
  draco::GeometryAttribute position;
  position.Init(draco::GeometryAttribute::POSITION, nullptr, 3, draco::DT_FLOAT32, false, 12, 0);
  const int id = result->AddAttribute(position, true, static_cast<std::uint32_t>(mesh.positions.size()));
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const Eigen::Vector3f p = mesh.positions[i].cast<float>();
    result->attribute(id)->SetAttributeValue(draco::AttributeValueIndex(static_cast<std::uint32_t>(i)), p.data());
  }
  result->set_num_points(static_cast<std::uint32_t>(mesh.positions.size()));
  for (const Triangle& t : mesh.triangles) {
    draco::Mesh::Face face;
    for (int i = 0; i < 3; ++i) face[i] = draco::PointIndex(t[i]);
    result->AddFace(face);
  }
  return result;
}

/// The file of a mesh at the level 10 of draco_encoder, which is speed 0.
std::vector<char> encode(const TriangleMesh& mesh, int bits) {
  const std::unique_ptr<draco::Mesh> input = draco_mesh(mesh);
  draco::ExpertEncoder encoder(*input);
  encoder.SetSpeedOptions(0, 0);
  encoder.SetAttributeQuantization(0, bits);
  draco::EncoderBuffer buffer;
  const draco::Status status = encoder.EncodeToBuffer(&buffer);
  if (!status.ok()) throw InputError("Draco: " + status.error_msg_string());
  return {buffer.data(), buffer.data() + buffer.size()};
}

TriangleMesh decode(const std::vector<char>& file) {
  draco::DecoderBuffer buffer;
  buffer.Init(file.data(), file.size());
  draco::Decoder decoder;
  auto decoded = decoder.DecodeMeshFromBuffer(&buffer);
  if (!decoded.ok()) throw InputError("Draco: " + decoded.status().error_msg_string());
  const std::unique_ptr<draco::Mesh> mesh = std::move(decoded).value();
  const draco::PointAttribute* position = mesh->GetNamedAttribute(draco::GeometryAttribute::POSITION);
  TriangleMesh result;
  for (draco::PointIndex i(0); i < mesh->num_points(); ++i) {
    Eigen::Vector3f p;
    position->GetMappedValue(i, p.data());
    result.positions.push_back(p.cast<double>());
  }
  for (draco::FaceIndex f(0); f < mesh->num_faces(); ++f) {
    const draco::Mesh::Face& face = mesh->face(f);
    result.triangles.push_back(
        {static_cast<int>(face[0].value()), static_cast<int>(face[1].value()), static_cast<int>(face[2].value())});
  }
  return result;
}

struct Found {
  std::size_t bytes = 0, vertices = 0;
  int bits = 0;
  MetroReport report;
  TriangleMesh mesh;
};

/// The fewest bits with which a mesh stays within the error.
std::optional<Found> fewest_bits(ClContext& context, const TriangleMesh& original, const TriangleMesh& mesh,
                                 double max_error) {
  std::optional<Found> best;
  int low = 6, high = 18;
  while (low <= high) {
    const int bits = (low + high) / 2;
    const std::vector<char> file = encode(mesh, bits);
    TriangleMesh decoded = decode(file);
    const MetroReport report = measure_metro(context, original, decoded, {.samples = 200'000});
    if (symmetric_mean(report) <= max_error) {
      best = Found{file.size(), mesh.positions.size(), bits, report, std::move(decoded)};
      high = bits - 1;
    } else {
      low = bits + 1;
    }
  }
  return best;
}

void run(const Arguments& arguments) {
  for (const std::string& output : {arguments.output, arguments.json}) check_not_an_input(output, {arguments.mesh});
  const TriangleMesh original = read_mesh(arguments.mesh).mesh;
  ClContext context("");
  std::optional<Found> alone = fewest_bits(context, original, original, arguments.max_error), best = alone;
  // Fewer vertices need more bits: as far as that pays.
  int worse = 0;
  for (double share = 0.8; share > 0.002 && worse < 4; share *= 0.8) {
    const auto vertices = static_cast<int>(share * static_cast<double>(original.positions.size()));
    if (vertices < 50) break;
    std::optional<Found> found = fewest_bits(context, original, simplify(original, vertices), arguments.max_error);
    if (!found) break;
    worse = best && found->bytes >= best->bytes ? worse + 1 : 0;
    if (!best || found->bytes < best->bytes) best = std::move(found);
  }
  if (!best) throw InputError("no number of bits reaches that error");
  write_mesh(arguments.output, best->mesh);
  const nlohmann::ordered_json json{{"bytes", best->bytes},
                                    {"alone_bytes", alone ? nlohmann::json(alone->bytes) : nlohmann::json()},
                                    {"vertices", best->vertices},
                                    {"bits", best->bits},
                                    {"mean", symmetric_mean(best->report)},
                                    {"max", std::max(best->report.forward.max, best->report.backward.max)},
                                    {"self_intersections", count_self_intersections(best->mesh)}};
  if (!arguments.json.empty()) write_text_atomically(arguments.json, json.dump(2) + "\n");
  fmt::print("{} bytes, {} vertices at {} bits: mean {:.3g}\n", best->bytes, best->vertices, best->bits,
             symmetric_mean(best->report));
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App program("The smallest Draco file of a mesh, simplified or not, within an error.", "draco_size");
  Arguments arguments;
  program.add_option("MESH", arguments.mesh, "closed triangle mesh")->required();
  program.add_option("-o,--output", arguments.output, "what the file decodes to: .ply")->required();
  program.add_option("--max-error", arguments.max_error, "symmetric surface mean over the diagonal")
      ->check(CLI::Range(1e-7, 0.1));
  program.add_option("--json", arguments.json, "write bytes, alone_bytes, vertices, bits, mean, max to this file");
  try {
    program.parse(argc, argv);
    run(arguments);
  } catch (const CLI::ParseError& error) {
    return program.exit(error) == 0 ? 0 : 2;
  } catch (const std::exception& error) {
    fmt::print(stderr, "error: {}\n", error.what());
    return 1;
  }
}
