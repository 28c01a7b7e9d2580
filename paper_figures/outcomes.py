#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""What became of the items of a sweep: the table of outcomes, and the share of items done within a time, as a curve.

    paper_figures/outcomes.py results/sweep_models [--by PARAMETER] [-o PICTURE]

Prints the table as Markdown, a row for each value of the parameter (or for `model`, or `genus`), and draws the curve to outcomes.png
beside the results. Ends with 1 when an item is wrong or crashed.
"""

import argparse
import json
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

OUTCOMES = ["success", "out of memory", "out of time", "refused", "crashed", "wrong"]


def group_of(row, parameter):
    value = row["model"] if parameter == "model" else row["parameters"].get(parameter, row["columns"].get(parameter))
    return "-" if value is None else str(value)


def groups_of(rows, parameter):
    """The parameter's values: numbers by size, others as they come."""
    groups = dict.fromkeys(group_of(row, parameter) for row in rows) if parameter else []
    return sorted(groups, key=lambda group: int(group) if group.isdigit() else 0)


def reason_of(row):
    """The line of the error, without the warnings before it."""
    lines = row["reason"].splitlines()
    return next((line for line in lines if line.startswith("error")), lines[0])


def table(rows, parameter):
    groups = groups_of(rows, parameter)
    lines = [f"| {parameter or ''} | items | " + " | ".join(OUTCOMES) + " | mean time, s |", "|---" + "|---:" * (len(OUTCOMES) + 2) + "|"]
    for name in [*groups, "all"]:
        part = [row for row in rows if name == "all" or group_of(row, parameter) == name]
        done = [row["seconds"] for row in part if row["outcome"] == "success"]
        counts = [sum(row["outcome"] == outcome for row in part) for outcome in OUTCOMES]
        cells = [f"{count} ({100 * count / len(part):.1f} %)" if outcome == "success" else str(count) for outcome, count in zip(OUTCOMES, counts)]
        mean = f"{sum(done) / len(done):.1f}" if done else "-"
        lines.append(" | ".join([f"| {name}", str(len(part)), *cells, mean]) + " |")
    return "\n".join(lines)


def draw(rows, parameter, path):
    figure, axes = plt.subplots(figsize=(8, 5))
    groups = groups_of(rows, parameter)
    longest = 1.05 * max(row["seconds"] for row in rows)
    for name in [*groups, "all"]:
        part = [row for row in rows if name == "all" or group_of(row, parameter) == name]
        times = sorted(row["seconds"] for row in part if row["outcome"] == "success")
        shares = [100 * (i + 1) / len(part) for i in range(len(times))]
        axes.step([0, *times, longest], [0, *shares, shares[-1] if shares else 0], where="post", label=name, color="black" if name == "all" else None,
                  linewidth=2 if name == "all" else 1.2)
    axes.set(xlabel="time of an item, all its steps (s)", ylabel="items that succeeded within it (%)", ylim=(0, 103), xlim=(0, longest))
    axes.grid(alpha=0.3)
    axes.legend(title=parameter, loc="lower right")
    figure.tight_layout()
    figure.savefig(path, dpi=120)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path, help="results of `skeletex run` or `skeletex collect`")
    parser.add_argument("--by", help="a row and a curve for each value of this parameter or column, or of model")
    parser.add_argument("-o", "--output", type=Path, help="picture (default: FOLDER/outcomes.png)")
    arguments = parser.parse_args()
    try:
        rows = json.loads((arguments.folder / "results.json").read_text())["rows"]
    except (OSError, ValueError, KeyError) as error:
        sys.exit(f"outcomes: {arguments.folder}/results.json: {error}; skeletex run or skeletex collect makes it")
    if not rows:
        sys.exit(f"outcomes: {arguments.folder}/results.json has no items")
    if arguments.by and all(group_of(row, arguments.by) == "-" for row in rows):
        known = ["model", *rows[0]["parameters"], *rows[0]["columns"]]
        sys.exit(f"outcomes: no item has \"{arguments.by}\"; there are {', '.join(known)}")
    print(table(rows, arguments.by))
    reasons = [f"{row['outcome']}: {row['key']}: {reason_of(row)}" for row in rows if row["outcome"] != "success"]
    if reasons:
        print("\n" + "\n".join(reasons))
    draw(rows, arguments.by, arguments.output or arguments.folder / "outcomes.png")
    sys.exit(any(row["outcome"] in ("wrong", "crashed") for row in rows))


main()
