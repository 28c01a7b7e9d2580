# SPDX-License-Identifier: MIT
"""Figure 14: distance of the original's vertices to the reconstruction against texture size, mean and standard deviation,
for every model and method; and the distance of the two surfaces, both directions, beside it."""
import style
from style import plt


def draw(results, folder):
    rows = style.rows(results, "fidelity")
    if not rows:
        return []
    models = style.unique(row["model"] for row in rows)
    methods = style.unique(row["parameters"]["method"] for row in rows)
    figure, axes = plt.subplots(2, len(models), figsize=(2.6 * len(models), 5.2), sharex=True, sharey="row", squeeze=False)
    for j, model in enumerate(models):
        for k, method in enumerate(methods):
            some = sorted((row for row in rows if row["model"] == model and row["parameters"]["method"] == method), key=lambda row: row["parameters"]["size"])
            sizes = [row["parameters"]["size"] for row in some]
            colour, marker, dash = style.SERIES[k]
            means = [row["columns"]["vertex_mean"] for row in some]
            deviations = [row["columns"]["vertex_std"] for row in some]
            axes[0][j].plot(sizes, means, marker=marker, linestyle=dash, color=colour, markersize=4, linewidth=1.2, label=f"{method}, mean")
            axes[0][j].plot(sizes, deviations, linestyle=":", color=colour, linewidth=0.9, label=f"{method}, deviation")
            axes[1][j].plot(sizes, [style.symmetric(row["columns"]) for row in some], marker=marker, linestyle=dash, color=colour, markersize=4, linewidth=1.2, label=method)
        axes[0][j].set_title(model)
        axes[1][j].set_xlabel("texture size")
        for i in (0, 1):
            axes[i][j].set_xscale("log", base=2)
            axes[i][j].set_yscale("log")
        axes[1][j].set_xticks(sizes, [str(size) for size in sizes])
    axes[0][0].set_ylabel("original's vertices / diagonal")
    axes[1][0].set_ylabel("surfaces, symmetric mean / diagonal")
    axes[0][-1].legend(fontsize=7)
    axes[1][-1].legend(fontsize=7)
    figure.tight_layout()
    return [style.save(figure, folder, "fig14_fidelity")]
