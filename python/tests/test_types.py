# SPDX-License-Identifier: MIT
"""The types that the package promises."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import skeletex
from conftest import ROOT

pytest.importorskip("mypy")
PACKAGES = os.path.dirname(os.path.dirname(skeletex.__file__))


def check(folder: Path, *arguments: str) -> None:
    """Runs a module in a folder, where it leaves its cache."""
    environment = dict(os.environ, MYPYPATH=PACKAGES)
    result = subprocess.run(
        [sys.executable, "-m", *arguments], env=environment, capture_output=True, text=True, cwd=folder
    )
    assert result.returncode == 0, result.stdout + result.stderr


def test_the_stubs_are_those_of_the_module(tmp_path: Path) -> None:
    # Two things that every class of pybind11 has: a metaclass, and an __init__ without a signature.
    (tmp_path / "allowed").write_text("skeletex._core.Model\nskeletex._core.Model.__init__\n")
    check(tmp_path, "mypy.stubtest", "--allowlist", str(tmp_path / "allowed"), "skeletex._core")


def test_package_and_examples_pass_the_strict_checks(tmp_path: Path) -> None:
    examples = sorted(str(path) for path in (ROOT / "python/examples").glob("*.py"))
    check(tmp_path, "mypy", "--strict", "-p", "skeletex")
    for example in examples:
        check(tmp_path, "mypy", "--strict", "--ignore-missing-imports", example)
