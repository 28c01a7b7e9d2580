// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <functional>
#include <nlohmann/json.hpp>

#include "peers/skinning.h"
#include "skeletex/analysis/deformation.h"
#include "skeletex/edit/polish.h"
#include "skeletex/io/atomic_file.h"
#include "skeletex/io/mesh_file.h"
#include "skeletex/io/model_file.h"
#include "skeletex/io/pose_file.h"
#include "skeletex/io/same_file.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/lattice.h"
#include "skeletex/reconstruct/pose/pose_mesh.h"
#include "skeletex/reconstruct/pose/skin.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/reconstruct/thin_triangles.h"

namespace {

using namespace skeletex;
using Json = nlohmann::ordered_json;

struct Rule {
  std::string name;
  std::function<std::vector<Vec3>(const Skeleton& posed)> pose;
  Json poses = Json::array();  // the counts of each
  long new_folds = 0, new_intersections = 0;
  double lowest_volume = 1, highest_volume = 1, seam_bend = 0;
  std::vector<TriangleEnergy> energies{};  // of all poses
};

std::vector<int> own_bones(const PreparedModel& prepared) {
  const SkeletexModel& model = prepared.model;
  std::vector<int> own;
  for (int bone = 0; bone < static_cast<int>(model.patches.size()); ++bone)
    own.insert(
        own.end(),
        static_cast<std::size_t>(model.patches[bone].rectangle.width) * (model.patches[bone].rectangle.height - 2),
        bone);
  const std::vector<int> shared = bones_of_shared_vertices(prepared);
  own.insert(own.end(), shared.begin(), shared.end());
  return own;
}

void measure(Rule& rule, const BindSurface& bind, const std::vector<bool>& is_seam, const PoseFrame& frame,
             const Skeleton& posed, const std::string& folder) {
  const std::vector<Vec3> positions = rule.pose(posed);
  if (!folder.empty())
    write_mesh(fmt::format("{}/{}.{}.ply", folder, frame.name, rule.name),
               in_user_units({positions, bind.mesh.triangles}, posed.frame));
  const DeformationReport report = measure_deformation(bind, positions);
  const double bend = added_bend(bind, positions, is_seam, 0.99);
  rule.poses.push_back({{"time", frame.time},
                        {"name", frame.name},
                        {"new_folds", report.new_folds},
                        {"new_intersections", report.new_intersections},
                        {"energy_99", report.energy_99},
                        {"volume_ratio", report.volume_ratio},
                        {"seam_bend_99", bend}});
  rule.new_folds += report.new_folds;
  rule.new_intersections += report.new_intersections;
  rule.lowest_volume = std::min(rule.lowest_volume, report.volume_ratio);
  rule.highest_volume = std::max(rule.highest_volume, report.volume_ratio);
  rule.seam_bend = std::max(rule.seam_bend, bend);
  const std::vector<TriangleEnergy> energies = triangle_energies(bind, positions);
  rule.energies.insert(rule.energies.end(), energies.begin(), energies.end());
}

/// Of how many poses both counts are at most another rule's.
int poses_not_worse(const Rule& rule, const Rule& other) {
  int count = 0;
  for (std::size_t i = 0; i < rule.poses.size(); ++i)
    count += rule.poses[i]["new_folds"] <= other.poses[i]["new_folds"] &&
             rule.poses[i]["new_intersections"] <= other.poses[i]["new_intersections"];
  return count;
}

Json run(const std::string& model_path, const std::string& pose_path, const std::string& device,
         const std::string& folder) {
  const SkeletexModel model = read_model(model_path);
  const PoseAnimation animation = read_animation(pose_path, model.skeleton);
  ClContext context(device);
  const PreparedModel prepared(model);
  const TriangleMesh all_texels = reconstruct_bind_mesh(context, prepared).mesh;
  const ReducedMesh written = without_thin_triangles(all_texels);  // as `skeletex reconstruct` writes it
  const BindSurface bind = make_bind_surface({values_of(written, all_texels.positions), written.triangles});
  const Lattice& lattice = prepared.lattice;
  const int first_seam = lattice.first_sample.empty() ? lattice.first_corner : lattice.first_sample[0];
  std::vector<bool> is_seam;
  for (const auto& [a, b] : bind.edges.vertices)
    is_seam.push_back(written.vertices[b] >= first_seam);  // they come last

  std::vector<Rule> rules;
  for (const Deformation deformation : {Deformation::kSmooth, Deformation::kCoordinates, Deformation::kPaper})
    rules.push_back({to_string(deformation), [&, deformation](const Skeleton& posed) {
                       return values_of(
                           written,
                           in_frame(reconstruct_mesh(context, prepared, posed, {deformation}), posed.frame).positions);
                     }});
  rules.push_back({"polished", [&](const Skeleton& posed) {
                     std::vector<Vec3> positions = rules[0].pose(posed);
                     polish_pose(bind.mesh, positions);
                     return positions;
                   }});
  const std::vector<int> own = values_of(written, own_bones(prepared));
  const auto weights = [&](double width) {
    return diffused_weights(bind.mesh, own, static_cast<int>(model.skeleton.bones.size()), width * model.diagonal);
  };
  const VertexWeights wide = weights(0.05), narrow = weights(0.025);
  const auto add_peer = [&](const char* name, const auto& skin, const VertexWeights& peer_weights) {
    rules.push_back({name, [&, skin](const Skeleton& posed) {
                       return skin(bind.mesh.positions, peer_weights, bone_motions(model.skeleton, posed));
                     }});
  };
  add_peer("linear", skin_linearly, wide);
  add_peer("dual_quaternions", skin_by_dual_quaternions, wide);
  add_peer("dual_quaternions_narrow", skin_by_dual_quaternions, narrow);
  for (const PoseFrame& frame : animation.frames) {
    const Skeleton posed = apply_pose(model.skeleton, frame.pose);
    for (Rule& rule : rules) measure(rule, bind, is_seam, frame, posed, folder);
  }
  Json json;
  for (const Rule& rule : rules) {
    fmt::print(
        "{:24} {:6} new folds {:6} new intersections, energy {:.2f}, volume {:.3f} to {:.3f}, seams bend by {:.1f} "
        "degrees\n",
        rule.name, rule.new_folds, rule.new_intersections, energy_below(rule.energies, 0.99), rule.lowest_volume,
        rule.highest_volume, rule.seam_bend);
    json[rule.name] = {{"new_folds", rule.new_folds},
                       {"new_intersections", rule.new_intersections},
                       {"energy_99", energy_below(rule.energies, 0.99)},
                       {"lowest_volume", rule.lowest_volume},
                       {"highest_volume", rule.highest_volume},
                       {"seam_bend_99", rule.seam_bend},
                       {"poses_not_worse_than_narrow", poses_not_worse(rule, rules.back())},
                       {"poses", rule.poses}};
  }
  json["pose_count"] = animation.frames.size();
  return json;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App program(
      "What poses do to a model's surface by each rule of this project, and by linear and dual quaternion skinning "
      "with each vertex' own bone diffused over 0.05 "
      "(narrow: 0.025) diagonals.",
      "pose_rules");
  std::string model, poses, json, device, folder;
  program.add_option("MODEL", model, "model: .skx.exr")->required();
  program.add_option("POSES", poses, "animation of which each frame is a pose: .json")->required();
  program.add_option("--json", json, "write the numbers of every rule, and of every pose, to this file");
  program.add_option("--meshes", folder, "write the mesh of every pose by every rule to this folder: POSE.RULE.ply")
      ->check(CLI::ExistingDirectory);
  program.add_option("--device", device, "OpenCL device, as for skeletex");
  try {
    program.parse(argc, argv);
    check_not_an_input(json, {model, poses});
    const Json result = run(model, poses, device, folder);
    if (!json.empty()) write_text_atomically(json, result.dump(2) + "\n");
  } catch (const CLI::ParseError& error) {
    return program.exit(error) == 0 ? 0 : 2;
  } catch (const std::exception& error) {
    fmt::print(stderr, "error: {}\n", error.what());
    return 1;
  }
}
