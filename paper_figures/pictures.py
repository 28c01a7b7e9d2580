# SPDX-License-Identifier: MIT
"""The paper's figures that are pictures: tables of what the experiments rendered, with their numbers."""
import textwrap

import style


def _models(rows):
    return style.unique(row["model"] for row in rows)


def fig04_11_segments(results, folder):
    rows = style.rows(results, "segments")
    if not rows:
        return []
    kinds = ["segments", "layout", "map"]
    return [style.sheet(results, "segments", [[f"{model}-{kind}.png" for model in _models(rows)] for kind in kinds], _models(rows), kinds, folder, "fig04_11_segments")]


def fig05_06_methods(results, folder):
    rows = style.rows(results, "methods")
    if not rows:
        return []
    methods = style.unique(row["parameters"]["method"] for row in rows)
    made = []
    for model in _models(rows):
        titles = [f"{row['parameters']['method']}: mean {style.symmetric(row['columns']):.1e}, max {style.largest(row['columns']):.1e}" for row in rows if row["model"] == model]
        made.append(style.sheet(results, "methods", [[f"{model}-{method}-{kind}.png" for method in methods] for kind in ("shaded", "checker")], titles, [model, "(u, v)"], folder,
                                f"fig05_06_methods_{model}", cell=3.2))
    return made


def fig07_tangent_space(results, folder):
    rows = style.rows(results, "tangent_space")
    if not rows:
        return []
    times = sorted(style.unique(row["parameters"]["time"] for row in rows))
    model = rows[0]["model"]
    titles = ["bind pose" if time == 0 else f"pose {time:g}" for time in times]
    return [style.sheet(results, "tangent_space", [[f"{model}-{time}.png" for time in times]], titles, None, folder, "fig07_tangent_space", cell=2.8)]


def fig09_lattice(results, folder):
    rows = style.rows(results, "lattice")
    if not rows:
        return []
    kinds = ["layout", "tubes", "surface"]
    return [style.sheet(results, "lattice", [[f"{model}-{kind}.png" for kind in kinds] for model in _models(rows)], ["a lattice per bone", "one constant displacement", "the texture's"],
                        _models(rows), folder, "fig09_lattice", cell=3.4)]


def fig10_distance(results, folder):
    rows = style.rows(results, "distance")
    if not rows:
        return []
    model = rows[0]["model"]
    return [style.sheet(results, "distance", [[f"{model}-{kind}.png" for kind in ("not_restored", "restored")]], ["not restored", "distances to the bones restored"], None, folder,
                        "fig10_distance", cell=3.6)]


def fig12_cyclic(results, folder):
    rows = style.rows(results, "cyclic")
    if not rows:
        return []
    titles = [f"{row['model']}, genus {row['columns']['genus']}" for row in rows]
    return [style.sheet(results, "cyclic", [[f"{model}-{kind}.png" for model in _models(rows)] for kind in ("segments", "checker")], titles, None, folder, "fig12_cyclic", cell=3.0)]


def fig13_detail(results, folder):
    rows = style.rows(results, "detail")
    if not rows:
        return []
    rows.sort(key=lambda row: row["parameters"]["size"])
    model = rows[0]["model"]
    titles = [f"{row['parameters']['size']}: {row['columns']['triangles']} triangles\nmean {style.symmetric(row['columns']):.1e}" for row in rows]
    return [style.sheet(results, "detail", [[f"{model}-{row['parameters']['size']}-flat.png" for row in rows]], titles, None, folder, "fig13_detail", cell=2.8)]


def fig15_results(results, folder):
    rows = style.rows(results, "results")
    if not rows:
        return []
    kinds = ["input", "layout", "map", "shaded", "error"]
    titles = ["input, skeleton", "layout", "texture", "reconstruction", "error of the vertices"]
    names = [f"{row['model']}\nmean {row['columns']['vertex_mean']:.1e}, deviation {row['columns']['vertex_std']:.1e}" for row in rows]
    return [style.sheet(results, "results", [[f"{row['model']}-{kind}.png" for kind in kinds] for row in rows], titles, names, folder, "fig15_results", cell=2.8)]


def fig16_morph(results, folder):
    rows = style.rows(results, "morph")
    if not rows:
        return []
    frames = [row["parameters"]["frame"].rsplit("-", 1) for row in rows]  # "man-homer-0.5"
    pairs, times = style.unique(pair for pair, _ in frames), sorted(style.unique(t for _, t in frames), key=float)
    return [style.sheet(results, "morph", [[f"{pair}-{t}.png" for t in times] for pair in pairs], [f"t = {t}" for t in times], pairs, folder, "fig16_morph", cell=2.6)]


def fig17_transfer(results, folder):
    rows = style.rows(results, "transfer")
    if not rows:
        return []
    cases = style.unique(row["parameters"]["case"] for row in rows)
    blends = style.unique(row["parameters"]["blend"] for row in rows)
    return [style.sheet(results, "transfer", [[f"{case}-{blend}.png" for blend in blends] for case in cases], blends, cases, folder, "fig17_19_transfer", cell=3.2)]


def fig20_animation(results, folder):
    rows = style.rows(results, "animation")
    if not rows:
        return []
    names = style.unique(row["parameters"]["animation"] for row in rows)
    times = sorted(style.unique(row["parameters"]["time"] for row in rows))
    titles = [f"t = {time:g}" for time in times[:-1]] + ["too far"]
    return [style.sheet(results, "animation", [[f"{name}-{time}.png" for time in times] for name in names], titles, names, folder, "fig20_animation", cell=2.4)]


def fig19_limits(results, folder):
    rows = style.rows(results, "limits")
    if not rows:
        return []
    refusals = [message[message.find("error:"):] for message in (row["columns"]["message"] for row in rows)]  # without warnings
    messages = ["\n".join(textwrap.wrap(refusal, 60)) for refusal in refusals]
    return [style.sheet(results, "limits", [[f"{model}.png" for model in _models(rows)]], messages, None, folder, "fig19_limits", cell=4.2)]


def fig19_morph_methods(results, folder):
    rows = style.rows(results, "morph_methods")
    if not rows:
        return []
    pairs = style.unique(row["parameters"]["pair"] for row in rows)
    methods = style.unique(row["parameters"]["method"] for row in rows)
    return [style.sheet(results, "morph_methods", [[f"{pair}-{method}.png" for method in methods] for pair in pairs], [method.upper() for method in methods], pairs, folder,
                        "fig19_morph_methods", cell=3.4)]


SKINNING_PAIRS = [[("smooth", "smooth"), ("dual_quaternions", "dual quaternion skinning")], [("polished", "smooth, polished"), ("paper", "paper's rule")]]


def skinning(results, folder):
    made = []
    for row in style.rows(results, "skinning") or []:
        body, columns = row["parameters"]["body"], row["columns"]
        for pair in SKINNING_PAIRS:
            titles = [f"{label}: {columns[f'{rule}_new_folds']} new folds, {columns[f'{rule}_new_intersections']} new intersections" for rule, label in pair]
            made.append(style.sheet(results, "skinning", [[f"{body}-{rule}.png" for rule, _ in pair]], titles, None, folder, f"skinning_{body}_{pair[0][0]}_{pair[1][0]}", cell=9.3))
    return made


def reach(results, folder):
    rows = style.rows(results, "reach")
    if not rows:
        return []
    joints = [row["parameters"]["joint"] for row in rows]
    return [style.sheet(results, "reach", [[f"{joint}-{kind}.png" for kind in ("weights", "posed")] for joint in joints], ["the bone's weights", "turned by 60 degrees"],
                        [joint.replace("_", " ") for joint in joints], folder, "reach", cell=5.0)]
