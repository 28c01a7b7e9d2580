// SPDX-License-Identifier: MIT
// Maps of all charts of a model by the default recipe, from charts to checked maps, beside Eigen's sparse factorization
// (double precision) of as many systems, which is given its matrices: on all processors, and on one.
#include <fmt/format.h>

#include "stage_benchmarks.h"

namespace skeletex {

void register_all() {
  for (const std::string name : {"bunny00", "armadillo", "bear", "man", "armadillo_fine"}) {
    register_stage(fmt::format("vsm/{}", name), [=] { return vsm_stage(bench_device(), bench_mesh(name)); });
    register_stage(fmt::format("vsm/{}/reference_on_one_thread", name),
                   [=] { return vsm_stage(bench_device(), bench_mesh(name), 1); });
  }
}

}  // namespace skeletex
