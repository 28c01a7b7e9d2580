#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""The kernels under Oclgrind, which interprets them and watches every access: out of bounds, of values never written, races between
work-items. The program's commands run on a capsule of 120 triangles; any report fails the test, and so does a kernel that no command ran.

    oclgrind_test.py PROGRAM SOURCE WORK OCLGRIND SHIM

OCLGRIND is its library, SHIM tracked_buffers.cpp as one. Oclgrind 21.10 (LLVM 14) knows neither `freeze` nor the scopes that inlining makes of `restrict`, so
kernels are compiled without optimisation, and nothing is inlined.
"""
import concurrent.futures
import glob
import json
import math
import os
import pathlib
import random
import re
import shutil
import subprocess
import sys

PROGRAM, SOURCE, WORK, OCLGRIND, SHIM = (pathlib.Path(argument) for argument in sys.argv[1:6])
# What would take longer than all the rest: lattices large enough for a second level. And what groups of one work-item run, which Oclgrind's device has
# not: it calls what other kernels of its file call.
LEFT_OUT = ("filter.cl:pick_vertices", "diffusion.cl:restrict_field", "diffusion.cl:add_coarse_field", "vsm.cl:map_charts")

MODELS = [("spd", "encode c.off c.skeleton.json -o s.skx.exr --size 12 --method spd"),
          ("vsm", "encode rough.off c.skeleton.json -o v.skx.exr --size 12 --iterations 1 --no-snap --no-fit --diagonals smooth --half"),
          ("snap", "encode rough.off c.skeleton.json -o n.skx.exr --size 9 --iterations 1 --snap --fit"),
          ("metro", "metro c.off rough.off --samples 300")]
RESULTS = [("smooth", "filter s.skx.exr smooth -o f.ply --scale 0.00001"),
           ("noise", "filter v.skx.exr noise -o n.ply"),
           ("larger", "lod s.skx.exr --size 18 -o l.skx.exr"),
           ("pose", "reconstruct v.skx.exr -o p.ply --pose p.json --deform paper"),
           ("skin", "reconstruct v.skx.exr -o k.ply --pose p.json"),
           ("coordinates", "reconstruct v.skx.exr -o k.ply --pose p.json --deform coordinates"),
           ("direction", "reconstruct v.skx.exr -o d.ply --pose p.json --deform paper --no-distance"),
           ("morph", "morph n.skx.exr s.skx.exr --t 0.3 -o m.ply"),
           ("transfer", "transfer s.skx.exr v.skx.exr --bones bc=bc --keep 0 --share 0.5 -o t.ply")]


def capsule(path, noise):
    """A wavy tube about z with hemispheres, six vertices around, its vertices moved at random."""
    around, cells, length, radius = 6, 5, 3.0, 0.5
    caps = [math.pi / 6, math.pi / 3, math.pi / 2]
    rings = ([(-radius * math.cos(a), radius * math.sin(a)) for a in caps] + [(length * k / cells, radius) for k in range(1, cells)] +
             [(length + radius * math.cos(a), radius * math.sin(a)) for a in reversed(caps)])
    points, triangles = [(0, 0, -radius)], []
    for z, r in rings:
        for k in range(around):
            turn = 2 * math.pi * (k + 0.3) / around
            points.append((r * (1 + 0.1 * math.cos(2 * turn + z)) * math.cos(turn), r * math.sin(turn), z))
    points.append((0, 0, length + radius))
    for k in range(around):
        l = (k + 1) % around
        triangles.append((0, 1 + l, 1 + k))
        for row in range(len(rings) - 1):
            a = 1 + row * around
            triangles += [(a + k, a + l, a + around + l), (a + k, a + around + l, a + around + k)]
        last = 1 + (len(rings) - 1) * around
        triangles.append((len(points) - 1, last + k, last + l))
    random_move = random.Random(4)
    points = [[x + random_move.uniform(-noise, noise) for x in p] for p in points]
    lines = [f"OFF\n{len(points)} {len(triangles)} 0"] + ["%.6f %.6f %.6f" % tuple(p) for p in points] + ["3 %d %d %d" % t for t in triangles]
    path.write_text("\n".join(lines) + "\n")


def run(name, arguments, kernels=WORK / "kernels"):
    """Runs a command. Returns what Oclgrind reported, and the kernels that ran."""
    log, report = WORK / f"{name}.log", WORK / f"{name}.json"
    environment = {**os.environ, "LD_PRELOAD": f"{SHIM}:{OCLGRIND}", "OCLGRIND_BUILD_OPTIONS": "-cl-opt-disable",
                   "OCLGRIND_UNINITIALIZED": "1", "OCLGRIND_DATA_RACES": "1", "OCLGRIND_CHECK_API": "1", "OCLGRIND_MAX_ERRORS": "20",
                   "OCLGRIND_MAX_WGSIZE": "64", "OCLGRIND_LOG": str(log), "SKELETEX_KERNEL_DIR": str(kernels)}
    done = subprocess.run([PROGRAM, *arguments.split(), "--json", report], cwd=WORK, env=environment, capture_output=True, text=True, timeout=500)
    reports = log.read_text() if log.exists() else ""
    if done.returncode != 0:
        reports += f"exit code {done.returncode}: {done.stderr}"
    ran = json.loads(report.read_text()).get("kernels", []) if report.exists() else []
    return reports, {entry["kernel"] for entry in ran}


def main():
    shutil.rmtree(WORK, ignore_errors=True)
    shutil.copytree(SOURCE / "kernels", WORK / "kernels")
    for path in (WORK / "kernels").iterdir():
        source = path.read_text().replace("__attribute__((always_inline)) ", "")
        # Its watch over unwritten values crashes where vectors are put together of halves, or taken apart: the same, number by number.
        source = re.sub(r"\((float|int)8\)\(vload4\(0, plane \+ at_even\), vload4\(0, plane \+ at_odd\)\)",
                        lambda load: f"({load[1]}8)(" + ", ".join(f"plane[{at} + {i}]" for at in ("at_even", "at_odd") for i in range(4)) + ")", source)
        for half, at, first in (("lo", "at_even", 0), ("hi", "at_odd", 4)):
            source = source.replace(f"vstore4(values.{half}, 0, plane + {at});", " ".join(f"plane[{at} + {i}] = values.s{first + i};" for i in range(4)))
        path.write_text(source)
    capsule(WORK / "c.off", 0)
    capsule(WORK / "rough.off", 0.2)  # so that the lattice folds
    nodes = [("a", [0, 0, 0]), ("b", [0.05, 0, 1.6]), ("c", [0, 0, 3])]
    (WORK / "c.skeleton.json").write_text(json.dumps({"nodes": [{"name": n, "position": p} for n, p in nodes],
                                                      "bones": [{"name": "ab", "head": 0, "tail": 1}, {"name": "bc", "head": 1, "tail": 2}]}))
    (WORK / "p.json").write_text('{"nodes": {"c": [0.9, 0, 2.6]}}')

    failures, ran = [], set()
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        for commands in (MODELS, RESULTS):
            for (name, _), (reports, kernels) in zip(commands, pool.map(lambda command: run(*command), commands)):
                ran |= kernels
                print(f"{name}: {len(kernels)} kernels, {'nothing to report' if not reports else 'reports'}")
                if reports:
                    failures.append(f"{name}:\n{reports[:4000]}")
    for path in sorted(glob.glob(str(SOURCE / "kernels/*.cl"))):
        file = os.path.basename(path)
        for kernel in re.findall(r"^(?:__)?kernel\b.*?\bvoid (\w+)\(", pathlib.Path(path).read_text(), re.MULTILINE):
            if f"{file}:{kernel}" not in ran and not f"{file}:{kernel}".startswith(LEFT_OUT):
                failures.append(f"{file}: no command ran the kernel {kernel}")

    # The watch itself: without its bounds test a kernel must be caught.
    broken = WORK / "broken"
    shutil.copytree(WORK / "kernels", broken)
    source = (broken / "segment.cl").read_text()
    without = re.sub(r"^  if \(.* >= .*\) return;\n", "", source, flags=re.MULTILINE)
    assert without != source
    (broken / "segment.cl").write_text(without)
    if "Invalid" not in run("broken", "segment c.off c.skeleton.json -o b.ply", broken)[0]:
        failures.append("a kernel without its bounds test went unnoticed")
    if failures:
        sys.exit("\n".join(failures))


main()
