// SPDX-License-Identifier: MIT
// Live morphs and transfers, beside a device copy of as many bytes.
#include <fmt/format.h>

#include "stage_benchmarks.h"

namespace skeletex {

void register_all() {
  for (const auto& [a, b] : {std::pair<std::string, std::string>{"bear", "bear_bis"}, {"man", "homer"}})
    for (const int size : {256, 512, 1024, 2048, 4096}) {
      register_stage(fmt::format("morph/{}/{}/{}", a, b, size), [=, a = a, b = b] {
        return morph_stage(bench_device(), bench_texture(a, size), bench_texture(b, size));
      });
      register_stage(fmt::format("transfer/{}/{}/{}", a, b, size), [=, a = a, b = b] {
        return transfer_stage(bench_device(), bench_texture(a, size), bench_texture(b, size));
      });
    }
}

}  // namespace skeletex
