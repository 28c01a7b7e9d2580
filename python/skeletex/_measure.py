# SPDX-License-Identifier: MIT
"""Distances, poses and devices."""

from __future__ import annotations

from typing import List, NamedTuple, Tuple, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._convert import reconstruct, whole
from ._data import Mesh, real_array
from ._errors import InputError
from ._model import Model


def mesh_of(surface: Union[Mesh, Model]) -> Mesh:
    """The mesh, or that of a model."""
    return reconstruct(surface) if isinstance(surface, Model) else surface


class Distances(NamedTuple):
    """Distances divided by the diagonal of the first surface."""

    mean: float
    std: float  #: about the mean
    rms: float
    max: float  #: over the points that were measured


class Metro(NamedTuple):
    """How far two surfaces are apart, see :func:`metro`."""

    diagonal: float  #: of the first surface's bounding box
    forward: Distances  #: from points on the first surface to the second
    backward: Distances  #: from points on the second surface to the first
    vertex: Distances  #: from the first surface's vertices to the second, as the paper measures
    vertex_distances: NDArray[np.float32]  #: one per vertex of the first surface, in the user's units

    @property
    def mean(self) -> float:
        """The symmetric surface mean, divided by the diagonal."""
        return (self.forward.mean + self.backward.mean) / 2

    @property
    def max(self) -> float:
        """The larger of both maxima, divided by the diagonal."""
        return max(self.forward.max, self.backward.max)

    def __repr__(self) -> str:
        return f"Metro(mean={self.mean:.4g}, max={self.max:.4g}, diagonal={self.diagonal:.6g})"


def metro(a: Union[Mesh, Model], b: Union[Mesh, Model], samples: int = 0) -> Metro:
    """Measures the distance between two surfaces in both directions, as the metro tool and the paper do.

    :param a: usually the original; its diagonal is the unit
    :param samples: points on each surface; 0: ten per vertex, at least 100 000
    :raises InputError: where a mesh is empty or has no area
    """
    first, second = mesh_of(a), mesh_of(b)
    diagonal, forward, backward, vertex, distances = _core.metro(
        first.vertices, first.triangles, second.vertices, second.triangles, whole(samples, "samples", 0, 10**9)
    )
    return Metro(diagonal, Distances(*forward), Distances(*backward), Distances(*vertex), distances)


def distances(mesh: Union[Mesh, Model], points: ArrayLike) -> NDArray[np.float32]:
    """Distance from each of n x 3 points to the nearest point of a surface, in the user's units."""
    surface = mesh_of(mesh)
    return _core.distances(surface.vertices, surface.triangles, real_array(points, 3, "points"))


def without_thin_triangles(mesh: Mesh) -> Tuple[Mesh, NDArray[np.int32]]:
    """A mesh without triangles that have an angle below 5 degrees, where the surface stays without them.

    ``skeletex reconstruct`` writes such meshes; :func:`reconstruct` gives one vertex per texel. For the same triangles
    in a pose take ``posed.vertices[vertices]``.

    :return: the mesh, and per vertex its number in the given one
    :raises InputError: where the mesh is not closed, oriented and 2-manifold
    """
    reduced, vertices = _core.without_thin_triangles(*mesh._checked())
    return Mesh(*reduced), vertices


class Deformation(NamedTuple):
    """What a pose does to a surface, see :func:`deformation`."""

    new_folds: int  #: edges over which it turns by more than 90 degrees, and did not before
    new_intersections: int  #: pairs of triangles
    volume_ratio: float
    energy_mean: float  #: symmetric Dirichlet energy; 1 where nothing is stretched
    energy_99: float  #: 99 % of the area lie below


def deformation(bind: Mesh, posed: Mesh) -> Deformation:
    """Compares the mesh of a pose with that of the bind pose.

    :raises InputError: where the two do not have the same triangles
    """
    vertices, triangles = bind._checked()
    if not np.array_equal(triangles, posed.triangles):
        raise InputError("deformation: the two meshes do not have the same triangles")
    return Deformation(**_core.deformation(vertices, triangles, posed._checked()[0]))


def triangle_bones(model: Model, mesh: Mesh) -> NDArray[np.int32]:
    """The number of the bone of each triangle of a model's mesh, in any pose.

    :raises InputError: where the mesh is not one of the model, at its own size
    """
    return _core.triangle_bones(model._core, mesh.triangles)


class Device(NamedTuple):
    """An OpenCL device."""

    number: int
    platform: str
    name: str
    type: str  #: ``"cpu"``, ``"gpu"`` or ``"accelerator"``


def devices() -> List[Device]:
    """All OpenCL devices."""
    return [Device(*row) for row in _core.devices()]


def use_device(selector: Union[str, int] = "") -> str:
    """Computes on another device from now on, and says its name.

    :param selector: its number, a part of its name, ``"cpu"`` or ``"gpu"``; empty: the variable SKELETEX_DEVICE, else
        the first GPU, else the first device
    :raises DeviceError: listing the devices where there is no such
    """
    _core.use_device(str(selector))
    return _core.device()
