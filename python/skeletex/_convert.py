# SPDX-License-Identifier: MIT
"""From meshes to models and back."""

from __future__ import annotations

import json
import math
import operator
import os
import warnings
from pathlib import Path as FilePath
from typing import Any, Callable, Dict, List, Mapping, Optional, Sequence, Tuple, Union

from . import _core
from ._data import Mesh, Path, Skeleton
from ._errors import Finding, InputError, InputWarning, IoError
from ._model import Model

#: Called with the name of a stage and the share of work done; returning False cancels.
Progress = Callable[[str, float], Optional[bool]]
#: A pose as a pose file has it (docs/pose.md), as a dictionary, or the path of such a file.
Pose = Union[Mapping[str, Any], Path]


def to_json(value: Any, name: str) -> str:
    """JSON of what a user gave; arrays become lists.

    :raises InputError: where a part of it has no JSON
    """
    def plain(part: Any) -> Any:
        if hasattr(part, "tolist"):
            return part.tolist()
        raise TypeError(f"{type(part).__name__} is neither a number, a text, a list nor a dictionary")

    try:
        return json.dumps(value, allow_nan=False, default=plain)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: {error}") from None


def pose_json(pose: Pose) -> str:
    """The JSON of a pose."""
    if isinstance(pose, Mapping):
        return to_json(dict(pose), "pose")
    path = os.fspath(pose)
    try:
        text = FilePath(path).read_text(encoding="utf-8")
        json.loads(text)
    except (OSError, ValueError) as error:
        raise IoError(f"{path}: {error}") from None
    return text


def size_pair(size: Union[int, Tuple[int, int]], name: str, lowest: int, highest: int) -> Tuple[int, int]:
    """Width and height."""
    try:
        pair = [operator.index(side) for side in (size if isinstance(size, (tuple, list)) else (size, size))]
    except TypeError:
        pair = []
    if len(pair) != 2 or not all(lowest <= side <= highest for side in pair):
        raise InputError(f"{name}: {lowest} to {highest}, one number or (width, height); not {size!r}")
    return pair[0], pair[1]


def one_of(value: str, words: Sequence[str], name: str) -> str:
    """The word, where it is one of them."""
    if value not in words:
        raise InputError(f'{name}: "{value}" is none of {", ".join(words)}')
    return value


def whole(value: int, name: str, lowest: int, highest: int) -> int:
    """The whole number, where it lies within limits."""
    try:
        result = operator.index(value)
    except TypeError:
        raise InputError(f"{name}: {value!r} is no whole number") from None
    if not lowest <= result <= highest:
        raise InputError(f"{name}: {result} does not lie from {lowest} to {highest}")
    return result


def number(value: float, name: str, lowest: float, highest: float) -> float:
    """The number, where it lies within limits."""
    try:
        result = float(value)
    except (TypeError, ValueError):
        raise InputError(f"{name}: {value!r} is no number") from None
    if not lowest <= result <= highest:
        raise InputError(f"{name}: {result:g} does not lie from {lowest:g} to {highest:g}")
    return result


def encode(
    mesh: Mesh,
    skeleton: Optional[Skeleton] = None,
    *,
    size: Union[int, Tuple[int, int]] = 512,
    method: str = "vsm",
    bone_methods: Optional[Mapping[str, str]] = None,
    snap: Optional[bool] = None,
    fit: Optional[bool] = None,
    half: bool = False,
    prefilter: Optional[bool] = None,
    unfold: Optional[bool] = None,
    rows: Optional[str] = None,
    share: Optional[str] = None,
    iterations: Optional[int] = None,
    alpha: Optional[float] = None,
    paper_recipe: bool = False,
    progress: Optional[Progress] = None,
) -> Model:
    """Turns a closed mesh and its skeleton into a model. Options have the meaning of those of ``skeletex encode``.

    :param skeleton: in the mesh's coordinates; None: one is made
    :param size: texels, N or (width, height)
    :param method: ``"vsm"``, ``"spd"``, or ``"hybrid"``: each bone takes one of them
    :param bone_methods: of hybrid models, by name of the bone
    :param snap: texels sit on vertices and edges of the mesh; None: where that is expected to lower the error
    :param fit: their points move nearer to the mesh; None: where that is quick or pays
    :param half: texels that half floats hold, for ``Model.write(.., half=True)``
    :param prefilter: texels lie a little off curved surfaces, so that triangles straddle them; None: on
    :param unfold: the grid is spread where it folds in space; None: on
    :param rows: ``"surface"`` or ``"uniform"``, where rows lie along a bone
    :param share: ``"error"``, ``"triangles"`` or ``"area"``, what a bone's share of the texels follows
    :param iterations: reweightings of VSM, 0 to 100
    :param alpha: weights grow by texture area / surface area ^ alpha, 0 to 2
    :param paper_recipe: as the paper; other options that are given beat it
    :param progress: called between stages; Ctrl-C is seen there, too
    :raises InvalidInput: where mesh or skeleton have errors, with all of them
    :raises TopologyError: where they do not fit together
    :raises Cancelled: where ``progress`` has returned False
    """
    width, height = size_pair(size, "size", 4, 16384)
    if bone_methods and method != "hybrid":
        raise InputError('bone_methods: they need method="hybrid"')
    options = {
        "width": width,
        "height": height,
        "method": method,
        "bone_methods": dict(bone_methods or {}),
        "snap": snap,
        "fit": fit,
        "half": half,
        "prefilter": prefilter,
        "unfold": unfold,
        "rows": rows and one_of(rows, ("surface", "uniform"), "rows"),
        "share": share and one_of(share, ("error", "triangles", "area"), "share"),
        "iterations": None if iterations is None else whole(iterations, "iterations", 0, 100),
        "alpha": None if alpha is None else number(alpha, "alpha", 0, 2),
        "paper_recipe": paper_recipe,
    }
    given = skeleton._tuple() if skeleton is not None else None
    core, report_json, findings = _core.encode(
        mesh.vertices, mesh.triangles, given, to_json(options, "options"), progress
    )
    report = json.loads(report_json)
    for finding in (Finding(*row) for row in findings):
        warnings.warn(f"{finding.rule}: {finding.message}", InputWarning, stacklevel=2)
    for bone in report["bones"]:
        if bone["lacks_part"]:
            warnings.warn(
                f'bone "{bone["name"]}": a part of its surface is {100 * bone["furthest_distance"]:.1f} % of the '
                "diagonal away from the model; more texels, or a bone of its own for that part, mend it",
                InputWarning,
                stacklevel=2,
            )
    return Model(core, report)


def skeletonize(
    mesh: Mesh,
    *,
    bones: Optional[int] = None,
    detail: Optional[float] = None,
    purpose: str = "pose",
    progress: Optional[Progress] = None,
) -> Skeleton:
    """Makes a skeleton for a closed mesh.

    :param bones: at most so many, and as many of them as work
    :param detail: 0 the longest limbs, 1 fingers and ears as well; None: several are tried
    :param purpose: ``"pose"``: every limb keeps a bone; ``"size"``: what gives the least error
    :param progress: called between candidates; Ctrl-C is seen there, too
    :raises InvalidInput: where the mesh has errors
    :raises TopologyError: where no skeleton was accepted
    """
    options = {
        "bones": None if bones is None else whole(bones, "bones", 1, 500),
        "detail": None if detail is None else number(detail, "detail", 0, 1),
        "purpose": one_of(purpose, ("pose", "size"), "purpose"),
    }
    return Skeleton._of(_core.skeletonize(mesh.vertices, mesh.triangles, to_json(options, "options"), progress))


def validate(mesh: Mesh, skeleton: Optional[Skeleton] = None) -> List[Finding]:
    """Everything that is wrong with a mesh, and with a skeleton in it. Nothing is: the list is empty. Takes any input.

    ``[f for f in validate(mesh, skeleton) if f.severity == "error"]`` is empty where :func:`encode` takes the two.
    """
    rows = _core.validate(mesh.vertices, mesh.triangles, None if skeleton is None else skeleton._tuple())
    return [Finding(*row) for row in rows]


def repair(mesh: Mesh, skeleton: Skeleton) -> Tuple[Skeleton, List[str]]:
    """A skeleton near by that :func:`encode` takes, and what was changed, one sentence each.

    :raises InvalidInput: where the mesh itself has errors
    :raises InputError: where the skeleton is none, or far from the mesh
    :raises TopologyError: where nothing helps
    """
    parts, changes = _core.repair(mesh.vertices, mesh.triangles, skeleton._tuple())
    return Skeleton._of(parts), changes


def reconstruct(
    model: Model,
    pose: Optional[Pose] = None,
    *,
    time: Optional[float] = None,
    size: Optional[int] = None,
    deform: str = "smooth",
    polish: bool = False,
) -> Mesh:
    """The mesh of a model, in the user's units: closed, oriented, 2-manifold, at any size and in any pose.

    All poses of a model have the same triangles.

    :param pose: a dictionary as a pose file has it, or the path of one; None: the bind pose
    :param time: moment of an animation; None: its first frame
    :param size: texels along the longer side; None: the model's own
    :param deform: ``"smooth"``, ``"coordinates"``, ``"paper"`` or ``"linear"``
    :param polish: smooths the triangles at folds that the pose makes
    """
    if size is not None and size != max(model.width, model.height):
        model = lod(model, size)
    given = None if pose is None else pose_json(pose)
    return Mesh(*_core.reconstruct(model._core, given, _moment(time), deform, polish))


def _moment(time: Optional[float]) -> Optional[float]:
    return None if time is None else number(time, "time", -1e300, 1e300)


def pose(model: Model, pose: Pose, *, time: Optional[float] = None) -> Skeleton:
    """The skeleton of a model in a pose, in the user's units. For the surface see :func:`reconstruct`.

    :param pose: a dictionary as a pose file has it, or the path of one
    :param time: moment of an animation; None: its first frame
    :raises InputError: naming what the skeleton does not have
    """
    return Skeleton._of(_core.pose(model._core, pose_json(pose), _moment(time)))


def random_pose(model: Model, degrees: float, seed: int = 0) -> Dict[str, Any]:
    """A pose in which every bone but those at the root and in cycles turns by up to so many degrees. The same seed, the
    same pose.

    :raises InputError: where all bones are in cycles
    """
    largest = math.radians(number(degrees, "degrees", 0, 180))
    return dict(json.loads(_core.random_pose(model._core, largest, whole(seed, "seed", 0, 2**63))))


def lod(model: Model, size: int) -> Model:
    """The same model at another size. Seams are kept, so it reconstructs to a closed mesh, too.

    :param size: texels along the longer side, 4 to 16384
    :raises InputError: where the size is too small for the number of bones
    """
    return Model(_core.resample(model._core, whole(size, "size", 4, 16384)))


def levels(model: Model, smallest: int = 32) -> List[Model]:
    """The model, then each level with half the longer side of the one before, see :func:`skeletex.write_levels`.

    :param smallest: longer side of the last one
    """
    return [Model(core) for core in _core.levels(model._core, whole(smallest, "smallest", 4, 16384))]
