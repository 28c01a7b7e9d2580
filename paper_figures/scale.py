# SPDX-License-Identifier: MIT
"""Beyond the paper: what encoding costs against the number of triangles, both axes logarithmic."""
import math

import style
from blocks import Plot, Table
from style import plt

STAGES = [("command_s", "whole command", 1), ("half_edge_ms", "half edges", 1e-3), ("segmentation_ms", "segmentation", 1e-3),
          ("parameterization_ms", "parameterization", 1e-3), ("encoding_ms", "encoding", 1e-3)]


def draw(results):
    rows = [row["columns"] for row in results.rows("scale")]
    triangles = [row["triangles"] for row in rows]
    figure, (times, memory) = plt.subplots(1, 2, figsize=(style.WIDTH, 4.4))
    for (column, label, seconds), (colour, marker, dash) in zip(STAGES, style.SERIES):
        times.plot(triangles, [seconds * row[column] for row in rows], marker=marker, linestyle=dash, color=colour, label=label)
    first = next((row for row in rows if row["triangles"] > 100000), rows[0])
    scale = first["command_s"] / (first["triangles"] * math.log(first["triangles"]))
    times.plot(triangles, [scale * n * math.log(n) for n in triangles], linestyle=":", color="#999999", label="n log n")
    times.set_ylabel("seconds")
    memory.plot(triangles, [1024 * row["peak_memory_mb"] / row["triangles"] for row in rows], marker="o", color=style.SERIES[0][0])
    memory.axhline(1, linestyle=":", color="#999999")
    memory.set_ylabel("peak memory, KB per triangle")
    for axis in (times, memory):
        axis.set_xscale("log")
        axis.set_yscale("log")
        axis.set_xlabel("triangles")
    figure.tight_layout(rect=(0, 0, 1, 0.93))
    figure.legend(*times.get_legend_handles_labels(), loc="upper center", ncols=6)
    return figure


def make(results):
    rows = [row["columns"] for row in results.rows("scale")]
    return [Plot("scale", lambda: draw(results)),
            Table(["triangles", "whole command", "half edges", "segmentation", "parameterization", "encoding", "peak memory"],
                  [[f"{row['triangles']:,}", f"{row['command_s']:.2f} s"] + [f"{row[column]:.0f} ms" for column, _, _ in STAGES[1:]] + [f"{row['peak_memory_mb']:.0f} MB"] for row in rows])]
