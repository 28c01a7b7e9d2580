# SPDX-License-Identifier: MIT
"""A sweep: error against texture size, by method, drawn with matplotlib.

    python3 python/examples/sweep.py [FOLDER]        # the figure goes there; default: build/examples
"""

from __future__ import annotations

import sys
from pathlib import Path

from matplotlib import pyplot as plt

import skeletex

ROOT = Path(__file__).resolve().parents[2]
SIZES = (32, 64, 128, 256)
METHODS = ("spd", "vsm")


def main(folder: Path) -> None:
    mesh = skeletex.Mesh.read(ROOT / "build/meshes/bunny00.off")
    skeleton = skeletex.Skeleton.read(ROOT / "configs/skeletons/bunny00.skeleton.json")

    means: dict[str, list[float]] = {method: [] for method in METHODS}
    for method in METHODS:
        for size in SIZES:
            model = skeletex.encode(mesh, skeleton, size=size, method=method)
            result = skeletex.metro(mesh, model)
            means[method].append(result.mean)
            times = (model.report or {})["times_ms"]
            print(f"{method} {size:4}: mean {result.mean:.2e}, max {result.max:.2e}, {sum(times.values()):.0f} ms")

    figure, axis = plt.subplots(figsize=(7, 5), constrained_layout=True)
    for method in METHODS:
        axis.loglog(SIZES, means[method], "o-", base=2, label=method.upper())
    axis.set_yscale("log", base=10)
    axis.set_xticks(SIZES, [f"{size} x {size}" for size in SIZES])
    axis.set_xlabel("texels")
    axis.set_ylabel("symmetric surface mean / diagonal")
    axis.set_title("bunny00: distance of the reconstruction from the mesh")
    axis.grid(True, which="both", alpha=0.3)
    axis.legend()
    figure.savefig(folder / "sweep.png", dpi=100)
    print(folder / "sweep.png")


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "build/examples"
    target.mkdir(parents=True, exist_ok=True)
    main(target)
