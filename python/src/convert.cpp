// SPDX-License-Identifier: MIT
#include "bind.h"
#include "skeletex/convert/encode_model.h"
#include "skeletex/convert/guess_stance.h"
#include "skeletex/convert/resample/levels.h"
#include "skeletex/convert/resample/resample.h"
#include "skeletex/edit/polish.h"
#include "skeletex/io/pose_file.h"
#include "skeletex/reconstruct/pose/pose_mesh.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/skeletonize/repair_skeleton.h"
#include "skeletex/skeletonize/skeletonize.h"

namespace skeletex::python {
namespace {

using Json = nlohmann::json;
using Watch = std::function<bool(const std::string&, double)>;

/// A mesh, turned where it is inside out, and its skeleton, if there is one, in the unit frame of the mesh.
struct Input {
  TriangleMesh mesh;
  Skeleton skeleton;
  std::optional<TriangleTree> tree;
  std::vector<Finding> findings;
};

/// \throw InvalidInput
Input checked_input(TriangleMesh mesh, const std::optional<Skeleton>& skeleton) {
  Input input;
  input.mesh = std::move(mesh);
  input.findings = skeleton ? validate_before_segmentation(input.mesh, *skeleton, &input.tree)
                            : validate_mesh(input.mesh, &input.tree);
  if (has_errors(input.findings)) throw InvalidInput(std::move(input.findings));
  const UnitFrame frame = unit_frame(input.mesh);
  input.mesh = in_unit_frame(std::move(input.mesh), frame);
  if (skeleton) input.skeleton = in_unit_frame(*skeleton, frame);
  input.skeleton.frame = frame;
  if (!input.tree) input.tree = build_triangle_tree(input.mesh);
  input.tree->origin = Vec3::Zero();  // what it holds is in this frame already
  input.tree->scale = 1;
  return input;
}

void take_paper_recipe(EncodeOptions& options) {
  options.vsm = {.iterations = 1, .alpha = 0};
  options.reweights_squeezed = false;
  options.row_spacing = RowSpacing::kUniform;
  options.has_prefilter = options.has_unfold = false;
  options.has_snap = options.has_fit = false;
  if (!options.method || !is_height_field(*options.method)) options.texel_share = TexelShare::kTriangles;
}

/// \param json  from encode() of the package: every key is there, null where the default is wanted
EncodeOptions encode_options(const Json& json) {
  EncodeOptions options;
  options.width = json["width"];
  options.height = json["height"];
  const std::string method = json["method"];
  options.method = method == "hybrid" ? std::nullopt : std::optional(method_named(method));
  for (const auto& [bone, name] : json["bone_methods"].items())
    options.hybrid_overrides.emplace_back(bone, method_named(name));
  if (json["paper_recipe"]) take_paper_recipe(options);
  const auto take = [&](const char* key, auto& value) {
    if (!json[key].is_null()) value = json[key].get<std::remove_reference_t<decltype(value)>>();
  };
  const auto take_optional = [&](const char* key, std::optional<bool>& value) {
    if (!json[key].is_null()) value = json[key].get<bool>();
  };
  if (!json["iterations"].is_null()) options.reweights_squeezed = false;
  take("iterations", options.vsm.iterations);
  take("alpha", options.vsm.alpha);
  take("prefilter", options.has_prefilter);
  take("unfold", options.has_unfold);
  take_optional("snap", options.has_snap);
  take_optional("fit", options.has_fit);
  take("half", options.has_half_texels);
  if (const Json& rows = json["rows"]; !rows.is_null())
    options.row_spacing = rows == "uniform" ? RowSpacing::kUniform : RowSpacing::kSurfaceLength;
  if (const Json& share = json["share"]; !share.is_null())
    options.texel_share = share == "area"        ? TexelShare::kArea
                          : share == "triangles" ? TexelShare::kTriangles
                                                 : TexelShare::kError;
  return options;
}

Json report_json(const EncodeReport& report) {
  Json bones = Json::array();
  for (const BoneReport& bone : report.bones)
    bones.push_back({{"name", bone.name},
                     {"method", to_string(bone.method)},
                     {"topology", to_string(bone.topology)},
                     {"area", bone.area},
                     {"vertices", bone.vertices},
                     {"triangles", bone.triangles},
                     {"unseen_area_fraction", bone.unseen_area_fraction},
                     {"flipped_triangles", bone.flipped_triangles},
                     {"missed_texels", bone.missed_texels},
                     {"lacks_part", lacks_part(bone, report.diagonal)},
                     {"mean_distance", bone.distance.mean / report.diagonal},
                     {"furthest_distance", bone.distance.furthest / report.diagonal}});
  return {{"vertices", report.vertices},
          {"triangles", report.triangles},
          {"split_triangles", report.split_triangles},
          {"genus", report.genus},
          {"bones", std::move(bones)},
          {"used_fraction", report.used_fraction},
          {"is_snapped", report.placing.has_snap},
          {"fit_steps", report.placing.fit_steps},
          {"texels_per_vertex", report.placing.texels_per_vertex},
          {"times_ms",
           {{"half_edge", report.half_edge_ms},
            {"segmentation", report.segmentation_ms},
            {"parameterization", report.parameterization_ms},
            {"encoding", report.encoding_ms}}},
          {"device", report.device}};
}

Skeleton made_skeleton(ClContext& context, const Input& input, SkeletonizeOptions options, const Watch& watch) {
  options.progress = watch;
  Skeleton skeleton = std::move(skeletonize(context, input.mesh, *input.tree, options).skeleton);
  skeleton.frame = input.skeleton.frame;
  return skeleton;
}

/// \return the model, the report as JSON, and the findings
py::tuple encode(const Points& vertices, const Indices& triangles, const std::optional<py::tuple>& skeleton,
                 const std::string& options_json, const py::object& progress) {
  EncodeOptions options = encode_options(parse_own_json(options_json));
  const TriangleMesh mesh = mesh_of(vertices, triangles);
  std::optional<Skeleton> given;
  if (skeleton) given = skeleton_of(*skeleton);
  std::vector<Finding> findings;
  EncodeResult result = run_watched(progress, [&](ClContext& context, const Watch& watch) {
    Input input = checked_input(mesh, given);
    findings = std::move(input.findings);
    if (!given) input.skeleton = made_skeleton(context, input, {}, watch);
    const MeshAttributes attributes;  // the normals are computed
    options.attributes = &attributes;
    options.stance = guess_stance(input.mesh, input.skeleton);
    options.tree = &*input.tree;
    options.progress = watch;
    return encode_model(context, input.mesh, input.skeleton, options);
  });
  return py::make_tuple(model_of(std::move(result.model)), report_json(result.report).dump(), findings_list(findings));
}

py::tuple make_skeleton(const Points& vertices, const Indices& triangles, const std::string& options_json,
                        const py::object& progress) {
  const Json json = parse_own_json(options_json);
  SkeletonizeOptions options;
  options.purpose = json["purpose"] == "size" ? SkeletonPurpose::kSize : SkeletonPurpose::kPose;
  if (!json["bones"].is_null()) options.most_bones = json["bones"].get<int>();
  if (!json["detail"].is_null()) options.detail = json["detail"].get<double>();
  const TriangleMesh mesh = mesh_of(vertices, triangles);
  return tuple_of(run_watched(progress, [&](ClContext& context, const Watch& watch) {
    return made_skeleton(context, checked_input(mesh, std::nullopt), options, watch);
  }));
}

py::list validate(const Points& vertices, const Indices& triangles, const std::optional<py::tuple>& skeleton) {
  TriangleMesh mesh = mesh_of(vertices, triangles);
  if (!skeleton) return findings_list(validate_mesh(mesh));
  const Skeleton given = skeleton_of(*skeleton);
  return findings_list(run([&](ClContext& context) { return validate_input(context, mesh, given); }));
}

/// \return the skeleton and what was changed, in sentences
py::tuple repair(const Points& vertices, const Indices& triangles, const py::tuple& skeleton) {
  const TriangleMesh mesh = mesh_of(vertices, triangles);
  const Skeleton given = skeleton_of(skeleton);
  const RepairResult result = run([&](ClContext& context) {
    TriangleMesh turned = mesh;
    std::optional<TriangleTree> tree;
    std::vector<Finding> findings = validate_mesh(turned, &tree);
    if (has_errors(findings)) throw InvalidInput(std::move(findings));
    return repair_skeleton(context, turned, tree ? *tree : build_triangle_tree(turned), given);
  });
  return py::make_tuple(tuple_of(result.skeleton), result.changes);
}

/// The skeleton in a pose that is JSON as a pose file has it.
Skeleton posed_skeleton(const Skeleton& bind, const std::string& pose_json, std::optional<double> time) {
  PoseAnimation animation;
  try {
    animation = animation_from_json(parse_own_json(pose_json), bind, "pose");
  } catch (const IoError& error) {
    throw InputError(error.what());  // it is no file here
  }
  return apply_pose(bind, pose_at(bind, animation, time.value_or(animation.frames.front().time)));
}

Deformation deformation_named(const std::string& name) {
  for (const Deformation rule :
       {Deformation::kSmooth, Deformation::kCoordinates, Deformation::kPaper, Deformation::kLinear})
    if (name == to_string(rule)) return rule;
  throw InputError("deform: \"" + name + "\" is none of smooth, coordinates, paper, linear");
}

py::tuple reconstruct(const Model& model, const std::optional<std::string>& pose, std::optional<double> time,
                      const std::string& deform, bool is_polished) {
  const SkeletexModel given = whole(model);
  const PoseRule rule{deformation_named(deform), DistanceRule::kFromBone};
  std::optional<Skeleton> posed;
  if (pose) posed = posed_skeleton(given.skeleton, *pose, time);
  return arrays_of(run([&](ClContext& context) {
    const PreparedModel prepared(given);
    if (!posed) return reconstruct_mesh(context, prepared);
    TriangleMesh mesh = reconstruct_mesh(context, prepared, *posed, rule);
    if (is_polished) polish_pose(reconstruct_mesh(context, prepared), mesh.positions);
    return mesh;
  }));
}

}  // namespace

void bind_convert(py::module_& module) {
  module.def("encode", encode);
  module.def("skeletonize", make_skeleton);
  module.def("validate", validate);
  module.def("repair", repair);
  module.def("reconstruct", reconstruct);
  module.def("pose", [](const Model& model, const std::string& pose, std::optional<double> time) {
    return tuple_of(posed_skeleton(model.rest->skeleton, pose, time));
  });
  module.def("random_pose", [](const Model& model, double largest, std::uint64_t seed) {
    return pose_to_json(make_random_pose(model.rest->skeleton, largest, seed), model.rest->skeleton).dump();
  });
  module.def("resample", [](const Model& model, int size) {
    const SkeletexModel given = whole(model);
    return model_of(run([&](ClContext& context) { return resample_model(context, given, size); }));
  });
  module.def("levels", [](const Model& model, int smallest) {
    const SkeletexModel given = whole(model);
    std::vector<SkeletexModel> made = run([&](ClContext& context) { return make_levels(context, given, smallest); });
    std::vector<Model> levels;
    for (SkeletexModel& level : made) levels.push_back(model_of(std::move(level)));
    return levels;
  });
}

}  // namespace skeletex::python
