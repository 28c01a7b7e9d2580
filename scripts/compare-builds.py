#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Builds two revisions and compares the times of their stages in one run, alternating, so that what else the machine does meets both.

    scripts/compare-builds.py BASE HEAD [--stage NAME,..] [--runs N] [--size N] [--json FILE] [--keep FOLDER]

Revisions are whatever git takes. Both need `skeletex bench` with --stage. ms is what the stage is measured by (docs/performance.md); spread is
(largest - smallest) / median of the runs; "change" is HEAD / BASE of ms, "relative" the same of the ratios to the references, which a busy
machine slows down as well.
"""
import argparse
import json
import os
import pathlib
import shutil
import statistics
import subprocess
import sys
import tempfile

SOURCE = pathlib.Path(__file__).resolve().parent.parent


def git(*arguments):
    return subprocess.run(["git", "-C", SOURCE, *arguments], check=True, capture_output=True, text=True).stdout.strip()


def build(revision, folder):
    """The program of a revision, built in a worktree below the folder. Both builds share ccache's entries."""
    tree = folder / revision[:12]
    if not tree.exists():
        git("worktree", "add", "--detach", str(tree), revision)
    environment = {**os.environ, "CCACHE_BASEDIR": str(folder), "CCACHE_NOHASHDIR": "1"}
    for command in (["cmake", "--preset", "release", "-DSKELETEX_BUILD_TESTS=OFF", "-DSKELETEX_BUILD_BENCHMARKS=OFF"], ["cmake", "--build", "--preset", "release", "--target", "skeletex"]):
        done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True)
        if done.returncode != 0:
            sys.exit(f"{revision} does not build:\n{(done.stdout + done.stderr)[-4000:]}")
    return tree / "build/release/bin/skeletex"


def bench(program, folder, arguments):
    """One run in this project's folder, which has the meshes. Kernels' caches are the program's own."""
    report = folder / "bench.json"
    environment = {**os.environ, "POCL_CACHE_DIR": str(program.parent / "pocl")}
    done = subprocess.run([program, "bench", *arguments, "--json", report], cwd=SOURCE, env=environment, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{program} bench: {done.stderr.strip()}")
    return json.loads(report.read_text())


def summary(values):
    middle = statistics.median(values)
    return {"median": middle, "spread": (max(values) - min(values)) / middle, "values": values}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("base")
    parser.add_argument("head")
    parser.add_argument("--stage", help="these stages only, separated by commas")
    parser.add_argument("--runs", type=int, default=5, help="of each program (5)")
    parser.add_argument("--size", help="texels along the longer side")
    parser.add_argument("--json", help="write the table as JSON to this file")
    parser.add_argument("--keep", type=pathlib.Path, help="build in this folder and leave it, so that the next comparison builds what is new only")
    options = parser.parse_args()
    arguments = [text for name in ("stage", "size") if getattr(options, name) for text in (f"--{name}", getattr(options, name))]

    folder = (options.keep or pathlib.Path(tempfile.mkdtemp(prefix="skeletex-compare-"))).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    try:
        revisions = {"base": git("rev-parse", f"{options.base}^{{commit}}"), "head": git("rev-parse", f"{options.head}^{{commit}}")}
        programs = {}
        for side, revision in revisions.items():
            print(f"building {side} {git('log', '-1', '--format=%h %s', revision)}", file=sys.stderr)
            programs[side] = build(revision, folder)
        rows = {}
        for program in programs.values():
            bench(program, folder, [*arguments, "--repeats", "1"])  # fills caches
        for i in range(options.runs):
            print(f"run {i + 1} of {options.runs}", file=sys.stderr)
            for side in sorted(programs, reverse=i % 2 == 1):
                for row in bench(programs[side], folder, arguments):
                    rows.setdefault((row["stage"], row["model"], row["size"]), {"base": [], "head": []})[side].append(row)
    finally:
        if not options.keep:
            for tree in folder.glob("*/.git"):
                git("worktree", "remove", "--force", str(tree.parent))
            shutil.rmtree(folder, ignore_errors=True)

    table = []
    for (stage, model, size), sides in rows.items():
        if not sides["base"] or not sides["head"]:
            continue
        entry = {"stage": stage, "model": model, "size": size}
        for side, runs in sides.items():
            entry[side] = {key: summary([run[key] for run in runs]) for key in ("ms", "wall_ms", "ratio")}
        entry["change"] = entry["head"]["ms"]["median"] / entry["base"]["ms"]["median"]
        entry["relative_change"] = entry["head"]["ratio"]["median"] / entry["base"]["ratio"]["median"]
        table.append(entry)
    print(f"{'stage':12} {'model':18} {'size':>6} {'base ms':>9} {'spread':>7} {'head ms':>9} {'spread':>7} {'change':>7} {'relative':>8}")
    for entry in table:
        base, head = entry["base"]["ms"], entry["head"]["ms"]
        print(f"{entry['stage']:12} {entry['model']:18} {entry['size']:6} {base['median']:9.2f} {100 * base['spread']:6.0f}% {head['median']:9.2f} {100 * head['spread']:6.0f}% "
              f"{entry['change']:7.2f} {entry['relative_change']:8.2f}")
    if options.json:
        pathlib.Path(options.json).write_text(json.dumps({"base": revisions["base"], "head": revisions["head"], "runs": options.runs, "stages": table}, indent=2) + "\n")


main()
