// SPDX-License-Identifier: MIT
#include "bind.h"
#include "skeletex/edit/filter/differential.h"
#include "skeletex/edit/filter/filter.h"
#include "skeletex/edit/live.h"
#include "skeletex/edit/morph/landmarks.h"
#include "skeletex/edit/morph/morph.h"
#include "skeletex/edit/regular_grid.h"
#include "skeletex/edit/transfer/mirror.h"
#include "skeletex/edit/transfer/transfer.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex::python {
namespace {

using Json = nlohmann::json;
using BonePairs = std::vector<std::pair<std::string, std::string>>;

/// One model for each list of weights.
std::vector<Model> morph(const std::vector<Model>& models, const std::vector<std::vector<double>>& weights,
                         const BonePairs& bones, std::optional<int> layout, int size, bool is_smooth,
                         const Points& first_landmarks, const Points& second_landmarks) {
  const std::vector<Vec3> first_points = points_of(first_landmarks, "landmarks"),
                          second_points = points_of(second_landmarks, "landmarks");
  std::vector<Landmark> landmarks;
  for (std::size_t i = 0; i < first_points.size(); ++i)
    landmarks.push_back({std::to_string(i), first_points[i], second_points.at(i)});
  std::vector<SkeletexModel> given;
  for (const Model& model : models) given.push_back(whole(model));
  const py::none no_callback;
  std::vector<SkeletexModel> made = run_watched(no_callback, [&](ClContext& context, const auto& progress) {
    std::vector<Correspondence> from_first;
    for (std::size_t m = 1; m < given.size(); ++m)
      from_first.push_back(find_correspondence(given[0].skeleton, given[m].skeleton, {.given = bones}));
    if (!landmarks.empty())
      given[1] = align_landmarks(context, given[0], std::move(given[1]), from_first[0], landmarks);
    MorphOptions options;
    options.layout = layout;
    options.size = size;
    options.is_smooth = is_smooth;
    const Morph between(context, std::move(given), from_first, options);
    std::vector<SkeletexModel> results;
    for (const std::vector<double>& one : weights) {
      if (!progress("morph", 0)) throw Error("cancelled");  // Ctrl-C
      results.push_back(between.at(one));
    }
    return results;
  });
  std::vector<Model> results;
  for (SkeletexModel& model : made) results.push_back(model_of(std::move(model)));
  return results;
}

/// \return per bone of the first skeleton the bone of the second, whether it is reversed, and the cost
py::tuple correspond(const Model& a, const Model& b, const BonePairs& bones) {
  const Correspondence found = find_correspondence(a.rest->skeleton, b.rest->skeleton, {.given = bones});
  return py::make_tuple(std::vector<int>(found.bones.begin(), found.bones.end()), found.is_reversed, found.cost);
}

/// \param json  from transfer() of the package: every key is there, null where the default is wanted
TransferOptions transfer_options(const Json& json) {
  TransferOptions options;
  options.has_limbs = json["limb"];
  options.is_smooth = !json["creases"].get<bool>();
  const std::string blend = json["blend"];
  options.blend = blend == "cosine"   ? TransferBlend::kCosine
                  : blend == "linear" ? TransferBlend::kLinear
                                      : TransferBlend::kNone;
  if (json["scale"].is_number()) {
    options.scale = TransferScale::kFactor;
    options.factor = json["scale"];
  } else {
    const std::string scale = json["scale"];
    options.scale = scale == "auto"     ? TransferScale::kAuto
                    : scale == "length" ? TransferScale::kLength
                                        : TransferScale::kGirth;
  }
  const auto share = [&](const char* key, double& value) {
    if (!json[key].is_null()) value = json[key];
  };
  share("width", options.width);
  share("keep", options.keep);
  share("skip", options.skip);
  return options;
}

Model transfer_bones(const Model& source, const Model& target, const BonePairs& bones,
                     const std::string& options_json) {
  const Json json = parse_own_json(options_json);
  const TransferOptions options = transfer_options(json);
  SkeletexModel from = whole(source);
  const SkeletexModel to = whole(target);
  return model_of(run([&](ClContext& context) {
    if (json["mirror"]) from = mirrored(from);
    SkeletexModel result = transfer(context, from, to, bones, options);
    const double share = json["share"];
    return share == 1 ? result : LiveBlend(context, to, result).at(share);
  }));
}

/// \param json  from the functions smooth, enhance, add_noise of the package
FilterResult filtered(ClContext& context, const SkeletexModel& model, const std::string& filter, const Json& json) {
  FilterRegion region;
  region.bones = json["bones"].get<std::vector<std::string>>();
  region.falloff = json["falloff"];
  if (filter == "smooth") {
    SmoothOptions options;
    options.scale = json["scale"];
    options.iterations = json["iterations"];
    options.keeps_volume = json["keep_volume"];
    return smooth_model(context, model, options, region);
  }
  if (filter == "enhance") {
    EnhanceOptions options;
    options.scale = json["scale"];
    options.gain = json["gain"];
    return enhance_model(context, model, options, region);
  }
  NoiseOptions options;
  options.amplitude = json["amplitude"];
  options.wavelength = json["wavelength"];
  options.octaves = json["octaves"];
  options.seed = json["seed"];
  return add_noise(context, model, options, region);
}

/// \return the mesh of the model's regular grid, and the mean curvature of its vertices in 1 / unit of the user
py::tuple curvature(const Model& model, double scale) {
  const SkeletexModel given = whole(model);
  TriangleMesh mesh;
  const std::vector<float> values = run([&](ClContext& context) {
    const SkeletexModel grid = regular_grid(context, given);
    const ModelSurface surface = upload_surface(context, grid);
    CurvatureResult result = mean_curvature(context, grid, surface, scale);
    mesh = reconstruct_mesh(context, grid);
    return std::move(result.mean_curvature);
  });
  return py::make_tuple(arrays_of(mesh), array_of(values));
}

}  // namespace

void bind_edit(py::module_& module) {
  module.def("morph", morph);
  module.def("correspond", correspond);
  module.def("transfer", transfer_bones);
  module.def("mirror", [](const Model& model) { return model_of(mirrored(whole(model))); });
  module.def("regular_grid", [](const Model& model) {
    const SkeletexModel given = whole(model);
    return model_of(run([&](ClContext& context) { return regular_grid(context, given); }));
  });
  module.def("filter", [](const Model& model, const std::string& filter, const std::string& options_json) {
    const Json json = parse_own_json(options_json);
    const SkeletexModel given = whole(model);
    return model_of(run([&](ClContext& context) { return filtered(context, given, filter, json).model; }));
  });
  module.def("mean_curvature", curvature);
}

}  // namespace skeletex::python
