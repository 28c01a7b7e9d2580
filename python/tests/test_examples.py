# SPDX-License-Identifier: MIT
"""The examples, run as a user runs them."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import skeletex
from conftest import ROOT

pytest.importorskip("matplotlib")


def run(name: str, folder: Path) -> str:
    result = subprocess.run(
        [sys.executable, str(ROOT / f"python/examples/{name}.py"), str(folder)], capture_output=True, text=True
    )
    assert result.returncode == 0, result.stderr
    return result.stdout


def check_picture(path: Path) -> None:
    from matplotlib import image

    picture = image.imread(path)[..., :3]
    assert picture.shape[1] >= 600 and picture.std() > 0.05
    assert len(np.unique((picture * 255).astype(np.uint8).reshape(-1, 3), axis=0)) > 200


def test_the_first_steps_write_a_model_a_pose_and_a_picture(tmp_path: Path) -> None:
    text = run("first_steps", tmp_path)
    assert float(re.search(r"Metro\(mean=([^,]*)", text).group(1)) < 1e-4  # type: ignore[union-attr]
    assert skeletex.Model.read(tmp_path / "bear.skx.exr").texture.shape == (256, 256, 3)
    assert skeletex.Mesh.read(tmp_path / "bear_posed.ply").topology()["is_closed_manifold"]
    check_picture(tmp_path / "first_steps.png")


def test_the_components_of_the_shape_space_are_all_of_the_variance(tmp_path: Path) -> None:
    shares = [float(share) for share in re.findall(r"component \d: ([\d.]+) %", run("shape_space", tmp_path))]
    assert len(shares) == 4 and shares == sorted(shares, reverse=True) and abs(sum(shares) - 100) < 0.3
    check_picture(tmp_path / "shape_space.png")


def test_the_error_of_the_sweep_falls_with_the_size(tmp_path: Path) -> None:
    rows = re.findall(r"(spd|vsm) +(\d+): mean ([^,]*),", run("sweep", tmp_path))
    means = {(method, int(size)): float(mean) for method, size, mean in rows}
    assert len(means) == 8
    for method in ("spd", "vsm"):
        curve = [means[method, size] for size in (32, 64, 128, 256)]
        assert all(b < 0.7 * a for a, b in zip(curve, curve[1:])), curve
    check_picture(tmp_path / "sweep.png")
