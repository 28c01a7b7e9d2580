# SPDX-License-Identifier: MIT
"""The model: one texture and what it needs to become a mesh again."""

from __future__ import annotations

import json
import os
from typing import Any, Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._data import Path, Skeleton
from ._errors import InputError


class Patch(NamedTuple):
    """The rectangle of a bone in the texture: rows ``y .. y + height``, columns ``x .. x + width``."""

    x: int
    y: int
    width: int
    height: int
    method: str  #: ``"spd"`` or ``"vsm"``
    topology: str
    row_u: NDArray[np.float64]  #: where each row lies along the bone, from 0 at the head to 1 at the tail


class Model:
    """A displacement texture with its skeleton and seams. :func:`skeletex.encode` and :meth:`Model.read` make models.

    ``texture`` is the model's own memory: what is written there is in the next mesh, picture or file. Functions of the
    package return new models and leave theirs as they are.
    """

    def __init__(self, core: _core.Model, report: Optional[Dict[str, Any]] = None) -> None:
        self._core = core
        self._texture: NDArray[np.float32] = np.moveaxis(core.planes, 0, -1)
        self.report = report  #: how it was made, where this process has encoded it: per bone, and times in ms

    @staticmethod
    def read(path: Path, level: int = 0) -> Model:
        """Reads a model file (.skx.exr).

        :param level: of a file of several; 0 is the finest
        :raises IoError: where the file is damaged or has no such level
        """
        return Model(_core.read_model(os.fspath(path), level))

    def write(self, path: Path, half: bool = False) -> None:
        """Writes a model file. The file is there when it is complete.

        :param half: 16 bits a channel
        :raises IoError: and leaves no file behind
        """
        write_levels(path, [self], half)

    @property
    def texture(self) -> NDArray[np.float32]:
        """height x width x 3, float32: along, around, out. A view; edit it in place, or set it to another array.

        A texel is the direction from a point of the bone to the surface, in the frame of the bone, as long as the
        surface is away from the bone. It is measured in ``unit``, the diagonal of the input mesh. The first and last
        row of a patch lie on seams, which are stored apart: editing them does not move the surface.
        """
        return self._texture

    @texture.setter
    def texture(self, values: ArrayLike) -> None:
        given = np.asarray(values)
        if given.shape != self._texture.shape:
            raise InputError(f"texture: an array of shape {self._texture.shape} is wanted, this one is {given.shape}")
        if given.dtype.kind not in "fiub":
            raise InputError("texture: an array of real numbers is wanted")
        self._texture[...] = given

    @property
    def width(self) -> int:
        """Columns of the texture."""
        return int(self._texture.shape[1])

    @property
    def height(self) -> int:
        """Rows of the texture."""
        return int(self._texture.shape[0])

    @property
    def skeleton(self) -> Skeleton:
        """A copy of the skeleton in its bind pose, in the user's units."""
        return Skeleton._of(self._core.skeleton)

    @property
    def patches(self) -> Dict[str, Patch]:
        """The rectangle of each bone, by its name."""
        names = self._core.skeleton[2]
        return {name: Patch(*row) for name, row in zip(names, self._core.patches)}

    def patch(self, bone: str) -> NDArray[np.float32]:
        """The texels of a bone, height x width x 3: a view of the texture, to be edited in place.

        :raises InputError: where there is no bone of that name
        """
        patches = self.patches
        if bone not in patches:
            raise InputError(f'there is no bone "{bone}"; there are {", ".join(patches)}')
        p = patches[bone]
        return self._texture[p.y : p.y + p.height, p.x : p.x + p.width]

    @property
    def layers(self) -> Dict[str, NDArray[np.float32]]:
        """Copies of the quantities beside the place, by name, each planes x height x width."""
        return dict(self._core.layers)

    @property
    def genus(self) -> int:
        """Number of handles of the surface."""
        return self._core.genus

    @property
    def up(self) -> Optional[Tuple[float, float, float]]:
        """The direction that is up; None: not known."""
        return None if self._core.stance is None else self._core.stance[0]

    @property
    def front(self) -> Optional[Tuple[float, float, float]]:
        """Where the model looks; None: not known."""
        return None if self._core.stance is None else self._core.stance[1]

    @property
    def unit(self) -> float:
        """What 1 in the texture is in the user's units."""
        return self._core.unit

    @property
    def diagonal(self) -> float:
        """Of the input mesh's bounding box, in the user's units."""
        return self._core.diagonal

    @property
    def settings(self) -> Dict[str, Any]:
        """How the model was made, as its file says. Nothing depends on it."""
        settings = json.loads(self._core.settings or "{}")
        return settings if isinstance(settings, dict) else {}

    def copy(self) -> Model:
        """A model of its own, with a texture of its own."""
        return Model(self._core.copy(), self.report)

    def __copy__(self) -> Model:
        return self.copy()

    def __deepcopy__(self, memo: Dict[int, Any]) -> Model:
        return self.copy()

    def __repr__(self) -> str:
        return f"Model({self.width} x {self.height} texels, {len(self.patches)} bones)"


def write_levels(path: Path, models: Sequence[Model], half: bool = False) -> None:
    """Writes levels of detail as one file, the finest first, see :func:`skeletex.levels`.

    :param half: 16 bits a channel
    :raises IoError: and leaves no file behind
    """
    _core.write_models(os.fspath(path), [model._core for model in models], half)


def model_levels(path: Path) -> List[List[int]]:
    """Width and height of every level of a model file."""
    return [list(size) for size in _core.model_levels(os.fspath(path))]
