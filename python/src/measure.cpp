// SPDX-License-Identifier: MIT
#include <algorithm>

#include "bind.h"
#include "skeletex/analysis/deformation.h"
#include "skeletex/analysis/manifold.h"
#include "skeletex/analysis/metro.h"
#include "skeletex/reconstruct/prepared_model.h"
#include "skeletex/reconstruct/thin_triangles.h"
#include "skeletex/render/scene.h"

namespace skeletex::python {
namespace {

py::tuple tuple_of(const DistanceStatistics& s) { return py::make_tuple(s.mean, s.std, s.rms, s.max); }

py::tuple metro(const Points& a_vertices, const Indices& a_triangles, const Points& b_vertices,
                const Indices& b_triangles, long samples) {
  const TriangleMesh a = mesh_of(a_vertices, a_triangles), b = mesh_of(b_vertices, b_triangles);
  const MetroReport report =
      run([&](ClContext& context) { return measure_metro(context, a, b, {.samples = samples}); });
  return py::make_tuple(report.diagonal, tuple_of(report.forward), tuple_of(report.backward), tuple_of(report.vertex),
                        array_of(report.vertex_distances));
}

py::array distances(const Points& vertices, const Indices& triangles, const Points& points) {
  const TriangleMesh mesh = mesh_of(vertices, triangles);
  const std::vector<Vec3> places = points_of(points, "points");
  return array_of(run([&](ClContext& context) { return closest_distances(context, mesh, places); }));
}

py::dict manifold(const Points& vertices, const Indices& triangles) {
  const TriangleMesh mesh = mesh_of(vertices, triangles);
  ManifoldReport report;
  {
    const py::gil_scoped_release released;
    report = measure_manifold(mesh);
  }
  py::dict dict;
  dict["vertices"] = report.vertices;
  dict["edges"] = report.edges;
  dict["triangles"] = report.triangles;
  dict["components"] = report.components;
  dict["genus"] = report.genus;
  dict["is_closed_manifold"] = report.is_closed_manifold();
  return dict;
}

py::tuple without_thin_triangles_of(const Points& vertices, const Indices& triangles) {
  const TriangleMesh mesh = mesh_of(vertices, triangles);
  ReducedMesh reduced;
  {
    const py::gil_scoped_release released;
    reduced = without_thin_triangles(mesh);
  }
  return py::make_tuple(arrays_of({values_of(reduced, mesh.positions), reduced.triangles}), array_of(reduced.vertices));
}

/// \param bind, posed  vertices of one mesh
py::dict deformation(const Points& bind, const Indices& triangles, const Points& posed) {
  const TriangleMesh mesh = mesh_of(bind, triangles);
  const std::vector<Vec3> places = points_of(posed, "vertices");
  if (places.size() != mesh.positions.size())
    throw InputError("deformation: the two meshes have different numbers of vertices");
  DeformationReport report;
  {
    const py::gil_scoped_release released;
    report = measure_deformation(make_bind_surface(mesh), places);
  }
  py::dict dict;
  dict["new_folds"] = report.new_folds;
  dict["new_intersections"] = report.new_intersections;
  dict["volume_ratio"] = report.volume_ratio;
  dict["energy_mean"] = report.energy_mean;
  dict["energy_99"] = report.energy_99;
  return dict;
}

}  // namespace

void bind_measure(py::module_& module) {
  module.def("metro", metro);
  module.def("without_thin_triangles", without_thin_triangles_of);
  module.def("distances", distances);
  module.def("manifold", manifold);
  module.def("deformation", deformation);
  module.def("triangle_bones", [](const Model& model, const Indices& triangles) {
    const std::vector<Triangle> list = triangles_of(triangles);
    const Lattice lattice = number_lattice(*model.rest);
    if (static_cast<int>(list.size()) != lattice.triangle_count ||
        std::any_of(list.begin(), list.end(), [&](const Triangle& t) {
          return std::any_of(t.begin(), t.end(), [&](int v) { return v < 0 || v >= lattice.vertex_count; });
        }))
      throw InputError("triangle_bones: the triangles are not those of a reconstruction of the model");
    return array_of(triangle_bones(lattice, list));
  });
  module.def("devices", [] {
    py::list list;
    for (const ClDeviceInfo& device : list_devices())
      list.append(py::make_tuple(device.index, device.platform, device.name, device.type));
    return list;
  });
  module.def("use_device", choose_device);
  module.def("device", [] { return run([](ClContext& context) { return context.device().name; }); });
}

}  // namespace skeletex::python
