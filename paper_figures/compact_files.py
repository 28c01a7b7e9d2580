#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Compact files beside Draco at equal error: a table of all models, and error against bytes as curves.

    paper_figures/compact_files.py results/compact [--models NAME ..] [-o PICTURE]

Prints the table as Markdown, a row per model and a column per error, each with the bytes and their share of Draco's, and the geometric
mean of the shares; draws the curves to compact.png beside the results.
"""

import argparse
import json
import math
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import style


def share(row):
    return row["columns"]["bytes"] / row["columns"]["draco_bytes"]


def table(rows, models, errors):
    lines = ["| model | " + " | ".join(f"{error:g}" for error in errors) + " |", "|---" + "|---" * len(errors) + "|"]
    at = {(row["model"], float(row["parameters"]["error"])): row for row in rows}
    for model in models:
        cells = [f"{at[model, error]['columns']['bytes']:,}, {share(at[model, error]):.2f}" if (model, error) in at else "" for error in errors]
        lines.append(" | ".join([f"| {model}", *cells]) + " |")
    means = []
    for error in errors:
        logs = [math.log(share(row)) for row in rows if float(row["parameters"]["error"]) == error]
        means.append(f"{math.exp(sum(logs) / len(logs)):.2f} of {len(logs)}")
    lines.append(" | ".join(["| geometric mean of the shares", *means]) + " |")
    return "\n".join(lines)


def draw(rows, models, path):
    figure, axes = plt.subplots(2, math.ceil(len(models) / 2), figsize=(3.6 * math.ceil(len(models) / 2), 6.4), squeeze=False)
    for axis, model in zip(axes.flat, models):
        some = [row["columns"] for row in rows if row["model"] == model]
        for (label, size, error), (colour, marker, dash) in zip((("compact file", "bytes", "mean"), ("Draco, simplified or not", "draco_bytes", "draco_mean")), style.SERIES):
            points = sorted((columns[size], columns[error]) for columns in some)
            axis.loglog([x for x, _ in points], [y for _, y in points], marker=marker, linestyle=dash, color=colour, label=label)
        axis.set_title(model)
    for axis in axes.flat[len(models):]:
        axis.axis("off")
    for axis in axes[-1]:
        axis.set_xlabel("bytes")
    for axis in axes[:, 0]:
        axis.set_ylabel("symmetric mean / diagonal")
    handles, labels = axes.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper center", ncols=2, frameon=False)
    figure.tight_layout(rect=(0, 0, 1, 0.95))
    figure.savefig(path, dpi=100)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results", type=Path, help="folder of the experiment compact")
    parser.add_argument("--models", nargs="+", help="whose curves are drawn (default: the first six)")
    parser.add_argument("-o", "--output", type=Path, help="the picture (default: compact.png beside the results)")
    arguments = parser.parse_args()
    rows = [row for row in json.loads((arguments.results / "results.json").read_text())["rows"] if row["outcome"] == "success"]
    models = sorted({row["model"] for row in rows})
    print(table(rows, models, sorted({float(row["parameters"]["error"]) for row in rows}, reverse=True)))
    draw(rows, arguments.models or models[:6], arguments.output or arguments.results / "compact.png")


if __name__ == "__main__":
    main()
