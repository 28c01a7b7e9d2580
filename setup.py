# SPDX-License-Identifier: MIT
"""Builds the module skeletex._core with CMake; all else is in pyproject.toml."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

ROOT = Path(__file__).resolve().parent


class CMakeBuild(build_ext):
    def build_extension(self, extension):
        folder = ROOT / "build" / "python"  # stays, so that the next build is short
        cmake = shutil.which("cmake")
        if cmake is None:
            raise SystemExit("skeletex: CMake is missing; scripts/install-dependencies.sh installs what the build needs")
        generator = ["-G", "Ninja"] if shutil.which("ninja") else []
        options = [f"-DPython_EXECUTABLE={sys.executable}", "-DCMAKE_BUILD_TYPE=Release", "-DSKELETEX_BUILD_PYTHON=ON"]
        options += [f"-DSKELETEX_BUILD_{part}=OFF" for part in ("CLI", "TESTS", "BENCHMARKS")]
        subprocess.run([cmake, "-S", ROOT, "-B", folder, *generator, *options], check=True)
        subprocess.run([cmake, "--build", folder, "--target", "skeletex_python", "--parallel"], check=True)
        target = Path(self.get_ext_fullpath(extension.name))
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(folder / "python" / "skeletex" / target.name, target)


version = re.search(r"project\(skeletex VERSION ([\d.]+)", (ROOT / "CMakeLists.txt").read_text()).group(1)
setup(version=version, ext_modules=[Extension("skeletex._core", [])], cmdclass={"build_ext": CMakeBuild})
