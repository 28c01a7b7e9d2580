# SPDX-License-Identifier: MIT
"""Meshes and skeletons as arrays."""

from __future__ import annotations

import os
from typing import Any, List, Optional, Sequence, Tuple, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._errors import InputError

Path = Union[str, "os.PathLike[str]"]
SkeletonTuple = Tuple[List[str], NDArray[np.float64], List[str], NDArray[np.int32], NDArray[np.float64]]


def real_array(values: ArrayLike, columns: int, name: str) -> NDArray[np.float64]:
    """A copy of n rows, of any type and order, as the library takes them."""
    try:
        array = np.array(values)
        if array.size == 0:
            array = np.zeros((0, columns))
        if array.dtype.kind not in "fiub":
            raise TypeError
        result = np.array(array, dtype=np.float64, order="C")
    except (TypeError, ValueError):
        raise InputError(f"{name}: an array of real numbers is wanted") from None
    if result.ndim != 2 or result.shape[1] != columns:
        raise InputError(f"{name}: an array of shape (n, {columns}) is wanted, this one is {result.shape}")
    return result


def index_array(values: ArrayLike, columns: int, name: str) -> NDArray[np.int32]:
    """The same of indices. Numbers with a fraction, or that 32 bits do not hold, are errors."""
    whole = real_array(values, columns, name)
    limits = np.iinfo(np.int32)
    if not np.all((whole == np.rint(whole)) & (whole >= limits.min) & (whole <= limits.max)):
        raise InputError(f"{name}: indices are whole numbers below 2^31")
    return np.asarray(whole, dtype=np.int32)


class Mesh:
    """An indexed triangle mesh. Triangles are counter-clockwise seen from outside.

    :param vertices: n x 3 numbers, of any type and memory order; copied.
    :param triangles: m x 3 indices of vertices; copied.
    :raises InputError: where the shapes are others
    """

    def __init__(self, vertices: ArrayLike, triangles: ArrayLike) -> None:
        self._vertices = real_array(vertices, 3, "vertices")
        self._triangles = index_array(triangles, 3, "triangles")

    @property
    def vertices(self) -> NDArray[np.float64]:
        """n x 3, float64. Can be edited in place, or set to something else."""
        return self._vertices

    @vertices.setter
    def vertices(self, values: ArrayLike) -> None:
        self._vertices = real_array(values, 3, "vertices")

    @property
    def triangles(self) -> NDArray[np.int32]:
        """m x 3, int32. Can be edited in place, or set to something else."""
        return self._triangles

    @triangles.setter
    def triangles(self, values: ArrayLike) -> None:
        self._triangles = index_array(values, 3, "triangles")

    @staticmethod
    def read(path: Path) -> Mesh:
        """The geometry of an OBJ, PLY, OFF, STL or glTF file. Polygons are split; vertices of STL files are welded.

        :raises IoError: saying what is wrong, and in which line
        """
        return Mesh(*_core.read_mesh(os.fspath(path)))

    def write(self, path: Path, colours: Optional[ArrayLike] = None) -> None:
        """Writes PLY, OBJ, STL or glTF (.glb) by the ending. The file is there when it is complete.

        :param colours: of PLY files, one per vertex or per triangle, as :func:`skeletex.render` takes them
        :raises IoError: and leaves no file behind
        """
        given = None if colours is None else colour_array(self, colours)
        if given is not None and not os.fspath(path).lower().endswith(".ply"):
            raise InputError(f"colours: only PLY files have them, not {os.fspath(path)}")
        _core.write_mesh(os.fspath(path), *self._checked(), given)

    @property
    def diagonal(self) -> float:
        """Length of the bounding box's diagonal; 0 without vertices."""
        if len(self.vertices) == 0:
            return 0.0
        return float(np.linalg.norm(self.vertices.max(axis=0) - self.vertices.min(axis=0)))

    def topology(self) -> dict[str, Any]:
        """Numbers of vertices, edges, triangles and components, the genus, and whether the mesh is a closed manifold."""
        return dict(_core.manifold(self.vertices, self.triangles))

    def _checked(self) -> Tuple[NDArray[np.float64], NDArray[np.int32]]:
        """The arrays, whose indices exist and whose numbers are finite."""
        if not np.isfinite(self.vertices).all():
            raise InputError("vertices: a coordinate is not finite")
        if self.triangles.size and (self.triangles.min() < 0 or self.triangles.max() >= len(self.vertices)):
            raise InputError(f"triangles: an index is not from 0 to {len(self.vertices) - 1}")
        return self.vertices, self.triangles

    def __repr__(self) -> str:
        return f"Mesh({len(self.vertices)} vertices, {len(self.triangles)} triangles)"


def colour_array(mesh: Mesh, colours: ArrayLike) -> NDArray[np.uint8]:
    """sRGB bytes per vertex or per triangle. Numbers are of 0 to 1, integers of 0 to 255."""
    given = np.asarray(colours)
    counts = (len(mesh.vertices), len(mesh.triangles))
    if given.ndim != 2 or given.shape[1] != 3 or len(given) not in counts:
        raise InputError(
            f"colours: an array of shape (n, 3) is wanted, with n the {counts[0]} vertices or {counts[1]} triangles; "
            f"this one is {given.shape}"
        )
    if given.dtype.kind in "iub":
        return np.asarray(np.clip(given, 0, 255), dtype=np.uint8)
    shares = np.clip(np.nan_to_num(given.astype(np.float64)), 0, 1)
    return np.asarray(np.rint(255 * shares), dtype=np.uint8)


class Skeleton:
    """A graph of bones. Any node may have any number of bones, and there may be cycles.

    :param nodes: n x 3 places
    :param bones: m x 2 indices of nodes, head and tail
    :param node_names: default: node_0, ..
    :param bone_names: default: bone_0, ..
    :param s: m x 3, each bone's direction of angle 0; rows of NaN, or None, leave it to the library
    :raises InputError: where shapes or names do not fit
    """

    def __init__(
        self,
        nodes: ArrayLike,
        bones: ArrayLike,
        node_names: Optional[Sequence[str]] = None,
        bone_names: Optional[Sequence[str]] = None,
        s: Optional[ArrayLike] = None,
    ) -> None:
        self.nodes: NDArray[np.float64] = real_array(nodes, 3, "nodes")
        self.bones: NDArray[np.int32] = index_array(bones, 2, "bones")
        self.node_names: List[str] = _names(node_names, len(self.nodes), "node")
        self.bone_names: List[str] = _names(bone_names, len(self.bones), "bone")
        self.s: NDArray[np.float64] = (
            np.full((len(self.bones), 3), np.nan) if s is None else real_array(s, 3, "s")
        )
        if len(self.s) != len(self.bones):
            raise InputError(f"s: {len(self.s)} directions for {len(self.bones)} bones")

    @staticmethod
    def read(path: Path) -> Skeleton:
        """Reads a skeleton file (JSON).

        :raises IoError: naming line or entry
        """
        return Skeleton._of(_core.read_skeleton(os.fspath(path)))

    def write(self, path: Path) -> None:
        """Writes a skeleton file (JSON)."""
        _core.write_skeleton(os.fspath(path), self._checked())

    def bone(self, name: str) -> int:
        """The number of a bone.

        :raises InputError: where there is none of that name
        """
        return _index(self.bone_names, name, "bone")

    def node(self, name: str) -> int:
        """The number of a node.

        :raises InputError: where there is none of that name
        """
        return _index(self.node_names, name, "node")

    @staticmethod
    def _of(parts: SkeletonTuple) -> Skeleton:
        node_names, nodes, bone_names, bones, s = parts
        return Skeleton(nodes, bones, node_names, bone_names, s)

    def _tuple(self) -> SkeletonTuple:
        # Members may have been set since.
        checked = Skeleton(self.nodes, self.bones, self.node_names, self.bone_names, self.s)
        return checked.node_names, checked.nodes, checked.bone_names, checked.bones, checked.s

    def _checked(self) -> SkeletonTuple:
        """The parts, whose indices exist and whose numbers are finite."""
        parts = self._tuple()
        if not np.isfinite(parts[1]).all():
            raise InputError("nodes: a coordinate is not finite")
        if parts[3].size and (parts[3].min() < 0 or parts[3].max() >= len(parts[1])):
            raise InputError(f"bones: an index is not from 0 to {len(parts[1]) - 1}")
        return parts

    def __repr__(self) -> str:
        return f"Skeleton({len(self.nodes)} nodes, {len(self.bones)} bones)"


def _names(names: Optional[Sequence[str]], count: int, kind: str) -> List[str]:
    result = [f"{kind}_{i}" for i in range(count)] if names is None else [str(name) for name in names]
    if len(result) != count:
        raise InputError(f"{kind}_names: {len(result)} names for {count} {kind}s")
    if len(set(result)) != count:
        twice = next(name for name in result if result.count(name) > 1)
        raise InputError(f'{kind}_names: "{twice}" occurs twice')
    return result


def _index(names: List[str], name: str, kind: str) -> int:
    if name not in names:
        raise InputError(f'there is no {kind} "{name}"; there are {", ".join(names)}')
    return names.index(name)
