# SPDX-License-Identifier: MIT
"""The paper's figures that explain: drawn anew, from the formulas that the program uses."""
import numpy as np
from matplotlib.path import Path
from matplotlib.patches import Arc, Circle, Polygon, Wedge
from matplotlib.tri import Triangulation

import style
from blocks import Plot
from style import plt

BLUE, RED, GREEN, GREY, GOLD = "#1b3a6b", "#c8553d", "#3f8f5f", "#5b5b5b", "#d9a441"
FILLS = ["#c9d6ea", "#f3d3ca", "#cfe5d6", "#e6dff0"]


def unit(vector):
    return np.asarray(vector, float) / np.linalg.norm(vector)


def polar(degrees, length=1.0):
    return length * np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])


def _bone(axis, a, b, label="", colour=BLUE, offset=(0, 0.12)):
    axis.plot([a[0], b[0]], [a[1], b[1]], color=colour, linewidth=4, solid_capstyle="round", zorder=4)
    axis.plot([a[0], b[0]], [a[1], b[1]], "o", color="white", markeredgecolor=colour, markeredgewidth=2, markersize=8, zorder=5)
    if label:
        axis.annotate(label, ((a[0] + b[0]) / 2 + offset[0], (a[1] + b[1]) / 2 + offset[1]), color=colour, ha="center", fontsize=12, zorder=6)


def _arrow(axis, a, b, colour, width=1.6):
    axis.annotate("", xy=b, xytext=a, arrowprops={"arrowstyle": "-|>", "color": colour, "linewidth": width, "shrinkA": 0, "shrinkB": 0}, zorder=6)


# --- Figure 2 ---------------------------------------------------------------------------------------------------------

def separation_planes():
    figure, (left, right) = plt.subplots(1, 2, figsize=(style.WIDTH, 4.9), width_ratios=[1, 1.35])
    node, towards_b, towards_i = np.zeros(2), np.array([-1.0, 0.0]), polar(50)
    plane = unit(towards_b + towards_i)
    normal = unit(towards_b - towards_i)
    left.plot(*zip(-1.1 * plane, 1.6 * plane), color=RED, linewidth=2)
    _bone(left, node, 1.6 * towards_b, "B", offset=(-0.1, -0.28))
    _bone(left, node, 1.6 * towards_i, "$B_i$", GREEN, offset=(0.22, -0.1))
    _arrow(left, node, 0.9 * normal, RED)
    left.annotate("normal $d_B - d_i$", 0.9 * normal + [-0.05, -0.22], color=RED, ha="center")
    left.annotate("separation plane $SP_i$", 1.6 * plane + [-0.1, 0.08], color=RED, ha="center")
    middle = np.degrees(np.arctan2(plane[1], plane[0]))
    for a, b in ((50, middle), (middle, 180)):
        left.add_patch(Arc(node, 1.2, 1.2, theta1=a, theta2=b, color=GREY))
        left.annotate("$\\alpha$", polar((a + b) / 2, 0.74), ha="center", va="center", color=GREY)
    left.set_title("One plane for each two bones, with the same angle to both")
    left.set_xlim(-2, 1.7)
    left.set_ylim(-1.15, 1.95)

    head, tail = np.array([-1.0, 0.0]), np.array([1.0, 0.0])
    bones = {"B": (head, tail), "$B_1$": (head, head + polar(155, 1.2)), "$B_2$": (tail, tail + polar(65, 1.2)), "$B_3$": (tail, tail + polar(-50, 1.2))}
    x, y = np.meshgrid(np.linspace(-2.7, 2.5, 520), np.linspace(-1.7, 1.7, 340))
    at_head = [(x - head[0]) * d[0] + (y - head[1]) * d[1] for d in (unit(tail - head), polar(155))]
    at_tail = [(x - tail[0]) * d[0] + (y - tail[1]) * d[1] for d in (unit(head - tail), polar(65), polar(-50))]
    beyond_head, beyond_tail = at_head[1] > at_head[0], np.maximum(at_tail[1], at_tail[2]) > at_tail[0]
    label = np.where(beyond_head, 1, np.where(beyond_tail, np.where(at_tail[1] > at_tail[2], 2, 3), 0))
    right.imshow(np.array([plt.matplotlib.colors.to_rgb(fill) for fill in FILLS])[label], extent=(-2.7, 2.5, -1.7, 1.7), origin="lower", interpolation="nearest", zorder=0)
    right.contour(x, y, label, levels=[0.5, 1.5, 2.5], colors=RED, linewidths=1.6, zorder=1)
    for k, (name, (a, b)) in enumerate(bones.items()):
        _bone(right, a, b, name, [BLUE, GREEN, GREEN, GREEN][k], offset=[(0, 0.12), (-0.05, 0.15), (0.25, -0.1), (0.25, 0.05)][k])
    right.annotate("$Sub_B$", (-0.15, -0.75), color=BLUE, fontsize=14, ha="center")
    right.annotate("linear node", (-1.12, -0.3), ha="right", va="center", color=GREY)
    right.annotate("branch node", (0.8, -0.3), ha="right", va="center", color=GREY)
    right.set_title("All planes of a bone bound its cell (section through space)")
    for axis in (left, right):
        style.bare(axis)
    figure.tight_layout()
    return figure


# --- Figure 3 ---------------------------------------------------------------------------------------------------------

def _clip(polygon, point, normal):
    """The part of a convex polygon where (x - point) . normal >= 0."""
    kept = []
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0)):
        da, db = np.dot(a - point, normal), np.dot(b - point, normal)
        if da >= 0:
            kept.append(a)
        if da * db < 0:
            kept.append(a + (b - a) * da / (da - db))
    return np.array(kept)


def _shape_mesh():
    """A triangulation of a bent body: two limbs that lie beside each other and meet on the right."""
    outline = np.array([(0, 0), (9.4, 0), (10.6, 0.8), (11, 2.6), (10.6, 4.4), (9.4, 5.2), (1.2, 5.2), (0.4, 4.3), (1.2, 3.4), (8.2, 3.4), (8.8, 2.6), (8.2, 1.8), (0, 1.8)], float)
    random = np.random.default_rng(2)
    grid = np.stack(np.meshgrid(np.arange(0.25, 11, 0.5), np.arange(0.25, 5.2, 0.45)), -1).reshape(-1, 2)
    grid += random.uniform(-0.1, 0.1, grid.shape)
    path = Path(outline)
    inner = grid[path.contains_points(grid)]
    border = np.concatenate([a + (b - a) * np.linspace(0, 1, max(2, int(np.linalg.norm(b - a) / 0.5)), endpoint=False)[:, None] for a, b in zip(outline, np.roll(outline, -1, axis=0))])
    near = np.min(np.linalg.norm(inner[:, None] - border[None], axis=2), axis=1) < 0.22
    points = np.concatenate([border, inner[~near]])
    mesh = Triangulation(points[:, 0], points[:, 1])
    centres = points[mesh.triangles].mean(axis=1)
    mesh.set_mask(~path.contains_points(centres))
    return points, mesh


def cutting():
    points, mesh = _shape_mesh()
    triangles = mesh.get_masked_triangles()
    nodes = np.array([(2.6, 0.9), (6.6, 0.9)])
    planes = [(nodes[0], unit((1, -0.12))), (nodes[1], unit((-1, -0.16)))]
    parts = []  # of each triangle: the polygon between both planes
    for triangle in triangles:
        polygon = points[triangle]
        for point, normal in planes:
            polygon = _clip(polygon, point, normal) if len(polygon) else polygon
        parts.append(polygon if len(polygon) > 2 else None)
    # Flood fill over common edges, from the triangle that holds the middle of the bone.
    edges = {}
    for k, triangle in enumerate(triangles):
        for a, b in zip(triangle, np.roll(triangle, -1)):
            edges.setdefault((min(a, b), max(a, b)), []).append(k)
    start = min((k for k, part in enumerate(parts) if part is not None), key=lambda k: np.linalg.norm(parts[k].mean(axis=0) - nodes.mean(axis=0)))
    reached, todo = {start}, [start]
    while todo:
        triangle = triangles[todo.pop()]
        for a, b in zip(triangle, np.roll(triangle, -1)):
            for other in edges[(min(a, b), max(a, b))]:
                if other not in reached and parts[other] is not None:
                    reached.add(other)
                    todo.append(other)
    figure, axes = plt.subplots(1, 3, figsize=(style.WIDTH, 3.0))
    for axis, title in zip(axes, ("The bone's planes cut the mesh", "New vertices on the planes", "Flood fill from the bone")):
        axis.triplot(points[:, 0], points[:, 1], triangles, color="#9a9a9a", linewidth=0.6, zorder=2)
        _bone(axis, *nodes, "")
        axis.set_title(title)
        axis.set_xlim(-0.3, 11.3)
        axis.set_ylim(-0.7, 6.0)
        style.bare(axis)
    for point, normal in planes:
        along = np.array([-normal[1], normal[0]])
        for axis in axes[:2]:
            ends = [point + t * along for t in sorted(((-0.5 - point[1]) / along[1], (5.9 - point[1]) / along[1]))]
            axis.plot(*zip(*ends), color=RED, linewidth=1.8, zorder=3)
        signs = (points - point) @ normal
        for a, b in {tuple(sorted(pair)) for pair in edges}:
            if signs[a] * signs[b] < 0:
                cut = points[a] + (points[b] - points[a]) * signs[a] / (signs[a] - signs[b])
                is_kept = cut[1] < 2.2
                axes[1].plot(*cut, "o", color=RED if is_kept else "white", markeredgecolor=RED, markersize=5 if is_kept else 4, zorder=5)
    axes[1].annotate("above: not around the bone, left out\nbelow: the boundary of the segment", (4.4, 2.6), ha="center", va="center", fontsize=9, color=RED, zorder=7,
                     bbox={"facecolor": "white", "edgecolor": "none", "pad": 1})
    for k, part in enumerate(parts):
        if part is not None:
            axes[2].add_patch(Polygon(part, facecolor="#7fa6d6" if k in reached else "#dddddd", edgecolor="#33507c" if k in reached else "#999999", linewidth=0.6, zorder=3))
    axes[2].annotate("above: between the planes too,\nbut not reached", (4.4, 2.6), ha="center", va="center", fontsize=9, color=GREY)
    figure.tight_layout()
    return figure


# --- Figure 5 ---------------------------------------------------------------------------------------------------------

def spd_map():
    figure, (side, across, cap) = plt.subplots(1, 3, figsize=(style.WIDTH, 3.4), width_ratios=[5.6, 2.3, 2.8])
    length, k_head, k_tail = 4.0, -0.55, 0.75  # of the planes: x = k w at the head, x = length + k w at the tail
    point = np.array([2.1, 1.45])
    a_head, a_tail = np.array([k_head * point[1], point[1]]), np.array([length + k_tail * point[1], point[1]])
    u = (point[0] - a_head[0]) / (a_tail[0] - a_head[0])
    foot = np.array([u * length, 0.0])
    for x, k, name in ((0, k_head, "$SP_H$"), (length, k_tail, "$SP_T$")):
        side.plot([x - 0.6 * k, x + 2.25 * k], [-0.6, 2.25], color=RED, linewidth=1.8)
        side.annotate(name, (x + 2.3 * k, 2.32), color=RED, ha="center")
    side.plot([a_head[0] - 0.5, a_tail[0] + 0.5], [point[1]] * 2, color=GREY, linewidth=1, linestyle="--")
    side.annotate("$L_P$", (a_tail[0] + 0.6, point[1]), va="center", color=GREY)
    slope = (1 - u) * k_head + u * k_tail
    side.plot([foot[0], foot[0] + 2.1 * slope], [0, 2.1], color=GREEN, linewidth=2, zorder=3)
    for position, name, colour, shift in ((point, "P", "black", (0.16, 0.1)), (a_head, "$A_H$", RED, (-0.36, 0.12)), (a_tail, "$A_T$", RED, (0.1, -0.36)), (foot, "W = H + u (T - H)", GREEN, (-0.75, -0.55))):
        side.plot(*position, "o", color=colour, markersize=7, zorder=6)
        side.annotate(name, position + np.array(shift), color=colour)
    _bone(side, (0, 0), (length, 0))
    side.annotate("H", (-0.25, -0.3), ha="center")
    side.annotate("T", (length + 0.25, -0.3), ha="center")
    side.annotate("all points with P's (u, v)\nlie on this ray", (foot[0] + 2.1 * slope + 0.15, 2.1), color=GREEN, va="center", fontsize=10)
    side.set_title("$u = |P - A_H| \\, / \\, |A_T - A_H|$")
    side.set_xlim(-1.5, 6.3)
    side.set_ylim(-0.75, 2.7)

    across.add_patch(Circle((0, 0), 0.06, color=BLUE, zorder=5))
    angle = 130
    for degrees, size, colour, name in ((0, 1.3, GREY, "s"), (angle, 1.3, GREEN, "s'")):
        _arrow(across, (0, 0), polar(degrees, size), colour)
        across.annotate(name, polar(degrees, size + 0.16), color=colour, ha="center", va="center", fontsize=12)
    across.plot(*polar(angle, 1.0), "o", color="black", zorder=7)
    across.annotate("P", polar(angle, 1.0) + [0.13, 0.1])
    across.add_patch(Arc((0, 0), 0.9, 0.9, theta1=0, theta2=angle, color=GREY))
    across.annotate("$\\beta$", polar(angle / 2, 0.62), ha="center", va="center", color=GREY, fontsize=13)
    t = np.linspace(0, 2 * np.pi, 200)
    across.plot((1 + 0.1 * np.cos(3 * t)) * np.cos(t), (1 + 0.1 * np.cos(3 * t)) * np.sin(t), color="#bbbbbb", linewidth=1.4)
    across.set_title("$v = \\beta \\, / \\, 2 \\pi$")
    across.set_xlim(-1.5, 1.65)

    _bone(cap, (-2.0, 0), (0, 0))
    cap.annotate("T", (0, -0.36), ha="center")
    cap.plot([0, 0], [-1.5, 1.5], color=RED, linewidth=1.4, linestyle="--")
    for degrees in range(0, 91, 15):
        cap.plot(*zip((0, 0), polar(degrees, 1.5)), color=GREEN, linewidth=1, zorder=2)
        if degrees:
            cap.plot(*zip((0, 0), polar(-degrees, 1.5)), color=GREEN, linewidth=1, zorder=2)
    a = np.radians(np.linspace(-90, 90, 60))
    cap.plot(1.3 * np.cos(a), 1.2 * np.sin(a), color="#bbbbbb", linewidth=1.6)
    cap.plot([-2, 0], [1.15, 1.2], color="#bbbbbb", linewidth=1.6)
    cap.plot([-2, 0], [-1.15, -1.2], color="#bbbbbb", linewidth=1.6)
    cap.annotate("pole", (1.55, 0), va="center", color=GREEN)
    cap.set_title("A free end: rays of a hemisphere")
    for axis in (side, across, cap):
        style.bare(axis)
    figure.tight_layout()
    return figure


# --- Figure 8 ---------------------------------------------------------------------------------------------------------

def _frame(o):
    s = unit(np.cross(o, (0.0, 1.0, 0.0)))
    return unit(o), s, np.cross(unit(o), s)


def interval_bounds(directions):
    """Bounds in v of the intervals at the head of bone 0, and which neighbour each interval up to the next bound belongs to. Every two
    separation planes meet in two rays; a ray counts where no other plane hides it."""
    o, s, b = _frame(directions[0])
    normals = [directions[0] - other for other in directions[1:]]
    bounds = []
    for i, first in enumerate(normals):
        for second in normals[i + 1:]:
            for ray in (np.cross(first, second), -np.cross(first, second)):
                ray = unit(ray)
                if all(np.dot(normal, ray) > -1e-9 for normal in normals):
                    bounds.append(np.arctan2(ray @ b, ray @ s) / (2 * np.pi) % 1)
    bounds = sorted(bounds)
    owners = []
    for begin, end in zip(bounds, bounds[1:] + [bounds[0] + 1]):
        angle = np.pi * (begin + end)
        across = np.cos(angle) * s + np.sin(angle) * b
        owners.append(int(np.argmax([-(across @ normal) / (o @ normal) for normal in normals])))
    return bounds, owners


def _matched(bind, posed):
    """The posed bounds in the order of the bind pose's: each interval begins at the bound between the same two neighbours."""
    (bounds, owners), (other_bounds, other_owners) = bind, posed
    count = len(bounds)
    for shift in range(count):
        if other_owners[shift:] + other_owners[:shift] == owners:
            turned = other_bounds[shift:] + [bound + 1 for bound in other_bounds[:shift]]
            return [bound + round(bounds[0] - turned[0]) for bound in turned]
    raise ValueError("the poses have other neighbours")


def intervals():
    cases = [("Three bones at the node",
              [unit((1, 0, 0)), unit((-0.5, 0.85, 0.5)), unit((-0.6, -0.75, -0.1))], [unit((1, 0, 0)), unit((-0.35, 0.75, 0.75)), unit((-0.6, -0.75, -0.4))]),
             ("Four bones at the node",
              [unit((1, 0, 0)), unit((-0.3, 0.9, 0.1)), unit((-0.5, -0.6, 0.75)), unit((-0.4, -0.5, -0.8))], [unit((1, 0, 0)), unit((-0.3, 0.9, 0.3)), unit((0.35, -0.5, 0.8)), unit((-0.7, -0.5, -0.5))])]
    figure, axes = plt.subplots(2, 4, figsize=(style.WIDTH, 6.6), width_ratios=[1, 1, 1.15, 1.25])
    for line, (title, bind, posed) in zip(axes, cases):
        here = interval_bounds(bind)
        bounds = here[0]
        turned = _matched(here, interval_bounds(posed))
        for axis, values, directions, name in ((line[0], bounds, bind, "bind pose"), (line[1], turned, posed, "another pose")):
            ends = list(values[1:]) + [values[0] + 1]
            for begin, end, owner in zip(values, ends, here[1]):
                axis.add_patch(Wedge((0, 0), 1, 360 * begin, 360 * end, facecolor=FILLS[owner + 1], edgecolor="none"))
            o, s, b = _frame(directions[0])
            for k, direction in enumerate(directions[1:]):
                across = np.array([direction @ s, direction @ b])
                axis.plot(*zip((0, 0), 0.85 * unit(across)), color=GREEN, linewidth=3, solid_capstyle="round")
                axis.annotate(f"$B_{k + 1}$", 0.6 * unit(across) + 0.22 * np.array([-unit(across)[1], unit(across)[0]]), color=GREEN, ha="center", va="center", fontsize=12)
            for k, bound in enumerate(values):
                _arrow(axis, (0, 0), polar(360 * bound, 1.12), RED)
                axis.annotate(f"$r_{k}$" + ("'" if name != "bind pose" else ""), polar(360 * bound, 1.27), color=RED, ha="center", va="center")
            axis.plot([0.9, 1.0], [0, 0], color=GREY, linewidth=2)
            axis.annotate("v = 0", (0.86, 0.0), color=GREY, va="center", ha="right", fontsize=9)
            axis.plot(0, 0, "o", color="white", markeredgecolor=BLUE, markeredgewidth=2, markersize=9, zorder=8)
            axis.set_title(f"{title}\n{name}, seen along the bone" if axis is line[0] else f"\n{name}")
            axis.set_xlim(-1.45, 1.45)
            axis.set_ylim(-1.45, 1.45)
            style.bare(axis)
        # Intervals in v, and where they lie in the pose.
        axis = line[2]
        ends, turned_ends = list(bounds[1:]) + [bounds[0] + 1], list(turned[1:]) + [turned[0] + 1]
        for begin, end, t_begin, t_end, owner in zip(bounds, ends, turned, turned_ends, here[1]):
            axis.add_patch(Polygon([(begin, 1.0), (end, 1.0), (end, 0.75), (begin, 0.75)], facecolor=FILLS[owner + 1], edgecolor=RED))
            axis.add_patch(Polygon([(begin, 0.75), (end, 0.75), (t_end, 0.25), (t_begin, 0.25)], facecolor=FILLS[owner + 1], edgecolor="none", alpha=0.5))
            axis.add_patch(Polygon([(t_begin, 0.25), (t_end, 0.25), (t_end, 0.0), (t_begin, 0.0)], facecolor=FILLS[owner + 1], edgecolor=RED))
            axis.annotate(f"{end - begin:.2f}", ((begin + end) / 2, 0.875), ha="center", va="center", fontsize=9)
            axis.annotate(f"{t_end - t_begin:.2f}", ((t_begin + t_end) / 2, 0.125), ha="center", va="center", fontsize=9)
        low, high = min(bounds[0], turned[0]), max(ends[-1], turned_ends[-1])
        axis.set_xlim(low - 0.05, high + 0.05)
        axis.set_ylim(-0.1, 1.1)
        axis.set_yticks([0.125, 0.875], ["v'", "v"])
        axis.grid(False)
        axis.spines["left"].set_visible(False)
        axis.tick_params(left=False)
        axis.set_title("intervals and their lengths")
        # The turn of every column.
        axis = line[3]
        axis.plot(np.array([value for pair in zip(bounds, ends) for value in pair]) - bounds[0],
                  [360 * (value - base) for pair in zip(zip(bounds, turned), zip(ends, turned_ends)) for base, value in pair], color=BLUE, linewidth=2)
        for bound in bounds:
            axis.axvline(bound - bounds[0], color=RED, linewidth=0.9)
        reach = max(30, 1.3 * max(abs(360 * (value - base)) for base, value in zip(bounds, turned)))
        axis.set_ylim(-reach, reach)
        axis.set_xlabel("v, from the first bound")
        axis.set_ylabel("$\\alpha = 2\\pi\\,(v' - v)$, degrees")
        axis.set_title("turn of the columns at this node")
    figure.tight_layout()
    return figure


# --- Figure 17 --------------------------------------------------------------------------------------------------------

def fade(share, kind):
    """How much of the correction at the seam is left at a share of the width: `faded` of kernels/transfer.cl."""
    share = np.clip(share, 0, 1)
    return {"none": np.zeros_like(share), "linear": 1 - share, "cosine": 0.5 + 0.5 * np.cos(np.pi * share)}[kind]


def blending():
    figure, (curves, profiles) = plt.subplots(1, 2, figsize=(style.WIDTH, 4.2), width_ratios=[1, 1.35])
    x = np.linspace(0, 1.5, 400)
    kinds = ("cosine", "linear", "none")
    for kind, (colour, _, dash) in zip(kinds, style.SERIES):
        values = fade(x, kind)
        if kind == "none":
            values = np.where(x <= 0.0, 1, 0)
        curves.plot(x, values, color=colour, linestyle=dash, linewidth=2, label=kind + (" (default)" if kind == "cosine" else ""))
    curves.set_xlabel("distance from the seam / width of the fade")
    curves.set_ylabel("share of the correction")
    curves.legend(loc="upper right")
    curves.set_title("The blending functions")
    rows = np.linspace(-1.2, 2.2, 700)
    target = 1.0 + 0.1 * np.sin(2.2 * rows + 2.6)
    source = 0.75 + 0.07 * np.sin(4.5 * rows + 0.6)
    at_seam, slope = (np.interp(0, rows, values) for values in (target - source, np.gradient(target - source, rows)))
    profiles.plot(rows[rows <= 0], target[rows <= 0], color=GREY, linewidth=3, label="target, kept")
    profiles.plot(rows[rows >= 0], source[rows >= 0], color="#aaaaaa", linewidth=1.4, linestyle=(0, (2, 2)), label="source, as it is")
    for kind, (colour, _, dash) in zip(kinds[:2], style.SERIES):
        after = rows >= 0
        profiles.plot(rows[after], source[after] + (at_seam + slope * rows[after]) * fade(rows[after], kind), color=colour, linestyle=dash, linewidth=2, label=f"corrected, {kind}")
    profiles.axvline(0, color=RED, linewidth=1.4)
    profiles.annotate("seam", (-0.04, 0.72), color=RED, ha="right")
    profiles.axvspan(0, 1, color="#f5f0e4", zorder=0)
    profiles.set_xlabel("rows / width of the fade")
    profiles.set_ylabel("distance from the bone")
    profiles.set_title("A profile across the seam: height and slope are corrected")
    profiles.legend(loc="upper right", fontsize=9)
    figure.tight_layout()
    return figure


def figure2(_):
    return [Plot("fig02_separation_planes", separation_planes)]


def figure3(_):
    return [Plot("fig03_cutting", cutting)]


def figure5(_):
    return [Plot("fig05_spd", spd_map)]


def figure8(_):
    return [Plot("fig08_intervals", intervals)]


def figure17(_):
    return [Plot("fig17_blending", blending)]
