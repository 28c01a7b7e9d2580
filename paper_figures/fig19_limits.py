# SPDX-License-Identifier: MIT
"""Figure 19, left: a bone whose separation planes cross inside the body, seen along the line where they cross."""
import json

import numpy as np
from matplotlib.collections import PolyCollection

import style
from blocks import Plot, Text
from results import ROOT, MissingInput
from schematics import BLUE, GREEN, GREY, RED, unit
from style import plt


def _read_off(path):
    words = path.read_text().split()
    vertices, faces = int(words[1]), int(words[2])
    points = np.array(words[4:4 + 3 * vertices], float).reshape(-1, 3)
    triangles = np.array(words[4 + 3 * vertices:4 + 3 * vertices + 4 * faces], int).reshape(-1, 4)[:, 1:]
    return points, triangles


def _planes_of(skeleton, bone, point):
    """At both ends of the bone: the node, and of its separation planes the one that the point lies furthest behind."""
    nodes = np.array([node["position"] for node in skeleton["nodes"]])
    ends = []
    for node in (bone["head"], bone["tail"]):
        direction = unit(nodes[bone["tail"] if node == bone["head"] else bone["head"]] - nodes[node])
        others = [unit(nodes[other["tail"] if other["head"] == node else other["head"]] - nodes[node]) for other in skeleton["bones"] if other is not bone and node in (other["head"], other["tail"])]
        normals = [unit(direction - other) for other in others]
        ends.append((nodes[node], min(normals, key=lambda normal: (point - nodes[node]) @ normal)))
    return ends


def draw(points, triangles, skeleton, finding):
    bone = next(bone for bone in skeleton["bones"] if bone["name"] == finding["bone"])
    place = np.array(finding["position"])
    (head, head_normal), (tail, tail_normal) = _planes_of(skeleton, bone, place)
    view = unit(np.cross(head_normal, tail_normal))
    if view[2] < 0:
        view = -view
    up = unit(np.array([0, 1, 0]) - view[1] * view)
    right = np.cross(up, view)
    axes2 = np.stack([right, up])
    flat = points @ axes2.T

    def behind(where):
        return ((where - head) @ head_normal < 0) & ((where - tail) @ tail_normal < 0)

    corners = points[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True) + 1e-30
    front = np.flatnonzero(normals @ view > 0)
    front = front[np.argsort(corners[front].mean(axis=1) @ view)]
    light = 0.55 + 0.45 * np.clip(normals[front] @ unit(view + 0.5 * up + 0.4 * right), 0, 1)
    base = np.where(behind(corners[front].mean(axis=1))[:, None], plt.matplotlib.colors.to_rgb("#e58a74"), plt.matplotlib.colors.to_rgb("#dcdcdc"))
    figure, axis = plt.subplots(figsize=(style.WIDTH, 7.6))
    axis.add_collection(PolyCollection(flat[triangles[front]], facecolors=base * light[:, None], edgecolors="face", linewidths=0.3, rasterized=True, zorder=1))
    nodes = np.array([node["position"] for node in skeleton["nodes"]]) @ axes2.T
    for other in skeleton["bones"]:
        axis.plot(*nodes[[other["head"], other["tail"]]].T, color=BLUE if other is bone else GREY, linewidth=4 if other is bone else 1.8, solid_capstyle="round", marker="o", markersize=5, zorder=4)
    axis.annotate(f"bone \"{bone['name']}\"", nodes[[bone["head"], bone["tail"]]].mean(axis=0) + [-0.04, 0.02], color=BLUE, ha="right", fontsize=12, zorder=7)
    low, high = flat.min(axis=0), flat.max(axis=0)
    size = (high - low).max()
    lines = []
    for node, normal, name in ((head, head_normal, skeleton["nodes"][bone["head"]]["name"]), (tail, tail_normal, skeleton["nodes"][bone["tail"]]["name"])):
        at, normal2 = node @ axes2.T, unit(normal @ axes2.T)
        along = np.array([-normal2[1], normal2[0]])
        along = along if along[0] > 0 else -along
        lines.append((at, along))
        axis.plot(*zip(at - 0.55 * size * along, at + 0.85 * size * along), color=RED, linewidth=2, zorder=5)
        end = at - 0.45 * size * along
        axis.annotate(f"plane at \"{name}\"", end + [0, 0.015 * size], color=RED, ha="right", va="bottom", fontsize=11, zorder=7, bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1})
    (p, d), (q, e) = lines
    t = np.linalg.solve(np.stack([d, -e], axis=1), q - p)[0]
    crossing = p + t * d
    axis.plot(*crossing, "X", color=RED, markersize=13, markeredgecolor="white", zorder=8)
    axis.annotate("the planes cross here,\ninside the body", crossing + [0.07 * size, 0.1 * size], color=RED, fontsize=11, zorder=8, bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 2})
    axis.plot(*(axes2 @ place), "o", color=GREEN, markersize=9, markeredgecolor="white", zorder=8)
    axis.annotate("the point of the message", axes2 @ place + [0.02 * size, -0.04 * size], color=GREEN, fontsize=11, va="top", zorder=8, bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 2})
    margin = 0.1 * size
    axis.set_xlim(low[0] - 2.2 * margin, high[0] + 2.5 * margin)
    axis.set_ylim(low[1] - margin, high[1] + margin)
    style.bare(axis)
    figure.tight_layout()
    return figure


def make(results):
    config = json.loads((ROOT / "configs" / "experiments" / "limits.json").read_text())
    made = []
    for row in results.rows("limits"):
        model = next(model for model in config["models"] if model["name"] == row["model"])
        folder = ROOT / "configs" / "experiments"
        for name in ("mesh", "skeleton"):
            if not (folder / model[name]).is_file():
                raise MissingInput(f"{(folder / model[name]).resolve()} is missing; scripts/install-dependencies.sh fetches the standard meshes")
        findings = [finding for finding in results.item("limits", row["key"])["validate"]["findings"] if finding["severity"] == "error"]
        longest = max((f for f in findings if f.get("bone")), key=lambda f: _length(folder / model["skeleton"], f["bone"]))
        made.append(Plot(f"fig19_limits_{row['model']}" if len(results.rows("limits")) > 1 else "fig19_limits",
                         lambda model=model, finding=longest: draw(*_read_off(folder / model["mesh"]), json.loads((folder / model["skeleton"]).read_text()), finding),
                         "Seen along the line where both planes cross, so that each of them is a line. Red: what lies behind both, in the cell of no bone."))
        message = row["columns"]["message"]
        made.append(Text("The program refuses it: " + message[message.find("error:"):]))
    return made


def _length(path, bone_name):
    skeleton = json.loads(path.read_text())
    bone = next(bone for bone in skeleton["bones"] if bone["name"] == bone_name)
    nodes = skeleton["nodes"]
    return float(np.linalg.norm(np.subtract(nodes[bone["tail"]]["position"], nodes[bone["head"]]["position"])))
