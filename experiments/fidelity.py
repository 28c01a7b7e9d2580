#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Encodes, reconstructs and measures models with the program skeletex; prints a table and writes the numbers as JSON.

For every model, method and size: is the reconstruction a closed, oriented 2-manifold of the input's genus, and how far
is it from the input (symmetric surface mean and maximum, and the vertices' mean that the paper's Figure 14 shows, all
divided by the bounding box diagonal).

    experiments/fidelity.py --models bear bunny00 --methods vsm hybrid --sizes 128 512
    experiments/fidelity.py --no-metro                 # all models, all methods, 32 to 2048: topology only
"""
import argparse
import concurrent.futures
import json
import os
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent


def run_json(program, *arguments):
    done = subprocess.run([program, *map(str, arguments), "--json", "-"], capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(done.stderr.strip() or f"exit code {done.returncode}")
    return json.loads(done.stdout)


def measure(program, name, method, size, extra, folder, with_metro):
    config = json.loads((ROOT / "configs/models" / f"{name}.json").read_text())
    mesh = (ROOT / "configs/models" / config["mesh"]).resolve()
    skeleton = (ROOT / "configs/models" / config["skeleton"]).resolve()
    row = {"model": name, "method": method, "size": size}
    stem = pathlib.Path(folder) / f"{name}-{method}-{size}"
    model, out = stem.with_suffix(".skx.exr"), stem.with_suffix(".ply")
    try:
        encoded = run_json(program, "encode", mesh, skeleton, "-o", model, "--method", method, "--size", size, *extra)
        row["times_ms"] = encoded["times_ms"]
        row["used_fraction"] = encoded["atlas"]["used_fraction"]
        row["flipped_triangles"] = sum(bone["flipped_triangles"] for bone in encoded["bones"] if bone["method"] == "vsm")
        row["unseen_area_fraction"] = sum(b["unseen_area_fraction"] * b["area"] for b in encoded["bones"]) / sum(b["area"] for b in encoded["bones"])
        run_json(program, "reconstruct", model, "-o", out)
        manifold = run_json(program, "inspect", out)
        row["closed_manifold"] = manifold["closed_manifold"]
        row["genus"] = manifold["genus"]
        row["components"] = manifold["components"]
        row["watertight"] = manifold["closed_manifold"] and manifold["components"] == 1 and manifold["genus"] == encoded["mesh"]["genus"]
        if with_metro:
            metro = run_json(program, "metro", mesh, out)
            row["surface_mean"] = (metro["forward"]["mean"] + metro["backward"]["mean"]) / 2
            row["surface_max"] = max(metro["forward"]["max"], metro["backward"]["max"])
            row["vertex_mean"] = metro["vertex"]["mean"]
            row["vertex_std"] = metro["vertex"]["std"]
    except RuntimeError as error:
        row["error"] = str(error)
    finally:
        for path in (model, out):
            path.unlink(missing_ok=True)
    return row


def main():
    models = sorted(path.stem for path in (ROOT / "configs/models").glob("*.json"))
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default=ROOT / "build/release/bin/skeletex")
    parser.add_argument("--models", nargs="+", default=models, choices=models, metavar="NAME")
    parser.add_argument("--methods", nargs="+", default=["spd", "vsm", "hybrid"], choices=["spd", "vsm", "hybrid"])
    parser.add_argument("--sizes", nargs="+", type=int, default=[32, 64, 128, 256, 512, 1024, 2048])
    parser.add_argument("--no-metro", action="store_true", help="topology only")
    parser.add_argument("--jobs", type=int, default=2, help="processes at once, each with a kernel cache of its own")
    parser.add_argument("--json", type=pathlib.Path, help="write the rows to this file")
    parser.add_argument("encode_options", nargs="*", help="further options of `skeletex encode`, after --")
    options = parser.parse_args()

    jobs = [(name, method, size) for name in options.models for method in options.methods for size in options.sizes]
    rows = []
    with tempfile.TemporaryDirectory() as folder:

        def work(job):
            return measure(str(options.program), *job, options.encode_options, folder, not options.no_metro)

        with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
            for row in pool.map(work, jobs):
                rows.append(row)
                label = f"{row['model']:16s} {row['method']:7s} {row['size']:5d}"
                if "error" in row:
                    print(f"{label}  FAILED: {row['error']}", flush=True)
                    continue
                text = f"{label}  {'watertight' if row['watertight'] else 'NOT WATERTIGHT'}  genus {row['genus']}  flips {row['flipped_triangles']}"
                if "surface_mean" in row:
                    text += f"  mean {row['surface_mean']:.2e}  max {row['surface_max']:.1e}  vertices {row['vertex_mean']:.2e}"
                print(text, flush=True)
    if options.json:
        temporary = options.json.with_suffix(".tmp")
        temporary.write_text(json.dumps(rows, indent=1) + "\n")
        os.replace(temporary, options.json)
    return any("error" in row or not row["watertight"] for row in rows)


if __name__ == "__main__":
    sys.exit(main())
