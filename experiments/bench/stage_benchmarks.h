// SPDX-License-Identifier: MIT
#pragma once
#include <functional>
#include <string>

#include "stages/stages.h"

/// The stages as Google Benchmark runs them; one program per stage.
namespace skeletex {

/// The one device of a benchmark program.
ClContext& bench_device();

/// A model by its name in configs/models, read and encoded once. "armadillo_fine" is the armadillo with at least 500
/// 000 triangles.
MeshInputPointer bench_mesh(const std::string& name);
TextureInputPointer bench_texture(const std::string& name, int size);

/// Registers "name/argument" with the time that counts; counters: ratio, reference_ms, wall_ms, device_ms, launches and
/// the stage's details. The stage is made when its turn comes.
void register_stage(const std::string& name, std::function<Stage()> make);

/// Each benchmark program registers its stages; main() adds the context (device, driver, compiler, git) and runs them.
void register_all();

}  // namespace skeletex
