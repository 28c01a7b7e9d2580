// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "bind.h"
#include "skeletex/io/atomic_file.h"
#include "skeletex/io/mesh_file.h"
#include "skeletex/io/model_file.h"
#include "skeletex/io/skeleton_file.h"

namespace skeletex::python {
namespace {

std::size_t texel_count(const SkeletexModel& model) {
  return static_cast<std::size_t>(model.texture.width) * static_cast<std::size_t>(model.texture.height);
}

/// A texel of a patch; those between patches hold anything.
void check_texels(const SkeletexModel& model) {
  constexpr const char* kNames[] = {"along", "around", "out"};
  const auto limit = static_cast<float>(kMostDiagonals * model.diagonal);
  const std::vector<float>* planes[] = {&model.texture.along, &model.texture.around, &model.texture.out};
  for (const Patch& patch : model.patches)
    for (int plane = 0; plane < 3; ++plane)
      for (int y = patch.rectangle.y; y < patch.rectangle.y + patch.rectangle.height; ++y) {
        const float* const row = planes[plane]->data() + static_cast<std::size_t>(y) * model.texture.width;
        for (int x = patch.rectangle.x; x < patch.rectangle.x + patch.rectangle.width; ++x)
          if (!(std::abs(row[x]) <= limit))
            throw InputError(
                fmt::format("texture[{}, {}, {}], the part {} of a texel, is {}; texels are finite and at "
                            "most {:g} diagonals long",
                            y, x, plane, kNames[plane], row[x], kMostDiagonals));
      }
}

py::list patches_list(const Model& model) {
  py::list list;
  for (const Patch& patch : model.rest->patches) {
    const Rectangle& r = patch.rectangle;
    list.append(py::make_tuple(r.x, r.y, r.width, r.height, to_string(patch.method), to_string(patch.topology),
                               array_of(patch.row_u)));
  }
  return list;
}

py::dict layers_dict(const Model& model) {
  py::dict dict;
  const py::ssize_t height = model.rest->texture.height, width = model.rest->texture.width;
  for (const Layer& layer : model.rest->layers) {
    Numbers planes({static_cast<py::ssize_t>(layer.planes.size()), height, width});
    float* to = planes.mutable_data();
    for (const std::vector<float>& plane : layer.planes) to = std::copy(plane.begin(), plane.end(), to);
    dict[py::str(layer.name)] = planes;
  }
  return dict;
}

Model copy_of(const Model& model) {
  Numbers planes({model.planes.shape(0), model.planes.shape(1), model.planes.shape(2)});
  std::copy(model.planes.data(), model.planes.data() + model.planes.size(), planes.mutable_data());
  return {model.rest, planes};
}

void bind_files(py::module_& module) {
  module.def("read_mesh", [](const std::string& path) {
    MeshFile file;
    {
      const py::gil_scoped_release released;
      file = skeletex::read_mesh(path);
    }
    return arrays_of(file.mesh);
  });
  module.def("write_mesh", [](const std::string& path, const Points& vertices, const Indices& triangles,
                              const std::optional<Bytes>& colours) {
    const TriangleMesh mesh = mesh_of(vertices, triangles);
    std::vector<VertexColour> values;
    if (colours)
      for (py::ssize_t i = 0; i < colours->shape(0); ++i)
        values.push_back({colours->at(i, 0), colours->at(i, 1), colours->at(i, 2)});
    WrittenAttributes attributes;
    (values.size() == mesh.positions.size() ? attributes.vertex_colours : attributes.face_colours) = values;
    const py::gil_scoped_release released;
    skeletex::write_mesh(path, mesh, attributes);
  });
  module.def("read_skeleton", [](const std::string& path) { return tuple_of(skeletex::read_skeleton(path)); });
  module.def("write_skeleton", [](const std::string& path, const py::tuple& skeleton) {
    write_text_atomically(path, skeleton_to_json(skeleton_of(skeleton)).dump(2) + '\n');
  });
  module.def("read_model", [](const std::string& path, int level) {
    SkeletexModel model;
    {
      const py::gil_scoped_release released;
      model = skeletex::read_model(path, level);
    }
    return model_of(std::move(model));
  });
  module.def("model_levels", [](const std::string& path) { return read_model_levels(path); });
  module.def("write_models", [](const std::string& path, const std::vector<Model>& levels, bool is_half) {
    std::vector<SkeletexModel> models;
    for (const Model& level : levels) models.push_back(whole(level));
    const py::gil_scoped_release released;
    write_model_levels(path, models, {.format = is_half ? TexelFormat::kHalf : TexelFormat::kFloat});
  });
}

}  // namespace

Model model_of(SkeletexModel model) {
  const std::size_t count = texel_count(model);
  Numbers planes({py::ssize_t{3}, py::ssize_t{model.texture.height}, py::ssize_t{model.texture.width}});
  float* to = planes.mutable_data();
  for (std::vector<float>* plane : {&model.texture.along, &model.texture.around, &model.texture.out}) {
    to = std::copy_n(plane->begin(), count, to);
    *plane = {};
  }
  return {std::make_shared<const SkeletexModel>(std::move(model)), planes};
}

SkeletexModel whole(const Model& model) {
  SkeletexModel result = *model.rest;
  const std::size_t count = texel_count(result);
  const float* from = model.planes.data();
  for (std::vector<float>* plane : {&result.texture.along, &result.texture.around, &result.texture.out}) {
    plane->assign(from, from + count);
    from += count;
  }
  check_texels(result);
  return result;
}

void bind_model(py::module_& module) {
  py::class_<Model>(module, "Model", "A model; its texels are an array of Python.")
      .def_property_readonly("planes", [](const Model& model) { return model.planes; })
      .def_property_readonly("genus", [](const Model& model) { return model.rest->genus; })
      .def_property_readonly("stance",
                             [](const Model& model) -> std::optional<py::tuple> {
                               const std::optional<Stance>& stance = model.rest->stance;
                               if (!stance) return std::nullopt;
                               const auto& [up, front] = *stance;
                               return py::make_tuple(py::make_tuple(up.x(), up.y(), up.z()),
                                                     py::make_tuple(front.x(), front.y(), front.z()));
                             })
      .def_property_readonly("unit", [](const Model& model) { return model.rest->skeleton.frame.scale; })
      .def_property_readonly("diagonal",
                             [](const Model& model) { return model.rest->diagonal * model.rest->skeleton.frame.scale; })
      .def_property_readonly("settings", [](const Model& model) { return model.rest->encoder_settings; })
      .def_property_readonly("skeleton", [](const Model& model) { return tuple_of(model.rest->skeleton); })
      .def_property_readonly("patches", patches_list)
      .def_property_readonly("layers", layers_dict)
      .def("copy", copy_of);
  bind_files(module);
}

}  // namespace skeletex::python
