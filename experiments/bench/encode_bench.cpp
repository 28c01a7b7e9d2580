// SPDX-License-Identifier: MIT
// The whole command `skeletex encode`, process and files included, beside OpenMesh reading the mesh and OpenEXR writing
// as many texels; and what snapping adds to it, beside its parameterization.
#include <fmt/format.h>

#include <filesystem>

#include "stage_benchmarks.h"

namespace skeletex {

void register_all() {
  const std::string program = std::filesystem::read_symlink("/proc/self/exe").replace_filename("skeletex");
  for (const std::string name : {"bear", "bunny00", "armadillo", "armadillo_fine"})
    for (const int size : {256, 512, 1024, 2048, 4096})
      register_stage(fmt::format("encode/{}/{}", name, size),
                     [=] { return encode_stage(bench_mesh(name), size, program); });
  for (const std::string name : {"bunny00", "armadillo", "bear", "man", "homer"})
    for (const int size : {256, 512, 1024})
      register_stage(fmt::format("snap/{}/{}", name, size),
                     [=] { return snap_stage(bench_mesh(name), size, program); });
}

}  // namespace skeletex
