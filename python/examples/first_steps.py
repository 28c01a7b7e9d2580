# SPDX-License-Identifier: MIT
"""First steps: a mesh and its skeleton become a texture, which is edited, posed, and turned into meshes and pictures.

    python3 python/examples/first_steps.py [FOLDER]        # pictures and files go there; default: build/examples
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import skeletex

ROOT = Path(__file__).resolve().parents[2]


def main(folder: Path) -> None:
    mesh = skeletex.Mesh.read(ROOT / "build/meshes/bear.off")
    skeleton = skeletex.Skeleton.read(ROOT / "configs/skeletons/bear.skeleton.json")
    for finding in skeletex.validate(mesh, skeleton):
        print(finding)

    model = skeletex.encode(mesh, skeleton, size=256)
    print(model, "with bones", ", ".join(skeleton.bone_names))
    print("distance to the mesh:", skeletex.metro(mesh, model))
    model.write(folder / "bear.skx.exr")

    # The texture is the model's own memory. Texels of a bone are vectors from the bone to the surface: longer ones make
    # larger ears. The first rows keep their length, so that the ears stay on the head. On a regular grid a row of texels
    # is a line around the bone; the texels of the model itself lie on vertices of the mesh where they can.
    edited = skeletex.regular_grid(model)
    for bone in ("left_ear", "right_ear"):
        ear = edited.patch(bone)
        along = np.linspace(0, np.pi / 2, len(ear), dtype=np.float32)
        ear *= 1 + 0.8 * np.sin(along)[:, None, None] ** 2

    wave = {"rotations": {"left_upper_arm": {"axis": [0, 0, 1], "degrees": 50}}}
    posed = skeletex.reconstruct(model, wave)
    posed.write(folder / "bear_posed.ply")
    print("the pose:", skeletex.deformation(skeletex.reconstruct(model), posed))

    pictures = {
        "the model": skeletex.render(model, size=(480, 480)),
        "its bones": skeletex.render(model, mode="segments", size=(480, 480)),
        "its texture": skeletex.render(model, mode="map", size=480),
        "larger ears": skeletex.render(edited, size=(480, 480)),
        "a pose": skeletex.render(model, wave, skeleton=True, size=(480, 480)),
        "smoothed": skeletex.render(skeletex.smooth(model, scale=0.03), size=(480, 480)),
    }
    figure, axes = plt.subplots(2, 3, figsize=(11, 7.8), constrained_layout=True)
    for axis, (title, picture) in zip(axes.flat, pictures.items()):
        axis.imshow(picture)
        axis.set_title(title)
        axis.set_axis_off()
    figure.savefig(folder / "first_steps.png", dpi=90)
    print(folder / "first_steps.png")


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "build/examples"
    target.mkdir(parents=True, exist_ok=True)
    main(target)
