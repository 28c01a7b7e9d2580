# SPDX-License-Identifier: MIT
"""A shape space of five quadrupeds: their mean and main components, in texture space.

    python3 python/examples/shape_space.py [FOLDER]        # the figure goes there; default: build/examples

The five have the same branching, so morph brings them to one layout, where their texels correspond. The principal
components of the five textures are weighted sums of them, so each point of the space is a morph with these weights, which
blends skeletons and seams, too.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import skeletex

ROOT = Path(__file__).resolve().parents[2]
NAMES = ("bull", "camel", "cow", "diplodocus", "triceratops")
SKELETONS = {"triceratops": "triceratops_17"}
SIZE = 128


def load(name: str) -> skeletex.Model:
    mesh = skeletex.Mesh.read(ROOT / f"build/meshes/{name}.off")
    skeleton = skeletex.Skeleton.read(ROOT / f"configs/skeletons/{SKELETONS.get(name, name)}.skeleton.json")
    if "tail" not in skeleton.bone_names:  # the cow: a short bone into the rump, so that all five branch alike
        pelvis, tail_root = skeleton.node("pelvis"), [-0.33, 0.14, 0]
        skeleton = skeletex.Skeleton(
            np.vstack([skeleton.nodes, tail_root]),
            np.vstack([skeleton.bones, [pelvis, len(skeleton.nodes)]]),
            skeleton.node_names + ["tail_root"],
            skeleton.bone_names + ["tail"],
        )
    size = mesh.diagonal  # the files' units differ; here all are of one size
    mesh.vertices /= size
    skeleton.nodes /= size
    return skeletex.encode(mesh, skeleton, size=SIZE)


def main(folder: Path) -> None:
    models = [load(name) for name in NAMES]
    count = len(models)

    # All in the layout of the first one: the models themselves, at the corners of the morph.
    corners = skeletex.morphs(models, np.eye(count), layout=0, creases=True)
    textures = np.stack([model.texture.ravel() for model in corners]).astype(np.float64)
    centred = textures - textures.mean(axis=0)
    # Few models, many texels: the eigenvectors of the Gram matrix say how much of each model a component holds.
    values, vectors = np.linalg.eigh(centred @ centred.T)
    values, vectors = values[::-1], vectors[:, ::-1]
    shares = values / values.sum()
    for i, share in enumerate(shares[:-1]):
        print(f"component {i + 1}: {100 * share:.1f} % of the variance")

    pictures = [(name, model) for name, model in zip(NAMES, corners)]
    mean = np.full(count, 1 / count)
    for i in range(2):
        step = vectors[:, i] / np.sqrt(count - 1)  # of the weights, for one standard deviation
        # As far as no weight is negative: the point stays between the models.
        steps = [-0.999 * (mean[step > 0] / step[step > 0]).min(), 0, 0.999 * (mean[step < 0] / -step[step < 0]).min()]
        for t, model in zip(steps, skeletex.morphs(models, [mean + t * step for t in steps], layout=0, size=2 * SIZE)):
            title = f"mean {t:+.2f} std of component {i + 1} ({100 * shares[i]:.0f} %)" if t else "mean"
            pictures.append((title, model))

    figure = plt.figure(figsize=(17, 10.5), constrained_layout=True)
    grid = figure.add_gridspec(3, 15)
    places = [grid[0, 3 * i : 3 * i + 3] for i in range(5)] + [
        grid[1 + i // 3, 5 * (i % 3) : 5 * (i % 3) + 5] for i in range(6)
    ]
    for place, (title, model) in zip(places, pictures):
        axis = figure.add_subplot(place)
        axis.imshow(skeletex.render(model, size=(480, 360), azimuth=-40, elevation=10))
        axis.set_title(title)
        axis.set_axis_off()
    figure.savefig(folder / "shape_space.png", dpi=64)
    print(folder / "shape_space.png")


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "build/examples"
    target.mkdir(parents=True, exist_ok=True)
    main(target)
