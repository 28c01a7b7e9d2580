#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Makes a skeleton for every mesh and compares it with the hand-made ones: a table as CSV and Markdown.

    scripts/skeletons.py -o FOLDER [MESH..] [--size 256] [--for pose|size] [--program FILE]

Without meshes: those of build/meshes that are closed, in one piece and have 300 vertices or more. FOLDER gets skeletons.csv, skeletons.md and
the skeletons. Errors are the symmetric surface mean, divided by the diagonal, of a model by VSM of that size. Where configs/skeletons has
several skeletons of a mesh, the best one counts.
"""
import argparse
import csv
import json
import pathlib
import statistics
import subprocess
import tempfile

SOURCE = pathlib.Path(__file__).resolve().parent.parent


class Program:
    def __init__(self, path):
        self.path = path

    def json(self, *arguments):
        """The results of a command, or its message."""
        run = subprocess.run([self.path, *map(str, arguments), "--json", "-"], capture_output=True, text=True)
        return (json.loads(run.stdout), "") if run.returncode == 0 and run.stdout else (None, run.stderr.strip())

    def error(self, mesh, skeleton, size):
        with tempfile.TemporaryDirectory() as folder:
            model, back = f"{folder}/m.skx.exr", f"{folder}/m.ply"
            if not self.json("encode", mesh, skeleton, "-o", model, "--size", size)[0]:
                return None
            self.json("reconstruct", model, "-o", back)
            distances = self.json("metro", mesh, back)[0]
            return (distances["forward"]["mean"] + distances["backward"]["mean"]) / 2


def suitable(program):
    """Meshes of build/meshes that a skeleton can be made for."""
    meshes = []
    for path in sorted((SOURCE / "build/meshes").glob("*.off")):
        found = program.json("inspect", path)[0]
        if found and found.get("closed_manifold") and found["components"] == 1 and found["vertices"] >= 300:
            meshes.append(path)
    return meshes


def hand_made(mesh):
    """Skeletons of configs/skeletons by the configurations of models that use this mesh."""
    skeletons = []
    for path in sorted((SOURCE / "configs/models").glob("*.json")):
        config = json.loads(path.read_text())
        if (path.parent / config["mesh"]).resolve() == mesh.resolve():
            skeletons.append((path.parent / config["skeleton"]).resolve())
    return skeletons


def row_of(program, mesh, folder, size, purpose):
    skeleton = folder / f"{mesh.stem}.skeleton.json"
    made, message = program.json("skeletonize", mesh, "-o", skeleton, "--for", purpose)
    info = program.json("inspect", mesh)[0]
    row = {"mesh": mesh.stem, "triangles": info["triangles"], "genus": info["genus"], "accepted": bool(made), "bones": "", "seconds": "",
           "error": "", "by_hand": "", "ratio": "", "note": ""}
    if not made:
        row["note"] = message.splitlines()[-1] if message else ""
    else:
        row |= {"bones": made["bones"], "seconds": round(made["seconds"], 2), "note": made["chosen"], "error": program.error(mesh, skeleton, size)}
        row["accepted"] = row["error"] is not None
    errors = [e for e in (program.error(mesh, s, size) for s in hand_made(mesh)) if e is not None]
    if errors:
        row["by_hand"] = min(errors)
        if row["error"]:
            row["ratio"] = row["error"] / row["by_hand"]
    return row


def text_of(value):
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def summary_of(rows, size):
    lines = []
    for title, chosen in (("genus 0", [r for r in rows if r["genus"] == 0]), ("genus 1 and more", [r for r in rows if r["genus"] > 0])):
        if chosen:
            lines.append(f"* {title}: {sum(r['accepted'] for r in chosen)} of {len(chosen)} accepted")
    ratios = [r["ratio"] for r in rows if r["ratio"] != ""]
    if ratios:
        lines.append(f"* error at {size} against the best hand-made skeleton: median {statistics.median(ratios):.2f}, "
                     f"{sum(r <= 1.5 for r in ratios)} of {len(ratios)} at most 1.5, largest {max(ratios):.2f}")
    return lines


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("meshes", nargs="*", type=pathlib.Path)
    parser.add_argument("-o", "--output", required=True, type=pathlib.Path)
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--for", dest="purpose", choices=["pose", "size"], default="pose")
    parser.add_argument("--program", default=str(SOURCE / "build/release/bin/skeletex"))
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    program = Program(arguments.program)
    rows = []
    for mesh in arguments.meshes or suitable(program):
        rows.append(row_of(program, mesh, arguments.output, arguments.size, arguments.purpose))
        print("  ".join(text_of(v) for v in rows[-1].values()), flush=True)
    with open(arguments.output / "skeletons.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    lines = summary_of(rows, arguments.size) + ["", "| " + " | ".join(rows[0]) + " |", "|" + "---|" * len(rows[0])]
    lines += ["| " + " | ".join(text_of(v) for v in row.values()) + " |" for row in rows]
    (arguments.output / "skeletons.md").write_text("# Skeletons by themselves\n\n" + "\n".join(lines) + "\n")
    print("\n".join(summary_of(rows, arguments.size)))


if __name__ == "__main__":
    main()
