# SPDX-License-Identifier: MIT
"""What the package raises. A message says what is wrong, where, and what to do about it."""

from __future__ import annotations

from typing import Any, List, NamedTuple, Optional, Sequence, Tuple


class Finding(NamedTuple):
    """Something that is wrong with a mesh or a skeleton, see :func:`skeletex.validate`."""

    severity: str  #: ``"error"``, ``"warning"`` or ``"note"``
    rule: str  #: the kind, e.g. ``"closed"`` or ``"bone-crossing"``
    message: str  #: what is wrong and where
    remedy: str  #: what to do; may be empty
    node: Optional[int]  #: of the skeleton, where one is meant
    bone: Optional[int]
    position: Optional[Tuple[float, float, float]]  #: where it is, if it has a place

    def __str__(self) -> str:
        text = f"{self.severity} ({self.rule}): {self.message}"
        return f"{text}\n  remedy: {self.remedy}" if self.remedy else text


class Error(Exception):
    """Base of everything that the package raises by itself."""


class IoError(Error, OSError):
    """A file could not be read or written, or is not what its name says."""


class InputError(Error, ValueError):
    """A mesh, a skeleton, an array or an option is not usable as it is."""


class InvalidInput(InputError):
    """A mesh or a skeleton has errors. ``findings`` has them one by one."""

    findings: List[Finding]

    def __init__(self, message: str) -> None:
        super().__init__(message)
        self.findings = []

    def _set_findings(self, rows: Sequence[Tuple[Any, ...]]) -> None:
        self.findings = [Finding(*row) for row in rows]


class TopologyError(Error):
    """Mesh and skeleton do not fit together. ``bone`` and ``node`` are the numbers of what stands in the way, or None."""

    bone: Optional[int] = None
    node: Optional[int] = None


class DeviceError(Error, RuntimeError):
    """An OpenCL or OpenGL call failed, or there is no such device."""


class Cancelled(Error):
    """A ``progress`` function has returned False."""


class InputWarning(UserWarning):
    """The result is usable, but a part of the input is not as it should be."""
