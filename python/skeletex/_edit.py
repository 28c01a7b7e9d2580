# SPDX-License-Identifier: MIT
"""Models from models."""

from __future__ import annotations

from typing import Any, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._convert import number, one_of, to_json, whole
from ._data import Mesh
from ._errors import InputError
from ._model import Model

#: Which bone belongs to which: a dictionary, or pairs.
BonePairs = Union[Mapping[str, str], Sequence[Tuple[str, str]]]


def bone_pairs(bones: Optional[BonePairs]) -> List[Tuple[str, str]]:
    """Pairs of names."""
    if bones is None:
        return []
    return list(bones.items()) if isinstance(bones, Mapping) else [(a, b) for a, b in bones]


class Correspondence(NamedTuple):
    """Which bone of one skeleton becomes which of another."""

    bones: Dict[str, str]  #: by name of the first skeleton's bone
    reversed: List[str]  #: bones of the first skeleton whose head lies at the other one's tail
    cost: float  #: 0 for equal names, lengths and directions, about 1 for nothing in common


def correspond(a: Model, b: Model, bones: Optional[BonePairs] = None) -> Correspondence:
    """Finds which bone of one model becomes which of another.

    :param bones: pairs that must correspond; the rest is found
    :raises InputError: naming the first node where the two branch differently
    """
    found, is_reversed, cost = _core.correspond(a._core, b._core, bone_pairs(bones))
    from_names, to_names = a.skeleton.bone_names, b.skeleton.bone_names
    return Correspondence(
        {name: to_names[i] for name, i in zip(from_names, found)},
        [name for name, turned in zip(from_names, is_reversed) if turned],
        cost,
    )


def _weight_array(weights: ArrayLike) -> NDArray[np.float64]:
    try:
        return np.asarray(weights, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError("weights: an array of numbers is wanted") from None


def morphs(
    models: Sequence[Model],
    weights: ArrayLike,
    *,
    bones: Optional[BonePairs] = None,
    layout: Optional[int] = None,
    size: Optional[int] = None,
    creases: bool = False,
    landmarks: Sequence[Tuple[ArrayLike, ArrayLike]] = (),
) -> List[Model]:
    """Several in-between models, see :func:`morph`; what they have in common is computed once.

    :param weights: n x m, for each result one weight per model
    """
    given = _weight_array(weights)
    if given.ndim != 2:
        raise InputError("weights: a list for each result, with one weight per model")
    if bones is not None and len(models) != 2:
        raise InputError("bones: they pair the bones of two models")
    if len(landmarks) > 0 and len(models) != 2:
        raise InputError("landmarks: they pair the points of two models")
    try:
        pairs = np.asarray(landmarks, dtype=np.float64)
    except (TypeError, ValueError):
        pairs = np.empty(1)
    if pairs.size > 0 and pairs.shape[1:] != (2, 3):
        raise InputError("landmarks: pairs of points [x, y, z] are wanted")
    pairs = pairs.reshape(-1, 2, 3)
    lists = [[float(weight) for weight in row] for row in given]
    made = _core.morph(
        [model._core for model in models],
        lists,
        bone_pairs(bones),
        layout,
        size or 0,
        not creases,
        np.ascontiguousarray(pairs[:, 0]),
        np.ascontiguousarray(pairs[:, 1]),
    )
    return [Model(core) for core in made]


def morph(
    models: Sequence[Model],
    weights: ArrayLike,
    *,
    bones: Optional[BonePairs] = None,
    layout: Optional[int] = None,
    size: Optional[int] = None,
    creases: bool = False,
    landmarks: Sequence[Tuple[ArrayLike, ArrayLike]] = (),
) -> Model:
    """An in-between model of two or more models whose skeletons branch alike.

    :param weights: one per model, none negative, of sum 1. Of two models also one number t: 0 is the first one, 1 the
        second.
    :param bones: of two models: pairs of bones that must correspond; the rest is found
    :param layout: number of the model whose rectangles, bones and seam samples the result takes; None: the one of the
        largest weight. Results of one layout have textures that correspond texel by texel.
    :param size: texels along the longer side; None: the largest of the models'
    :param creases: leave creases where bones of different turns meet: the texels' means alone
    :param landmarks: of two models: pairs of points, one on each surface, that are to become one
    :raises InputError: where weights, numbers of handles or branching do not fit, or landmarks cannot meet
    """
    given = _weight_array(weights)
    if given.ndim == 0 and len(models) == 2:
        given = np.array([1 - float(given), float(given)])
    if given.ndim != 1:
        raise InputError("weights: one per model; of two models also one number")
    return morphs(models, [given], bones=bones, layout=layout, size=size, creases=creases, landmarks=landmarks)[0]


def transfer(
    source: Model,
    target: Model,
    bones: BonePairs,
    *,
    limb: bool = False,
    mirror: bool = False,
    scale: Union[str, float] = "auto",
    share: float = 1,
    blend: str = "cosine",
    width: Optional[float] = None,
    keep: Optional[float] = None,
    skip: Optional[float] = None,
    creases: bool = False,
) -> Model:
    """The target with the surfaces of some bones replaced by those of the source, joined at the seams.

    :param bones: names, the source's to the target's
    :param limb: also all bones below them, which must branch alike
    :param mirror: take from the source's mirror image in the plane x = 0: a left arm for a right one
    :param scale: across the bones: ``"auto"``, ``"length"``, ``"girth"``, or a factor
    :param share: how far the target goes towards that, texel by texel
    :param blend: how the two fade near the seams: ``"cosine"``, ``"linear"`` or ``"none"``
    :param width: of the fade, share of the bone's rows; None: 0.25, between two seams 0.5
    :param keep: share of its rows that the target keeps at its seams; None: up to the limb's root
    :param skip: share of the source's rows that is left out there; None: up to the limb's root
    :param creases: join each column by itself, within the first bone, which may leave creases
    :raises InputError: naming the bone that is unknown, or does not fit
    """
    options: Dict[str, Any] = {
        "limb": limb,
        "mirror": mirror,
        "creases": creases,
        "share": number(share, "share", 0, 1),
        "blend": one_of(blend, ("cosine", "linear", "none"), "blend"),
        "scale": one_of(scale, ("auto", "length", "girth"), "scale")
        if isinstance(scale, str)
        else number(scale, "scale", 1e-6, 1e6),
        "width": None if width is None else number(width, "width", 0, 1),
        "keep": None if keep is None else number(keep, "keep", 0, 0.9),
        "skip": None if skip is None else number(skip, "skip", 0, 0.9),
    }
    pairs = bone_pairs(bones)
    if not pairs:
        raise InputError("bones: none are given")
    return Model(_core.transfer(source._core, target._core, pairs, to_json(options, "options")))


def mirror(model: Model) -> Model:
    """The mirror image of a model in the plane x = 0, exact to the last bit. Bones keep their names."""
    return Model(_core.mirror(model._core))


def regular_grid(model: Model) -> Model:
    """The model on a regular grid: a row of texels is a line around the bone, a column a line along it.

    Texels of a model that was snapped or fitted lie on the mesh's own vertices and edges where they can. Filters and
    morphs move them to the grid first, which costs some accuracy; edits that go by rows and columns want that, too.
    """
    return Model(_core.regular_grid(model._core))


def _filtered(model: Model, name: str, bones: Optional[Sequence[str]], falloff: float, **options: Any) -> Model:
    if isinstance(bones, str):
        bones = [bones]
    options.update(bones=list(bones or []), falloff=number(falloff, "falloff", 0, 1))
    return Model(_core.filter(model._core, name, to_json(options, "options")))


def smooth(
    model: Model,
    *,
    scale: float = 0.01,
    iterations: int = 1,
    keep_volume: bool = False,
    bones: Optional[Sequence[str]] = None,
    falloff: float = 0.02,
) -> Model:
    """Smooths the surface, across seams and poles.

    :param scale: detail smaller than this vanishes, in diagonals
    :param iterations: steps to divide the way into
    :param keep_volume: keep the volume that the surface encloses
    :param bones: filter these bones only; None: all
    :param falloff: over what distance the effect fades out inside them, in diagonals
    """
    return _filtered(
        model,
        "smooth",
        bones,
        falloff,
        scale=number(scale, "scale", 0, 1e6),
        iterations=whole(iterations, "iterations", 1, 1000),
        keep_volume=keep_volume,
    )


def enhance(
    model: Model,
    *,
    scale: float = 0.01,
    gain: float = 1,
    bones: Optional[Sequence[str]] = None,
    falloff: float = 0.02,
) -> Model:
    """Adds the detail that :func:`smooth` would take away.

    :param gain: how many times it is added, from -1
    :param bones: filter these bones only; None: all
    :param falloff: over what distance the effect fades out inside them, in diagonals
    """
    return _filtered(
        model, "enhance", bones, falloff, scale=number(scale, "scale", 0, 1e6), gain=number(gain, "gain", -1, 100)
    )


def add_noise(
    model: Model,
    *,
    amplitude: float = 0.003,
    wavelength: float = 0.05,
    octaves: int = 3,
    seed: int = 0,
    bones: Optional[Sequence[str]] = None,
    falloff: float = 0.02,
) -> Model:
    """Moves the surface along its normals by gradient noise.

    :param amplitude: height of the largest waves, in diagonals
    :param wavelength: their length, in diagonals
    :param octaves: how many sizes of waves, each half the one before
    :param seed: another number gives another noise
    :param bones: filter these bones only; None: all
    :param falloff: over what distance the effect fades out inside them, in diagonals
    """
    return _filtered(
        model,
        "noise",
        bones,
        falloff,
        amplitude=number(amplitude, "amplitude", 0, 1),
        wavelength=number(wavelength, "wavelength", 0, 1e6),
        octaves=whole(octaves, "octaves", 1, 16),
        seed=whole(seed, "seed", 0, 2**32 - 1),
    )


def mean_curvature(model: Model, scale: float = 0) -> Tuple[Mesh, NDArray[np.float32]]:
    """The mesh of a model's regular grid, and the mean curvature of its vertices, in 1 / unit of the user.

    :param scale: the distance that it is averaged over, in diagonals; 0: three spacings of vertices
    """
    arrays, values = _core.mean_curvature(model._core, number(scale, "scale", 0, 1))
    return Mesh(*arrays), values
