# SPDX-License-Identifier: MIT
"""Beyond the paper: what encoding costs against the number of triangles, both axes logarithmic."""
import math

import style
from style import plt

STAGES = [("command_s", "whole command", 1), ("half_edge_ms", "half edges", 1e-3), ("segmentation_ms", "segmentation", 1e-3),
          ("parameterization_ms", "parameterization", 1e-3), ("encoding_ms", "encoding", 1e-3)]


def draw(results, folder):
    rows = [row["columns"] for row in style.rows(results, "scale") or []]
    if not rows:
        return []
    triangles = [row["triangles"] for row in rows]
    figure, (times, memory) = plt.subplots(1, 2, figsize=(8.4, 3.2))
    for (column, label, seconds), (colour, marker, dash) in zip(STAGES, style.SERIES):
        times.plot(triangles, [seconds * row[column] for row in rows], marker=marker, linestyle=dash, color=colour, markersize=4, label=label)
    first = next((row for row in rows if row["triangles"] > 100000), rows[0])
    scale = first["command_s"] / (first["triangles"] * math.log(first["triangles"]))
    times.plot(triangles, [scale * n * math.log(n) for n in triangles], linestyle=":", color="#999999", label="n log n")
    times.set_ylabel("seconds")
    times.legend(fontsize=7, loc="upper left")
    memory.plot(triangles, [1024 * row["peak_memory_mb"] / row["triangles"] for row in rows], marker="o", color=style.SERIES[0][0], markersize=4)
    memory.axhline(1, linestyle=":", color="#999999")
    memory.set_ylabel("peak memory, KB per triangle")
    for axis in (times, memory):
        axis.set_xscale("log")
        axis.set_yscale("log")
        axis.set_xlabel("triangles")
    # Room for the legend above the lines.
    low, high = times.get_ylim()
    times.set_ylim(low, high * (high / low) ** 0.45)
    figure.tight_layout()
    return [style.save(figure, folder, "scale")]
