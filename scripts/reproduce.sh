#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Installs what is missing, builds, and runs the main job: four real models become one texture each, with each of the
# three methods, and the textures become meshes again, which are measured. Prints a table; everything lies in
# results/main/. Options: scripts/reproduce.sh [SIZE [MODEL ...]], 512 and bear bunny00 armadillo man by default.
set -euo pipefail
cd "$(dirname "$0")/.."
size=${1:-512}
models=("${@:2}")
[ ${#models[@]} -gt 0 ] || models=(bear bunny00 armadillo man)

bash scripts/install-dependencies.sh
cmake --preset release
cmake --build --preset release --target skeletex

program=build/release/bin/skeletex
results=results/main
mkdir -p "$results"
runs=()
for model in "${models[@]}"; do
  skeleton=configs/skeletons/$model.skeleton.json
  [ -f "$skeleton" ] || { echo "reproduce: there is no $skeleton" >&2; exit 1; }
  mesh=build/meshes/$(sed -n 's/.*"mesh": *"\([^"]*\)".*/\1/p' "$skeleton")
  for method in spd vsm hybrid; do
    run=$results/$model-$method-$size
    echo "$model, $method"
    "$program" encode "$mesh" "$skeleton" -o "$run.skx.exr" --method "$method" --size "$size" --json "$run.encode.json" >/dev/null
    "$program" reconstruct "$run.skx.exr" -o "$run.ply" --json "$run.reconstruct.json" >/dev/null
    "$program" inspect "$run.ply" --json "$run.inspect.json" >/dev/null
    "$program" metro "$mesh" "$run.ply" --json "$run.metro.json" >/dev/null
    runs+=("$run")
  done
done

python3 - "${runs[@]}" <<'TABLE'
import json, pathlib, sys

print(f"\n{'model-method-size':<24}{'mean':>10}{'max':>10}{'vertices':>10}  {'closed, genus':<16}{'encode ms':>10}{'rebuild ms':>11}")
for run in sys.argv[1:]:
    encode, rebuild, mesh, metro = (json.loads(pathlib.Path(f"{run}.{part}.json").read_text()) for part in ("encode", "reconstruct", "inspect", "metro"))
    mean = (metro["forward"]["mean"] + metro["backward"]["mean"]) / 2
    largest = max(metro["forward"]["max"], metro["backward"]["max"])
    good = mesh["closed_manifold"] and mesh["components"] == 1 and mesh["genus"] == encode["mesh"]["genus"]
    print(f"{pathlib.Path(run).name:<24}{mean:>10.2e}{largest:>10.2e}{metro['vertex']['mean']:>10.2e}  {('yes, ' if good else 'NO, ') + str(mesh['genus']):<16}"
          f"{sum(encode['times_ms'].values()):>10.0f}{rebuild['times_ms']['reconstruct']:>11.0f}")
print("\nDistances are divided by the diagonal of the model's bounding box. mean, max: between the two surfaces, both directions, from points\n"
      "spread evenly; vertices: mean distance of the original's vertices.")
TABLE
echo "Models, meshes and reports: $results/"
