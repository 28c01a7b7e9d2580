// SPDX-License-Identifier: MIT
// Filters on the device, beside a device copy of as many floats: smoothing, noise, and one application of the surface's
// operator.
#include <fmt/format.h>

#include "skeletex/edit/filter/differential.h"
#include "skeletex/edit/filter/filter.h"
#include "stage_benchmarks.h"

namespace skeletex {
namespace {

Stage stage_on(const std::string& name, const TextureInput& input, std::size_t floats) {
  Stage stage;
  stage.name = name;
  stage.model = input.name;
  stage.size = input.model.texture.width;
  stage.reference = "device copy of the same bytes";
  stage.is_device_time = true;
  stage.run_reference = device_copy(bench_device(), floats);
  return stage;
}

/// (M + t L) x of three components.
Stage apply_stage(TextureInputPointer input) {
  struct Operator {
    explicit Operator(const SkeletexModel& model)
        : surface(upload_surface(bench_device(), model)),
          laplace(make_surface_operator(bench_device(), surface.neighbours, surface.points)),
          everywhere(bench_device().upload(std::vector<float>(surface.neighbours.vertex_count, 1.f))) {}
    ModelSurface surface;
    SurfaceOperator laplace;
    ClBuffer<float> everywhere;
  };
  const auto made = std::make_shared<Operator>(input->model);
  Stage stage = stage_on("apply", *input, 2 * made->surface.points.values.size);
  stage.run = [made] {
    apply_operator(bench_device(), made->laplace, 1, 1e-4f, made->everywhere, made->surface.points);
  };
  return stage;
}

Stage noise_stage(TextureInputPointer input) {
  Stage stage = stage_on("noise", *input, 6 * input->model.texture.out.size());
  stage.run = [input] { add_noise(bench_device(), input->model); };
  return stage;
}

}  // namespace

void register_all() {
  for (const std::string name : {"bunny00", "armadillo", "armadillo_fine"})
    for (const int size : {256, 512, 1024, 2048, 4096}) {
      register_stage(fmt::format("filter/{}/{}", name, size),
                     [=] { return filter_stage(bench_device(), bench_texture(name, size)); });
      register_stage(fmt::format("noise/{}/{}", name, size), [=] { return noise_stage(bench_texture(name, size)); });
      register_stage(fmt::format("apply/{}/{}", name, size), [=] { return apply_stage(bench_texture(name, size)); });
    }
}

}  // namespace skeletex
