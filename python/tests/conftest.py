# SPDX-License-Identifier: MIT
from __future__ import annotations

import os
from pathlib import Path

import pytest

import skeletex

ROOT = Path(__file__).resolve().parents[2]


def load(name: str) -> tuple[skeletex.Mesh, skeletex.Skeleton]:
    return (
        skeletex.Mesh.read(ROOT / f"build/meshes/{name}.off"),
        skeletex.Skeleton.read(ROOT / f"configs/skeletons/{name}.skeleton.json"),
    )


@pytest.fixture(scope="session")
def program() -> str:
    """The program, which must do the same."""
    path = os.environ.get("SKELETEX_PROGRAM", str(ROOT / "build/release/bin/skeletex"))
    if not os.access(path, os.X_OK):
        pytest.skip("the program skeletex is not built")
    return path


@pytest.fixture(scope="session")
def bear_mesh() -> skeletex.Mesh:
    return load("bear")[0]


@pytest.fixture(scope="session")
def bear_skeleton() -> skeletex.Skeleton:
    return load("bear")[1]


@pytest.fixture(scope="session")
def bear(bear_mesh: skeletex.Mesh, bear_skeleton: skeletex.Skeleton) -> skeletex.Model:
    return skeletex.encode(bear_mesh, bear_skeleton, size=128)


@pytest.fixture(scope="session")
def bear_bis() -> skeletex.Model:
    return skeletex.encode(*load("bear_bis"), size=128)
