# SPDX-License-Identifier: MIT
"""Pictures, and pages to look at in a notebook."""

from __future__ import annotations

import html
import os
import tempfile
from typing import Any, Dict, Optional, Sequence, Tuple, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._convert import Pose, lod, one_of, pose, reconstruct, size_pair, to_json, whole
from ._data import Mesh, Path, Skeleton, colour_array
from ._edit import BonePairs, bone_pairs
from ._errors import InputError, IoError
from ._measure import mesh_of, triangle_bones
from ._model import Model

_LARGEST_PAGE = 512
Colour = Union[str, Tuple[float, float, float], None]


def _background(colour: Colour) -> Optional[NDArray[np.float64]]:
    if colour is None:
        return None
    if isinstance(colour, str):
        one_of(colour, ("white", "black"), "background")
        return np.full(3, 1.0 if colour == "white" else 0.0)
    array = np.asarray(colour, dtype=np.float64)
    if array.shape != (3,) or not ((array >= 0) & (array <= 1)).all():
        raise InputError("background: white, black, three numbers from 0 to 1 (sRGB), or None")
    return np.where(array <= 0.04045, array / 12.92, ((array + 0.055) / 1.055) ** 2.4)


def _picture(linear: NDArray[np.float32], background: Optional[NDArray[np.float64]]) -> NDArray[np.uint8]:
    """sRGB bytes of a picture that is linear and premultiplied."""
    alpha = np.clip(linear[..., 3:], 0, 1)
    if background is None:
        colour = linear[..., :3] / np.where(alpha > 0, alpha, 1)
    else:
        colour = linear[..., :3] + (1 - alpha) * background
    colour = np.clip(colour, 0, 1)
    srgb = np.where(colour <= 0.0031308, 12.92 * colour, 1.055 * colour ** (1 / 2.4) - 0.055)
    if background is None:
        srgb = np.concatenate([srgb, alpha], axis=-1)
    return np.asarray(np.rint(255 * srgb), dtype=np.uint8)


def viridis(values: ArrayLike, limits: Optional[Tuple[float, float]] = None) -> NDArray[np.uint8]:
    """Colours of n numbers, dark blue to yellow, as :func:`render` takes them: n x 3 bytes.

    :param limits: what is dark blue and yellow; None: the least and the greatest value
    """
    array = np.asarray(values, dtype=np.float64).ravel()
    if not np.isfinite(array).all():
        raise InputError("viridis: a value is not finite")
    low, high = limits if limits is not None else (array.min(initial=0), array.max(initial=0))
    scaled = (array - low) / (high - low) if high > low else np.zeros_like(array)
    return _core.viridis(scaled)


def render(
    subject: Union[Model, Mesh],
    pose: Optional[Pose] = None,
    *,
    time: Optional[float] = None,
    deform: str = "smooth",
    mode: str = "shaded",
    colours: Optional[ArrayLike] = None,
    skeleton: Union[bool, Skeleton] = False,
    size: Union[int, Tuple[int, int]] = (800, 600),
    background: Colour = "white",
    flat: bool = False,
    wireframe: bool = False,
    samples: int = 2,
    azimuth: float = 30,
    elevation: float = 15,
    fov: float = 25,
    zoom: float = 1,
    up: Optional[Sequence[float]] = None,
    front: Optional[Sequence[float]] = None,
    target: Optional[Sequence[float]] = None,
    eye: Optional[Sequence[float]] = None,
) -> NDArray[np.uint8]:
    """Draws a model or a mesh. No display is needed.

    :param pose: of a model, see :func:`reconstruct`, with ``time`` and ``deform``
    :param mode: ``"shaded"`` or ``"normals"``; of models also ``"segments"``, each bone in its colour, and
        ``"checker"``; ``"map"`` and ``"layout"`` show the texture
    :param colours: n x 3, per vertex or per triangle: numbers from 0 to 1 or bytes, in sRGB, see :func:`viridis`
    :param skeleton: draws the model's own in its pose, or the one that is given
    :param size: pixels, (width, height)
    :param background: white, black, three numbers from 0 to 1, or None for transparent
    :param flat: a normal per triangle instead of per vertex
    :param wireframe: draws the triangles' edges
    :param samples: per pixel and direction, 1 to 8
    :param azimuth: degrees about the up axis, 0 from the front
    :param elevation: degrees above the horizon
    :param fov: degrees of the shorter side; 0: orthographic
    :param up: the model's up direction; None: its own, else y
    :param front: where it looks; None: its own, or z, or -y for a model that stands along z
    :param target: what is in the middle, in the user's units; None: the model is centred
    :param eye: from where, in the user's units; with it, angles and zoom do not count
    :return: height x width x 3 bytes in sRGB; without a background x 4
    :raises DeviceError: where there is no OpenGL 4.5
    """
    width, height = size_pair(size, "size", 16, 8192)
    ground = _background(background)
    if mode in ("map", "layout"):
        if not isinstance(subject, Model):
            raise InputError(f'mode: "{mode}" shows a model\'s texture; a mesh has none')
        return _picture(_core.texture_image(subject._core, mode == "layout", max(width, height)), ground)
    one_of(mode, ("shaded", "normals", "segments", "checker"), "mode")
    mesh, bones = _subject(subject, pose, time, deform, skeleton)
    if mode in ("segments", "checker") and not isinstance(subject, Model):
        raise InputError(f'mode: "{mode}" is of models; for a mesh give colours')
    if colours is not None and mode != "shaded":
        raise InputError(f'colours: they take the place of mode="{mode}"')
    paint = None if colours is None else colour_array(mesh, colours)
    corner_uv = None
    if mode == "segments" and isinstance(subject, Model):
        numbers = triangle_bones(subject, mesh)
        paint = _core.bone_colours(len(subject.patches))[numbers]
    if mode == "checker" and isinstance(subject, Model):
        corner_uv = _core.checker(subject._core)
    if up is None and front is None and isinstance(subject, Model):
        up, front = subject.up, subject.front
    if up is None:
        up = (0, 1, 0)
    view: Dict[str, Any] = {"azimuth": azimuth, "elevation": elevation, "fov": fov, "zoom": zoom, "up": up}
    if front is None:
        along_z = np.abs(np.asarray(up, dtype=np.float64))[:2].sum() == 0
        front = (0, -1, 0) if along_z else (0, 0, 1)
    view["front"] = front
    view.update({name: place for name, place in (("target", target), ("eye", eye)) if place is not None})
    options = {
        "view": view,
        "width": width,
        "height": height,
        "samples": whole(samples, "samples", 1, 8),
        "flat": flat,
        "wireframe": wireframe,
        "normals": mode == "normals",
        "lighting": 1.0 if colours is None else 0.55,
    }
    drawn = _core.render(
        *mesh._checked(), paint, corner_uv, None if bones is None else bones._checked(), to_json(options, "view")
    )
    return _picture(drawn, ground)


def _subject(
    subject: Union[Model, Mesh], given: Optional[Pose], time: Optional[float], deform: str, skeleton: Union[bool, Skeleton]
) -> Tuple[Mesh, Optional[Skeleton]]:
    """What is drawn, with its skeleton."""
    if isinstance(subject, Model):
        mesh = reconstruct(subject, given, time=time, deform=deform)
        if skeleton is True:
            return mesh, subject.skeleton if given is None else pose(subject, given, time=time)
    else:
        mesh = subject
        if given is not None:
            raise InputError("pose: only a model can be posed; encode the mesh first")
        if skeleton is True:
            raise InputError("skeleton: a mesh brings none; give one")
    if len(mesh.triangles) == 0:
        raise InputError("the mesh has no triangles")
    return mesh, skeleton if isinstance(skeleton, Skeleton) else None


class Page:
    """A page that shows a model in a browser: to turn, pose and morph. A notebook shows it by itself."""

    def __init__(self, html: str, width: str = "100%", height: int = 600) -> None:
        self.html = html  #: the whole page, without links
        self.width = width  #: in a notebook
        self.height = height  #: in a notebook, pixels

    def write(self, path: Path) -> None:
        """Writes the page. The file is there when it is complete.

        :raises IoError: where it cannot be written
        """
        name = os.fspath(path)
        folder = os.path.dirname(name) or "."
        try:
            handle, temporary = tempfile.mkstemp(dir=folder, prefix=".skeletex-", suffix=".html")
        except OSError as error:
            raise IoError(f"{name}: {error}") from None
        try:
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                file.write(self.html)
            os.chmod(temporary, 0o644)
            os.replace(temporary, name)
        except OSError as error:
            os.unlink(temporary)
            raise IoError(f"{name}: {error}") from None

    def _repr_html_(self) -> str:
        # The page has no access to the notebook: scripts run in an origin of their own.
        return (
            f'<iframe srcdoc="{html.escape(self.html)}" width="{html.escape(self.width)}" height="{int(self.height)}" '
            'sandbox="allow-scripts allow-downloads" style="border: 0"></iframe>'
        )

    def __repr__(self) -> str:
        return f"Page({1e-6 * len(self.html):.1f} MB)"


def view(
    model: Model,
    second: Optional[Model] = None,
    *,
    against: Union[Mesh, Model, None] = None,
    up: Optional[str] = None,
    size: Optional[int] = None,
    bones: Optional[BonePairs] = None,
    name: str = "model",
    second_name: str = "second model",
    height: int = 600,
) -> Page:
    """A page that shows a model, to look at in a notebook or to write to a file.

    :param second: what it morphs to and takes bones from; the two must branch alike
    :param against: the page can show the distances to this surface
    :param up: axis that points up: ``"y"``, with z in front, or ``"z"``, with -y in front; None: the model's own
    :param size: texels along the longer side; None: the model's own, at most 512
    :param bones: pairs of bones that must correspond
    :param height: in a notebook, pixels
    :raises InputError: where the two do not correspond, or the library was built without npm
    """
    own = max(model.width, model.height)
    wanted = min(own, _LARGEST_PAGE) if size is None else whole(size, "size", 4, 2048)
    if wanted != own:
        model = lod(model, wanted)
    options = {
        "name": name,
        "second_name": second_name,
        "up": None if up is None else one_of(up, ("y", "z"), "up"),
        "bones": bone_pairs(bones),
    }
    reference = None if against is None else mesh_of(against)._checked()
    page = _core.page(
        model._core, None if second is None else second._core, reference, to_json(options, "options")
    )
    return Page(page, height=height)
