# SPDX-License-Identifier: MIT
"""The paper's figures that are pictures: what the experiments rendered, with their numbers."""
from blocks import Picture, Sheet, Table, Text, Viewer
from results import largest, symmetric, unique


def _table(rows, columns, first="model"):
    """A table of chosen columns: (heading, what to show of a row)."""
    return Table([first] + [head for head, _ in columns], [[row["key"]] + [show(row) for _, show in columns] for row in rows])


def _number(name, form="{:.2e}"):
    return lambda row: "" if row["columns"].get(name) is None else form.format(row["columns"][name])


def yes(value):
    return "yes" if value else "no"


ERRORS = [("vertices of the original: mean", _number("vertex_mean")), ("deviation", _number("vertex_std")), ("surfaces: mean", lambda row: f"{symmetric(row['columns']):.2e}"),
          ("furthest", lambda row: f"{largest(row['columns']):.2e}")]


def pipeline(results):
    """Figure 1, of the first model that both experiments have."""
    model = next((model for model in results.models("results") if model in results.models("segments")), None)
    if model is None:
        return [Text("The experiments results and segments have no model in common.")]
    steps = [("results", "input", "1. mesh and skeleton"), ("segments", "segments", "2. space divided by separation planes, mesh cut"), ("results", "layout", "3. a rectangle for each bone"),
             ("results", "map", "4. displacements in bone tangent space"), ("results", "shaded", "5. reconstruction, every texel a vertex")]
    return [Sheet("fig01_pipeline", [[Picture(results.file(experiment, f"{model}-{kind}.png"), caption) for experiment, kind, caption in steps]], wrap=5)]


def cuts(results):
    return [Sheet("fig03_cuts", [[Picture(results.file("segments", f"{model}-cut.png"), f"{model}: mesh after the cuts") for model in results.models("segments")[:2]]], wrap=2)]


def segments(results):
    models = results.models("segments")
    bones = {model: len(results.item("segments", model)["encode"]["bones"]) for model in models}
    return [Sheet("fig04_11_segments", [[Picture(results.file("segments", f"{model}-segments.png"), f"{model}, {bones[model]} bones") for model in models]], wrap=3),
            Sheet("fig04_layout", [[Picture(results.file("segments", f"{model}-{kind}.png"), f"{model}: {title}") for kind, title in (("layout", "layout"), ("map", "texture"))]
                                   for model in models[:2]], wrap=4 if len(models) > 1 else 2),
            Table(["model", "bones", "segments that are tubes", "with a closed end", "texels used"],
                  [[model, bones[model], _topologies(results, model, "annulus"), _topologies(results, model, "disk"),
                    f"{100 * row['columns']['used_fraction']:.1f} %"] for model, row in ((row["model"], row) for row in results.rows("segments"))])]


def _topologies(results, model, topology):
    return sum(bone["topology"] == topology for bone in results.item("segments", model)["encode"]["bones"])


def methods(results):
    made = []
    names = results.parameters("methods", "method")
    rows = results.rows("methods")
    for model in results.models("methods"):
        errors = {row["parameters"]["method"]: f"mean {symmetric(row['columns']):.1e}, furthest {largest(row['columns']):.1e}" for row in rows if row["model"] == model}
        made.append(Sheet(f"fig05_06_methods_{model}",
                          [[Picture(results.file("methods", f"{model}-{method}-shaded.png"), f"{method.upper() if len(method) == 3 else method}: {errors[method]}") for method in names],
                           [Picture(results.file("methods", f"{model}-{method}-checker.png"), "a checker on (u, v)") for method in names]], wrap=3))
    return made + [_table(rows, ERRORS)]


def tangent_space(results):
    times = sorted(results.parameters("tangent_space", "time"))
    model = results.models("tangent_space")[0]
    return [Sheet("fig07_tangent_space", [[Picture(results.file("tangent_space", f"{model}-{time}.png"), "bind pose" if time == 0 else f"pose {time:g}") for time in times]])]


def lattice(results):
    kinds = [("layout", "a lattice per bone"), ("tubes", "one constant displacement"), ("surface", "the displacements of the texture")]
    return [Sheet("fig09_lattice", [[Picture(results.file("lattice", f"{model}-{kind}.png"), f"{model}: {title}") for kind, title in kinds] for model in results.models("lattice")], wrap=3),
            _table(results.rows("lattice"), [("texels used", _number("texels", "{:.0%}")), ("vertices", _number("vertices", "{:,}")), ("triangles", _number("triangles", "{:,}"))])]


def distance(results):
    rows = results.rows("distance")
    kinds = [("not_restored", "not restored: the knee gets thin and ends in an edge"), ("restored", "distances to the bones restored"), ("difference", "how far the two are apart, on the right one")]
    return [Sheet("fig10_distance", [[Picture(results.file("distance", f"{row['model']}-{kind}.png"), title) for kind, title in kinds] for row in rows], wrap=3),
            _table(rows, [("distance of the two: mean", _number("mean")), ("furthest", _number("max")), ("volume / bind pose, not restored", _number("volume not restored", "{:.4f}")),
                          ("restored", _number("volume restored", "{:.4f}")), ("new folds, not restored", _number("folds not restored", "{}")), ("restored", _number("folds restored", "{}"))])]


def cyclic(results):
    rows = results.rows("cyclic")
    return [Sheet("fig12_cyclic", [[Picture(results.file("cyclic", f"{row['model']}-segments.png"), f"{row['model']}: segments") for row in rows],
                                   [Picture(results.file("cyclic", f"{row['model']}-checker.png"), f"reconstruction, genus {row['columns']['genus']}") for row in rows]], wrap=3),
            _table(rows, [("genus", _number("genus", "{}")), ("closed 2-manifold", lambda row: yes(row["columns"]["closed"]))] + ERRORS)]


def detail(results):
    rows = sorted(results.rows("detail"), key=lambda row: row["parameters"]["size"])
    model = rows[0]["model"]
    return [Sheet("fig13_detail", [[Picture(results.file("detail", f"{model}-{row['parameters']['size']}-flat.png"),
                                            f"{row['parameters']['size']} x {row['parameters']['size']}: {row['columns']['triangles']:,} triangles") for row in rows]], wrap=3),
            _table(rows, [("vertices", _number("vertices", "{:,}")), ("triangles", _number("triangles", "{:,}")), ("closed 2-manifold", lambda row: yes(row["columns"]["closed"]))] + ERRORS, "level")]


def overview(results):
    rows = results.rows("results")
    kinds = [("input", "input and skeleton"), ("shaded", "reconstruction"), ("error", "distance of the vertices"), ("layout", "layout"), ("map", "texture")]
    return [Sheet("fig15_results", [[Picture(results.file("results", f"{row['model']}-{kind}.png"), f"{row['model']}: {title}") for kind, title in kinds] for row in rows], wrap=3),
            _table(rows, [("vertices", _number("vertices", "{:,}"))] + ERRORS + [("upper end of the colours", _number("error_scale"))])]


def morph(results):
    rows = results.rows("morph")
    frames = [row["parameters"]["frame"].rsplit("-", 1) for row in rows]  # "man-homer-0.5"
    times = sorted(unique(t for _, t in frames), key=float)
    pairs = unique(pair for pair, _ in frames)
    first = {pair: next(row for row, (name, _) in zip(rows, frames) if name == pair)["columns"] for pair in pairs}
    closed = {pair: all(row["columns"]["closed"] for row, (name, _) in zip(rows, frames) if name == pair) for pair in pairs}
    return [Sheet("fig16_morph", [[Picture(results.file("morph", f"{pair}-{t}.png"), f"{pair}, t = {t}") for t in times] for pair in pairs], wrap=5),
            Table(["pair", "every frame closed", "map: area distortion", "angle distortion", "symmetric Dirichlet energy (4: none)"],
                  [[pair, yes(closed[pair]), f"{columns['area_distortion']:.2f}", f"{columns['angle_distortion']:.2f}", f"{columns['symmetric_dirichlet']:.2f}"] for pair, columns in first.items()])]


CASES = {"bunny_horns": "horns of the triceratops for the ears of the bunny", "bear_ears": "ears of another bear", "armadillo_arm": "arm of the man for the armadillo's",
         "man_claw": "arm of the armadillo for the man's", "bear_mirrored_arm": "the bear's own other arm, mirrored"}


def _transfer_sheet(results, name, cases):
    blends = results.parameters("transfer", "blend")
    return Sheet(name, [[Picture(results.file("transfer", f"{case}-{blend}.png"), f"{CASES.get(case, case)}; blending: {blend}") for blend in blends] for case in cases], wrap=max(2, len(blends)))


def transfer(results):
    cases = results.parameters("transfer", "case")
    return [_transfer_sheet(results, "fig17_19_transfer", cases),
            _table(results.rows("transfer"), [("closed 2-manifold", lambda row: yes(row["columns"]["closed"])), ("folded edges", _number("folded edges", "{:,}")),
                                              ("of the target before", _number("folded edges of the target", "{:,}"))], "case and blending")]


def transfer_seam(results):
    """Figure 19, right: one case, without and with blending."""
    cases = results.parameters("transfer", "case")
    return [_transfer_sheet(results, "fig19_seam", [case for case in cases if case == "bear_ears"] or cases[:1])]


def morph_methods(results):
    rows = results.rows("morph_methods")
    pairs, names = results.parameters("morph_methods", "pair"), results.parameters("morph_methods", "method")
    return [Sheet("fig19_morph_methods", [[Picture(results.file("morph_methods", f"{pair}-{method}.png"), f"{pair} at t = 0.5 by {method.upper()}") for method in names] for pair in pairs], wrap=2),
            _table(rows, [("map: area distortion", _number("area_distortion", "{:.2f}")), ("angle distortion", _number("angle_distortion", "{:.2f}")),
                          ("symmetric Dirichlet energy (4: none)", _number("symmetric_dirichlet", "{:.2f}"))], "pair and method")]


def landmarks(results):
    names = {"without": "the skeletons alone", "with": "with landmarks at eyes, brows, nose and mouth"}
    return [Sheet("landmarks", [[Picture(results.file("landmarks", f"{case}.png"), names.get(case, case)) for case in results.parameters("landmarks", "case")]], wrap=2),
            _table(results.rows("landmarks"), [("map: area distortion", _number("area_distortion", "{:.2f}")), ("angle distortion", _number("angle_distortion", "{:.2f}")),
                                               ("symmetric Dirichlet energy (4: none)", _number("symmetric_dirichlet", "{:.2f}"))], "case")]


def animation(results):
    rows = results.rows("animation")
    names, times = results.parameters("animation", "animation"), sorted(results.parameters("animation", "time"))
    titles = [f"t = {time:g}" for time in times[:-1]] + ["bones turned too far"]
    pose = {row["key"]: results.item("animation", row["key"])["reconstruct"].get("pose", {}) for row in rows}
    return [Sheet("fig20_animation", [[Picture(results.file("animation", f"{name}-{time}.png"), f"{name.replace('_', ', ')}: {title}") for time, title in zip(times, titles)] for name in names],
                  wrap=4 if len(times) == 4 else 3),
            Table(["frame", "closed 2-manifold", "new folds", "new intersecting pairs", "volume / bind pose"],
                  [[row["key"], yes(row["columns"]["closed"]), pose[row["key"]].get("new_folds", ""), pose[row["key"]].get("new_intersections", ""),
                    f"{pose[row['key']].get('volume_ratio', 1):.4f}"] for row in rows])]


SKINNING = [("smooth", "smooth (default)"), ("dual_quaternions", "dual quaternion skinning"), ("polished", "smooth, polished"), ("paper", "the paper's rule")]


def skinning(results):
    made = []
    for row in results.rows("skinning"):
        body, columns = row["parameters"]["body"], row["columns"]
        made.append(Sheet(f"skinning_{body}", [[Picture(results.file("skinning", f"{body}-{rule}.png"),
                                                        f"{label}: {columns[f'{rule}_new_folds']} new folds, {columns[f'{rule}_new_intersections']} new intersections") for rule, label in SKINNING]], wrap=2))
    return made


def reach(results):
    joints = results.parameters("reach", "joint")
    return [Sheet("reach", [[Picture(results.file("reach", f"{joint}-{kind}.png"), f"{joint.replace('_', ' ')}: {title}") for kind, title in (("weights", "weights of the bone"), ("posed", "turned by 60 degrees"))]
                            for joint in joints], wrap=4)]


def viewer(results):
    failed = results.failed("view")
    if len(failed) == len(results.all_rows("view")):  # a build without npm has no page; everything else is there
        return [Text(f"The page could not be made: {failed[0].get('reason', '')}")]
    return [Viewer(results.file("view", f"{pair}.html")) for pair in results.parameters("view", "pair")]


def topology(results):
    rows = results.rows("topology")
    good = [row for row in rows if is_good(row["columns"])]
    used = [row["columns"]["used_fraction"] for row in rows if row["columns"].get("used_fraction") is not None]
    sizes = sorted(results.parameters("topology", "size"))
    return [Table(["models", "methods", "sizes", "reconstructions", "closed, one piece, genus of the input", "most blank texels"],
                  [[len(results.models("topology")), ", ".join(results.parameters("topology", "method")), f"{sizes[0]} to {sizes[-1]}", len(rows), len(good), f"{100 * (1 - min(used)):.2f} %"]])]


def is_good(columns):
    return bool(columns["closed"]) and columns["components"] == 1 and columns["genus"] == columns["input_genus"]
