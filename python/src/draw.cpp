// SPDX-License-Identifier: MIT
#include "skeletex/render/draw.h"

#include <cstring>

#include "bind.h"
#include "skeletex/page/page.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/render/colours.h"
#include "skeletex/render/scene.h"
#include "skeletex/render/texture_image.h"

namespace skeletex::python {
namespace {

using Json = nlohmann::json;

constexpr int kCheckerCells = 24;

py::array image_array(const Image& image) {
  Numbers array({py::ssize_t{image.height}, py::ssize_t{image.width}, py::ssize_t{4}});
  std::memcpy(array.mutable_data(), image.rgba.data(), image.rgba.size() * sizeof(float));
  return array;
}

std::vector<VertexColour> colours_of(const Bytes& array) {
  std::vector<VertexColour> colours(static_cast<std::size_t>(array.shape(0)));
  const unsigned char* const bytes = array.data();
  for (std::size_t i = 0; i < colours.size(); ++i) colours[i] = {bytes[3 * i], bytes[3 * i + 1], bytes[3 * i + 2]};
  return colours;
}

/// What is drawn, in the unit frame.
struct Scene {
  TriangleMesh mesh;
  std::optional<Skeleton> skeleton;
  Paint paint = Paint::kUniform;
  std::vector<VertexColour> colours;
  std::vector<std::array<float, 2>> corner_uv;
  View view;
  DrawOptions options;
};

Image draw_scene(const Scene& scene) {
  GlContext gl;
  SurfacePaint paint;
  paint.paint = scene.paint;
  if (!scene.colours.empty()) paint.colours = upload_colours(scene.colours);
  if (!scene.corner_uv.empty()) paint.corner_uv = gl_buffer(scene.corner_uv);
  const DrawOptions& options = scene.options;
  const Camera camera = fit_camera(scene.view, scene.mesh.positions, options.width, options.height);
  Image image = draw(gl, upload_surface(gl, scene.mesh), paint, camera, options);
  if (scene.skeleton) draw_skeleton(gl, *scene.skeleton, bounding_box(scene.mesh).diagonal(), camera, options, image);
  return image;
}

/// \param options_json  from render() of the package
/// \return linear colour, premultiplied by opacity
py::array render(const Points& vertices, const Indices& triangles, const std::optional<Bytes>& colours,
                 const std::optional<Numbers>& corner_uv, const std::optional<py::tuple>& skeleton,
                 const std::string& options_json) {
  const Json json = parse_own_json(options_json);
  Scene scene;
  scene.mesh = mesh_of(vertices, triangles);
  const UnitFrame frame = unit_frame(scene.mesh);
  scene.mesh = in_frame(std::move(scene.mesh), frame);
  if (skeleton) scene.skeleton = in_frame(skeleton_of(*skeleton), frame);
  try {
    scene.view = parse_view(json["view"], "view");
  } catch (const IoError& error) {
    throw InputError(error.what());  // it is no file here
  }
  for (std::optional<Vec3>* point : {&scene.view.target, &scene.view.eye})
    if (*point) *point = frame.from_user(**point);
  if (json["normals"]) scene.paint = Paint::kNormal;
  if (colours) {
    scene.colours = colours_of(*colours);
    scene.paint = scene.colours.size() == scene.mesh.positions.size() ? Paint::kVertex : Paint::kFace;
  }
  if (corner_uv) {
    scene.paint = Paint::kChecker;
    scene.corner_uv.resize(3 * scene.mesh.triangles.size());
    std::memcpy(scene.corner_uv.data(), corner_uv->data(), scene.corner_uv.size() * sizeof(scene.corner_uv[0]));
  }
  scene.options.width = json["width"];
  scene.options.height = json["height"];
  scene.options.samples = json["samples"];
  scene.options.is_flat = json["flat"];
  scene.options.lighting = json["lighting"];
  if (json["wireframe"]) scene.options.wire_pixels = 0.45;
  Image image;
  {
    const py::gil_scoped_release released;
    image = draw_scene(scene);
  }
  return image_array(image);
}

/// Coordinates of a checker per corner of the triangles of the model's reconstruction: triangles x 3 x 2.
py::array checker(const Model& model) {
  const SkeletexModel given = whole(model);
  const std::vector<std::array<float, 2>> corners = run([&](ClContext& context) {
    const PreparedModel prepared(given);
    return checker_coordinates(prepared, reconstruct_bind_mesh(context, prepared).mesh, kCheckerCells);
  });
  Numbers array({static_cast<py::ssize_t>(corners.size() / 3), py::ssize_t{3}, py::ssize_t{2}});
  std::memcpy(array.mutable_data(), corners.data(), corners.size() * sizeof(corners[0]));
  return array;
}

py::array texture_image(const Model& model, bool has_layout, int pixels) {
  const SkeletexModel given = whole(model);
  Image image;
  {
    const py::gil_scoped_release released;
    image = has_layout ? layout_image(given, pixels) : map_image(given, pixels);
  }
  return image_array(image);
}

std::string page(const Model& model, const std::optional<Model>& second,
                 const std::optional<std::pair<Points, Indices>>& reference, const std::string& options_json) {
  const Json json = parse_own_json(options_json);
  const SkeletexModel given = whole(model);
  PageOptions options;
  options.name = json["name"];
  if (!json["up"].is_null()) options.is_z_up = json["up"] == "z";
  std::optional<TriangleMesh> mesh;
  if (reference) {
    mesh = mesh_of(reference->first, reference->second);
    options.reference = &*mesh;
  }
  if (second) {
    SkeletexModel other = whole(*second);
    Correspondence correspondence =
        find_correspondence(given.skeleton, other.skeleton,
                            {.given = json["bones"].get<std::vector<std::pair<std::string, std::string>>>()});
    options.second.emplace(PageSecond{json["second_name"], std::move(other), std::move(correspondence)});
  }
  return run([&](ClContext& context) { return make_page(context, given, options); });
}

}  // namespace

void bind_draw(py::module_& module) {
  module.def("render", render);
  module.def("checker", checker);
  module.def("texture_image", texture_image);
  module.def("page", page);
  module.def("viridis", [](const Numbers& values) {  // of 0 to 1
    py::array_t<std::uint8_t> colours({values.size(), py::ssize_t{3}});
    for (py::ssize_t i = 0; i < values.size(); ++i) {
      const VertexColour colour = viridis(static_cast<double>(values.data()[i]));
      colours.mutable_at(i, 0) = colour.r;
      colours.mutable_at(i, 1) = colour.g;
      colours.mutable_at(i, 2) = colour.b;
    }
    return colours;
  });
  module.def("bone_colours", [](int count) {
    py::array_t<std::uint8_t> colours({py::ssize_t{count}, py::ssize_t{3}});
    for (int i = 0; i < count; ++i) {
      const VertexColour colour = bone_colour(i);
      colours.mutable_at(i, 0) = colour.r;
      colours.mutable_at(i, 1) = colour.g;
      colours.mutable_at(i, 2) = colour.b;
    }
    return colours;
  });
}

}  // namespace skeletex::python
