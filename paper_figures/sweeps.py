# SPDX-License-Identifier: MIT
"""Beyond the paper: iterations of VSM and the area exponent against error; the paper's recipe against the default; error
beside other ways to as many vertices; error against bytes."""
import style
from blocks import Plot, Table
from results import symmetric
from style import plt


def _legend_above(figure, axis, columns=4):
    handles, labels = axis.get_legend_handles_labels()
    lines = -(-len(labels) // columns)
    figure.tight_layout(rect=(0, 0, 1, 1 - 0.28 * lines / figure.get_figheight()))
    figure.legend(handles, labels, loc="upper center", ncols=columns)
    return figure


def _per_model(models, height=4.4):
    """An axis per model, at most three beside each other."""
    columns = min(3, len(models))
    lines = -(-len(models) // columns)
    figure, axes = plt.subplots(lines, columns, figsize=(style.WIDTH, height * lines), sharey=True, squeeze=False)
    for axis in axes.flat[len(models):]:
        axis.set_visible(False)
    for axis, model in zip(axes.flat, models):
        axis.set_title(model)
        axis.tick_params(labelleft=True)
    return figure, list(axes.flat[:len(models)])


def draw_iterations(results):
    rows = results.rows("iterations")
    models = results.models("iterations")
    figure, axes = _per_model(models)
    for axis, model in zip(axes, models):
        for k, alpha in enumerate(results.parameters("iterations", "alpha")):
            some = [row for row in rows if row["model"] == model and row["parameters"]["alpha"] == alpha]
            colour, marker, dash = style.SERIES[k]
            axis.plot([row["parameters"]["iterations"] for row in some], [1e5 * symmetric(row["columns"]) for row in some], marker=marker, linestyle=dash, color=colour,
                      label=f"w A / A3^{alpha}" if alpha else "w A (paper)")
        axis.set_xlabel("iterations")
        axis.set_xticks(results.parameters("iterations", "iterations"))
    axes[0].set_ylim(0, 1.1 * axes[0].get_ylim()[1])  # shared
    axes[0].set_ylabel("symmetric mean / diagonal, 1e-5")
    return _legend_above(figure, axes[0])


def iterations(results):
    numbers = results.parameters("iterations", "iterations")
    lines = []
    for model in results.models("iterations"):
        for alpha in results.parameters("iterations", "alpha"):
            at = {row["parameters"]["iterations"]: symmetric(row["columns"]) for row in results.rows("iterations") if row["model"] == model and row["parameters"]["alpha"] == alpha}
            lines.append([f"{model}, {'w A (paper)' if not alpha else f'w A / A3^{alpha}'}"] + [f"{at[n]:.3e}" if n in at else "" for n in numbers])
    return [Plot("iterations", lambda: draw_iterations(results)), Table(["symmetric mean / diagonal after iterations"] + [str(n) for n in numbers], lines)]


def draw_recipe(results):
    rows = results.rows("recipe")
    sizes, models, recipes = results.parameters("recipe", "size"), results.models("recipe"), results.parameters("recipe", "recipe")
    figure, axes = plt.subplots(len(sizes), 1, figsize=(style.WIDTH, 3.4 * len(sizes)), squeeze=False)
    width = 0.8 / len(recipes)
    for axis, size in zip(axes.flat, sizes):
        for k, recipe in enumerate(recipes):
            heights = [next((symmetric(row["columns"]) for row in rows if row["model"] == model and row["parameters"] == {"recipe": recipe, "size": size}), 0) for model in models]
            axis.bar([i + (k - len(recipes) / 2 + 0.5) * width for i in range(len(models))], heights, width, color=style.SERIES[k][0], hatch=["", "//", "..", "\\\\", "xx", "--", "++"][k % 7],
                     edgecolor="white", label=recipe)
        axis.set_xticks(range(len(models)), models)
        axis.set_title(f"{size} x {size}")
        axis.set_ylabel("symmetric mean / diagonal")
        axis.grid(axis="x", visible=False)
        axis.ticklabel_format(axis="y", style="scientific", scilimits=(0, 0))
    return _legend_above(figure, axes[0][0])


def recipe(results):
    rows = results.rows("recipe")
    sizes = results.parameters("recipe", "size")
    lines = [[f"{model}, {name}"] + [next((f"{symmetric(row['columns']):.3e}" for row in rows if row["model"] == model and row["parameters"] == {"recipe": name, "size": size}), "") for size in sizes]
             for model in results.models("recipe") for name in results.parameters("recipe", "recipe")]
    return [Plot("recipe", lambda: draw_recipe(results)), Table(["symmetric mean / diagonal"] + [f"{size} x {size}" for size in sizes], lines)]


POSING_RULES = [("smooth", "smooth (default)"), ("polished", "smooth, polished"), ("dual_quaternions", "dual quaternions, 0.05"), ("dual_quaternions_narrow", "dual quaternions, 0.025"),
                ("linear", "linear, 0.05"), ("coordinates", "coordinates"), ("paper", "paper")]
POSING_COUNTS = [("new_folds", "new folds"), ("new_intersections", "new intersecting pairs of triangles")]


def _posing_rows(results):
    return [row for row in results.rows("posing") if row["parameters"]["method"] == "vsm"]


def draw_posing(results):
    rows = _posing_rows(results)
    figure, axes = plt.subplots(2, 1, figsize=(style.WIDTH, 6.8))
    width = 0.8 / len(POSING_RULES)
    for axis, (count, title) in zip(axes, POSING_COUNTS):
        for k, (rule, label) in enumerate(POSING_RULES):
            heights = [max(1, row["columns"][f"{rule}_{count}"]) for row in rows]
            axis.bar([i + (k - len(POSING_RULES) / 2 + 0.5) * width for i in range(len(rows))], heights, width, color=style.SERIES[k % len(style.SERIES)][0],
                     hatch=["", "//", "..", "\\\\", "xx", "--", "++"][k], edgecolor="white", label=label)
        axis.set_yscale("log")
        axis.set_xticks(range(len(rows)), [row["parameters"]["body"] for row in rows])
        axis.set_title(title)
        axis.grid(axis="x", visible=False)
    return _legend_above(figure, axes[0])


def posing(results):
    rows = _posing_rows(results)
    tables = [Table([title] + [row["parameters"]["body"] for row in rows], [[label] + [f"{row['columns'][f'{rule}_{count}']:,}" for row in rows] for rule, label in POSING_RULES])
              for count, title in POSING_COUNTS]
    return [Plot("posing", lambda: draw_posing(results))] + tables


WAYS = [("", "vertices", "texture"), ("simplified_", "simplified_vertices", "quadric simplification (meshoptimizer)"), ("remeshed_", "remeshed_vertices", "isotropic remesh (CGAL)")]


def draw_simplification(results):
    models = results.models("simplification")
    figure, axes = _per_model(models)
    for axis, model in zip(axes, models):
        some = sorted((row["columns"] for row in results.rows("simplification") if row["model"] == model), key=lambda columns: columns["vertices"])
        for (prefix, count, label), (colour, marker, dash) in zip(WAYS, style.SERIES):
            axis.loglog([columns[count] for columns in some], [(columns[prefix + "forward_mean"] + columns[prefix + "backward_mean"]) / 2 for columns in some], marker=marker,
                        linestyle=dash, color=colour, label=label)
        axis.set_xlabel("vertices")
    axes[0].set_ylabel("symmetric mean / diagonal")
    return _legend_above(figure, axes[0])


def simplification(results):
    lines = [[row["key"], f"{row['columns']['vertices']:,}"] + [f"{(row['columns'][prefix + 'forward_mean'] + row['columns'][prefix + 'backward_mean']) / 2:.2e}" for prefix, _, _ in WAYS]
             for row in results.rows("simplification")]
    return [Plot("simplification", lambda: draw_simplification(results)), Table(["symmetric mean / diagonal", "vertices"] + [label for _, _, label in WAYS], lines)]


def draw_bytes(results):
    rows = results.rows("bytes")
    models = results.models("bytes")
    figure, axes = _per_model(models)
    for axis, model in zip(axes, models):
        series = [(name, [row for row in rows if row["model"] == model and row["parameters"]["format"] == name]) for name in results.parameters("bytes", "format")]
        series.append(("the mesh itself by Draco, 8 to 16 bits", [row for row in results.rows("draco") if row["model"] == model]))
        for (label, some), (colour, marker, dash) in zip(series, style.SERIES):
            points = sorted((row["columns"]["bytes"], symmetric(row["columns"])) for row in some)
            axis.loglog([x for x, _ in points], [y for _, y in points], marker=marker, linestyle=dash, color=colour, label=label)
        axis.set_xlabel("bytes")
    axes[0].set_ylabel("symmetric mean / diagonal")
    return _legend_above(figure, axes[0])


def file_sizes(results):
    rows = results.rows("bytes")
    sizes, formats = results.parameters("bytes", "size"), results.parameters("bytes", "format")
    lines = []
    for model in results.models("bytes"):
        for name in formats:
            at = {row["parameters"]["size"]: row["columns"] for row in rows if row["model"] == model and row["parameters"]["format"] == name}
            lines.append([f"{model}, {name}"] + [f"{at[size]['bytes'] / 1000:,.0f} kB, {symmetric(at[size]):.1e}" if size in at else "" for size in sizes])
    return [Plot("bytes", lambda: draw_bytes(results)), Table(["bytes and symmetric mean / diagonal"] + [str(size) for size in sizes], lines)]
