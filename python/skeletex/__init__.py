# SPDX-License-Identifier: MIT
"""A closed triangle mesh and its skeleton as one displacement texture.

>>> import skeletex
>>> mesh = skeletex.Mesh.read("bear.off")
>>> model = skeletex.encode(mesh, skeletex.Skeleton.read("bear.skeleton.json"), size=256)
>>> model.texture.shape
(256, 256, 3)
>>> skeletex.metro(mesh, model).mean < 1e-4
True

Meshes, skeletons and textures are numpy arrays. Functions take models and return new ones. See docs/python.md.
"""

from ._convert import encode, levels, lod, pose, random_pose, reconstruct, repair, skeletonize, validate
from ._core import version as __version__
from ._data import Mesh, Skeleton
from ._draw import Page, render, view, viridis
from ._edit import (
    Correspondence,
    add_noise,
    correspond,
    enhance,
    mean_curvature,
    mirror,
    morph,
    morphs,
    regular_grid,
    smooth,
    transfer,
)
from ._errors import (
    Cancelled,
    DeviceError,
    Error,
    Finding,
    InputError,
    InputWarning,
    InvalidInput,
    IoError,
    TopologyError,
)
from ._measure import (
    Deformation,
    Device,
    Distances,
    Metro,
    deformation,
    devices,
    distances,
    metro,
    triangle_bones,
    use_device,
    without_thin_triangles,
)
from ._model import Model, Patch, model_levels, write_levels

__all__ = [
    "Cancelled",
    "Correspondence",
    "Deformation",
    "Device",
    "DeviceError",
    "Distances",
    "Error",
    "Finding",
    "InputError",
    "InputWarning",
    "InvalidInput",
    "IoError",
    "Mesh",
    "Metro",
    "Model",
    "Page",
    "Patch",
    "Skeleton",
    "TopologyError",
    "__version__",
    "add_noise",
    "correspond",
    "deformation",
    "devices",
    "distances",
    "encode",
    "enhance",
    "levels",
    "lod",
    "mean_curvature",
    "metro",
    "mirror",
    "model_levels",
    "morph",
    "morphs",
    "pose",
    "random_pose",
    "regular_grid",
    "reconstruct",
    "render",
    "repair",
    "skeletonize",
    "smooth",
    "transfer",
    "triangle_bones",
    "use_device",
    "validate",
    "view",
    "viridis",
    "without_thin_triangles",
    "write_levels",
]
