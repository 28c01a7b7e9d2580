# SPDX-License-Identifier: MIT
"""Beyond the paper: iterations of VSM and the area exponent against error; the paper's recipe against the default; error
beside other ways to as many vertices; error against bytes."""
import style
from style import plt


def draw_iterations(results, folder):
    rows = style.rows(results, "iterations")
    if not rows:
        return []
    models = style.unique(row["model"] for row in rows)
    figure, axes = plt.subplots(1, len(models), figsize=(3.0 * len(models), 2.8), squeeze=False)
    for j, model in enumerate(models):
        for k, alpha in enumerate(style.unique(row["parameters"]["alpha"] for row in rows)):
            some = [row for row in rows if row["model"] == model and row["parameters"]["alpha"] == alpha]
            colour, marker, dash = style.SERIES[k]
            axes[0][j].plot([row["parameters"]["iterations"] for row in some], [style.symmetric(row["columns"]) for row in some], marker=marker, linestyle=dash,
                            color=colour, markersize=4, label=f"w A / A3^{alpha}" if alpha else "w A (paper)")
        axes[0][j].set_title(model)
        axes[0][j].set_xlabel("iterations")
        axes[0][j].set_ylim(0, 1.15 * axes[0][j].get_ylim()[1])
    axes[0][0].set_ylabel("symmetric mean / diagonal")
    axes[0][-1].legend(fontsize=8)
    figure.tight_layout()
    return [style.save(figure, folder, "iterations")]


def draw_recipe(results, folder):
    rows = style.rows(results, "recipe")
    if not rows:
        return []
    sizes = style.unique(row["parameters"]["size"] for row in rows)
    models = style.unique(row["model"] for row in rows)
    recipes = style.unique(row["parameters"]["recipe"] for row in rows)
    figure, axes = plt.subplots(1, len(sizes), figsize=(max(3.4, 0.9 * len(models) * len(recipes) / 2) * len(sizes), 3.0), squeeze=False)
    width = 0.8 / len(recipes)
    for j, size in enumerate(sizes):
        for k, recipe in enumerate(recipes):
            heights = [next((style.symmetric(row["columns"]) for row in rows if row["model"] == model and row["parameters"] == {"recipe": recipe, "size": size}), 0)
                       for model in models]
            axes[0][j].bar([i + (k - len(recipes) / 2 + 0.5) * width for i in range(len(models))], heights, width, color=style.SERIES[k][0],
                           hatch=["", "//", "..", "\\\\", "xx"][k % 5], edgecolor="white", label=recipe)
        axes[0][j].set_xticks(range(len(models)), models)
        axes[0][j].set_title(f"{size} x {size}")
        axes[0][j].grid(axis="x", visible=False)
    axes[0][0].set_ylabel("symmetric mean / diagonal")
    figure.tight_layout()
    axes[0][-1].legend(fontsize=8, loc="upper left", bbox_to_anchor=(1, 1))  # beside what is laid out, which would make room for it
    return [style.save(figure, folder, "recipe")]


POSING_RULES = [("smooth", "smooth (default)"), ("polished", "smooth, polished"), ("dual_quaternions", "dual quaternions, 0.05"), ("dual_quaternions_narrow", "dual quaternions, 0.025"),
                ("linear", "linear, 0.05"), ("coordinates", "coordinates"), ("paper", "paper")]


def draw_posing(results, folder):
    rows = [row for row in style.rows(results, "posing") or [] if row["parameters"]["method"] == "vsm"]
    if not rows:
        return []
    names = [row["parameters"]["body"] for row in rows]
    figure, axes = plt.subplots(1, 2, figsize=(11, 3.4))
    width = 0.8 / len(POSING_RULES)
    for axis, (count, title) in zip(axes, [("new_folds", "new folds"), ("new_intersections", "new intersections")]):
        for k, (rule, label) in enumerate(POSING_RULES):
            heights = [max(1, row["columns"][f"{rule}_{count}"]) for row in rows]
            axis.bar([i + (k - len(POSING_RULES) / 2 + 0.5) * width for i in range(len(rows))], heights, width, color=style.SERIES[k % len(style.SERIES)][0],
                     hatch=["", "//", "..", "\\\\", "xx", "--", "++"][k], edgecolor="white", label=label)
        axis.set_yscale("log")
        axis.set_xticks(range(len(rows)), names)
        axis.set_title(title)
        axis.grid(axis="x", visible=False)
    figure.tight_layout()
    axes[-1].legend(fontsize=8, loc="upper left", bbox_to_anchor=(1, 1))
    return [style.save(figure, folder, "posing")]


def draw_simplification(results, folder):
    rows = style.rows(results, "simplification")
    if not rows:
        return []
    models = style.unique(row["model"] for row in rows)
    ways = [("", "vertices", "texture"), ("simplified_", "simplified_vertices", "quadric simplification (meshoptimizer)"), ("remeshed_", "remeshed_vertices", "isotropic remesh (CGAL)")]
    figure, axes = plt.subplots(1, len(models), figsize=(3.4 * len(models) + 1, 3.0), sharey=True, squeeze=False)
    for j, model in enumerate(models):
        some = sorted((row["columns"] for row in rows if row["model"] == model), key=lambda columns: columns["vertices"])
        for k, (prefix, count, label) in enumerate(ways):
            colour, marker, dash = style.SERIES[k]
            axes[0][j].loglog([columns[count] for columns in some], [(columns[prefix + "forward_mean"] + columns[prefix + "backward_mean"]) / 2 for columns in some], marker=marker,
                              linestyle=dash, color=colour, markersize=4, label=label)
        axes[0][j].set_title(model)
        axes[0][j].set_xlabel("vertices")
    axes[0][0].set_ylabel("symmetric mean / diagonal")
    figure.tight_layout()
    axes[0][-1].legend(fontsize=8, loc="upper left", bbox_to_anchor=(1, 1))  # beside what is laid out, which would make room for it
    return [style.save(figure, folder, "simplification")]


def draw_bytes(results, folder):
    rows = style.rows(results, "bytes")
    if not rows:
        return []
    draco = style.rows(results, "draco") or []
    models = style.unique(row["model"] for row in rows)
    figure, axes = plt.subplots(1, len(models), figsize=(3.2 * len(models) + 1, 3.0), sharey=True, squeeze=False)
    for j, model in enumerate(models):
        series = [(name, [row for row in rows if row["model"] == model and row["parameters"]["format"] == name]) for name in style.unique(row["parameters"]["format"] for row in rows)]
        series.append(("the mesh itself by Draco, 8 to 16 bits", [row for row in draco if row["model"] == model]))
        for k, (label, some) in enumerate(series):
            colour, marker, dash = style.SERIES[k]
            points = sorted((row["columns"]["bytes"], style.symmetric(row["columns"])) for row in some)
            axes[0][j].loglog([x for x, _ in points], [y for _, y in points], marker=marker, linestyle=dash, color=colour, markersize=4, label=label)
        axes[0][j].set_title(model)
        axes[0][j].set_xlabel("bytes")
    axes[0][0].set_ylabel("symmetric mean / diagonal")
    figure.tight_layout()
    axes[0][-1].legend(fontsize=8, loc="upper left", bbox_to_anchor=(1, 1))  # beside what is laid out, which would make room for it
    return [style.save(figure, folder, "bytes")]
