# SPDX-License-Identifier: MIT
"""Figure 14: distance of the original's vertices to the reconstruction against texture size, mean and standard deviation, for every
model and method; and the distance of the two surfaces. And the size that a model needs."""
import style
from blocks import Plot, Table
from results import largest, symmetric
from style import plt

# What a distance is small enough for: (use, column, limit as a share of the diagonal).
USES = [("a picture in which the model is 250 pixels across, no point off by more than one", "furthest", 1 / 250),
        ("a picture of 1000 pixels, the same", "furthest", 1 / 1000),
        ("a picture of 4000 pixels, the same", "furthest", 1 / 4000),
        ("a print of 10 cm, no point off by more than 0.05 mm", "furthest", 0.05 / 100),
        ("measuring: mean distance below a hundred-thousandth of the diagonal", "mean", 1e-5)]


def curve(results, model, method):
    """Per size: what a reconstruction costs and how far it is off."""
    rows = sorted((row for row in results.rows("fidelity") if row["model"] == model and row["parameters"]["method"] == method), key=lambda row: row["parameters"]["size"])
    return [{"size": row["parameters"]["size"], "mean": symmetric(row["columns"]), "furthest": largest(row["columns"]), **row["columns"]} for row in rows]


def default_method(results):
    methods = results.parameters("fidelity", "method")
    return "vsm" if "vsm" in methods else methods[0]


def smallest_size(points, column, limit):
    """The smallest size from which on every larger one keeps the limit too, None if even the largest does not."""
    found = None
    for point in reversed(points):
        if point[column] > limit:
            break
        found = point["size"]
    return found


def _panels(results, draw, y_label):
    models, methods = results.models("fidelity"), results.parameters("fidelity", "method")
    columns = min(3, len(models))
    lines = -(-len(models) // columns)
    figure, axes = plt.subplots(lines, columns, figsize=(style.WIDTH, 4.2 * lines), sharex=True, sharey=True, squeeze=False)
    for axis in axes.flat[len(models):]:
        axis.set_visible(False)
    for axis, model in zip(axes.flat, models):
        for method, (colour, marker, dash) in zip(methods, style.SERIES):
            draw(axis, curve(results, model, method), method, colour, marker, dash)
        sizes = sorted(results.parameters("fidelity", "size"))
        axis.set_title(model)
        axis.set_xscale("log", base=2)
        axis.set_yscale("log")
        axis.set_xticks(sizes, [str(size) for size in sizes])
        axis.tick_params(labelbottom=True)
        axis.set_xlabel("texture size")
    for line in axes:
        line[0].set_ylabel(y_label)
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.tight_layout(rect=(0, 0, 1, 0.93))
    figure.legend(handles, labels, loc="upper center", ncols=6)
    return figure


def vertices(results):
    def draw(axis, points, method, colour, marker, dash):
        axis.plot([p["size"] for p in points], [p["vertex_mean"] for p in points], marker=marker, linestyle=dash, color=colour, label=f"{method}, mean")
        axis.plot([p["size"] for p in points], [p["vertex_std"] for p in points], linestyle=":", linewidth=1, color=colour, label=f"{method}, deviation")
    return _panels(results, draw, "vertices to surface / diagonal")


def surfaces(results):
    def draw(axis, points, method, colour, marker, dash):
        axis.plot([p["size"] for p in points], [p["mean"] for p in points], marker=marker, linestyle=dash, color=colour, label=f"{method}, mean")
        axis.plot([p["size"] for p in points], [p["furthest"] for p in points], linestyle=":", linewidth=1, color=colour, label=f"{method}, furthest point")
    return _panels(results, draw, "surface to surface / diagonal")


def make(results):
    sizes = sorted(results.parameters("fidelity", "size"))
    tables = []
    for title, number in (("Mean distance of the original's vertices / diagonal", lambda p: p["vertex_mean"]), ("Mean distance of the surfaces, both directions / diagonal", lambda p: p["mean"])):
        lines = []
        for model in results.models("fidelity"):
            for method in results.parameters("fidelity", "method"):
                at = {p["size"]: p for p in curve(results, model, method)}
                lines.append([f"{model}, {method}"] + [f"{number(at[size]):.2e}" if size in at else "" for size in sizes])
        tables.append(Table(["model, method"] + [str(size) for size in sizes], lines, title))
    return [Plot("fig14_fidelity", lambda: vertices(results), "Distance of the original's vertices, as in the paper."), tables[0],
            Plot("fig14_surface", lambda: surfaces(results), "Distance of the two surfaces, both directions."), tables[1]]


def which_size(results):
    """The answer to: which size does this model need?"""
    method = default_method(results)
    made = []
    for model in results.models("fidelity"):
        points = curve(results, model, method)
        diagonal = points[-1].get("diagonal")
        lines = []
        for use, column, limit in USES:
            size = smallest_size(points, column, limit)
            last = points[-1]
            answer = f"{size} x {size}" if size else f"more than {last['size']} (there {last[column]:.1e})"
            lines.append([use, f"{limit:.1e}", f"{limit * diagonal:.3g}" if diagonal else "", answer])
        made.append(Table(["you want", f"{model}: limit / diagonal", "in the mesh's units", "size that you need"], lines))
    for model in results.models("fidelity"):
        points = curve(results, model, method)
        head = ["size", "texels per vertex", "triangles", "file", "mean / diagonal", "furthest / diagonal", "mean, against half the size"]
        lines = []
        for before, p in zip([None] + points, points):
            vertices_of_input = p.get("input_vertices")
            lines.append([f"{p['size']} x {p['size']}", f"{p['size'] ** 2 / vertices_of_input:,.2f}" if vertices_of_input else "", f"{p['triangles']:,}" if p.get("triangles") else "",
                          f"{p['bytes'] / 1e6:.2f} MB", f"{p['mean']:.2e}", f"{p['furthest']:.2e}", f"{before['mean'] / p['mean']:.1f} times smaller" if before else ""])
        made.append(Table(head, lines, f"{model}, method {method}, default options"))
    return made
