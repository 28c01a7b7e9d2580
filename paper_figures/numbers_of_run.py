# SPDX-License-Identifier: MIT
"""The numbers that sum up a run, as named texts, for the page and for docs/replication.md."""
import fig14_fidelity
import table1_times
from pictures import is_good
from results import largest, symmetric, unique

SIZE = 512  # texels along each side, the paper's choice for its results


def scientific(value):
    return f"{value:.1e}"


def _span(values, form=scientific):
    low, high = min(values), max(values)
    return form(low) if form(low) == form(high) else f"{form(low)} to {form(high)}"


def summary(results):
    """Five numbers of the paper's page: (what, here, the paper, anchor of the section)."""
    rows = results.rows("results")
    models = ", ".join(row["model"] for row in rows)
    size, model = max(results.parameters("recipe", "size")), results.models("recipe")[0]
    recipe = {row["parameters"]["recipe"]: row["columns"] for row in results.rows("recipe") if row["model"] == model and row["parameters"]["size"] == size}
    measured = table1_times.measured(results)
    copy = next(name for name in measured if name.startswith("bunny00 "))
    ours, paper = table1_times.median_ms(measured[copy], table1_times.PAPER_STAGES), table1_times.paper_ms("Bunny")
    frame = results.rows("frames")[0]["columns"]
    topology = results.rows("topology")
    good = sum(is_good(row["columns"]) for row in topology)
    blank = 1 - min(row["columns"]["used_fraction"] for row in topology if row["columns"].get("used_fraction") is not None)
    return [
        (f"Mean distance of the original's vertices at {SIZE} x {SIZE}, divided by the diagonal", f"{_span([row['columns']['vertex_mean'] for row in rows])} ({models})",
         f"shown in Figures 14 and 15, no number in the text. Its recipe, run by this program on {model} at {size} x {size}: {scientific(recipe['paper']['vertex_mean'])}; default recipe there: "
         f"{scientific(recipe['default']['vertex_mean'])}", "fidelity"),
        ("Half edges, segmentation and parameterization of a mesh of 35,000 vertices", f"{ours:,.0f} ms (copy of the bunny)", f"{paper:,.0f} ms (Table 1, Bunny): {paper / ours:,.0f} times as long", "times"),
        ("Frames per second at 2048 x 2048, every vertex made anew", f"{1000 / frame['reconstruct_frame_ms']:.0f} on {results.record('frames')['device']['name']}, not drawn",
         f"about {table1_times.PAPER_FRAMES}, drawn, on a GeForce GTX 1080", "frames"),
        ("Reconstructions that are closed, in one piece, and of the input's genus", f"{good} of {len(topology)}", "not counted; no gaps are visible", "topology"),
        ("Texels that hold nothing", f"{100 * blank:.2f} %", "no number; blank patches are visible in Figure 15", "topology"),
    ]


def own_summary(results):
    """Five numbers of a page of one's own model."""
    model = results.models("fidelity")[0]
    points = fig14_fidelity.curve(results, model, fig14_fidelity.default_method(results))
    size = fig14_fidelity.smallest_size(points, "furthest", 1 / 1000)
    at = next((point for point in points if point["size"] == (size or points[-1]["size"])))
    measured = table1_times.measured(results)
    repeats = next(iter(measured.values()))
    bones = results.item("segments", model)["encode"]["bones"]
    rows = results.rows("fidelity")
    closed = sum(bool(row["columns"]["closed"]) for row in rows)
    return [("Size that you need for pictures of 1000 pixels", f"{size} x {size}" if size else f"more than {points[-1]['size']} x {points[-1]['size']}", "size"),
            ("Mean and furthest distance there, divided by the diagonal", f"{scientific(at['mean'])} and {scientific(at['furthest'])}", "fidelity"),
            ("File and triangles there", f"{at['bytes'] / 1e6:.2f} MB" + (f", {at['triangles']:,} triangles" if at.get("triangles") else ""), "size"),
            (f"Time to encode {repeats[0]['vertices']:,} vertices, {len(bones)} bones at 512 x 512", f"{table1_times.median_ms(repeats, table1_times.STAGES):,.0f} ms", "times"),
            ("Reconstructions that are closed 2-manifolds", f"{closed} of {len(rows)}", "fidelity")]


def _columns_at(results, experiment, **parameters):
    model = parameters.pop("model")
    return next(row["columns"] for row in results.rows(experiment) if row["model"] == model and row["parameters"] == parameters)


def article(results):
    """Every number of docs/replication.md, by the name it has in the template."""
    values = {}
    measured = table1_times.measured(results)
    for model, name in (("bear", "Bear"), ("armadillo", "Armadillo"), ("bunny00", "Bunny")):
        copy = next(key for key in measured if key.startswith(f"{model} "))
        ours, paper = table1_times.median_ms(measured[copy], table1_times.PAPER_STAGES), table1_times.paper_ms(name)
        values |= {f"time_{model}": f"{ours:,.0f}", f"time_{model}_paper": f"{paper:,.0f}", f"time_{model}_factor": f"{paper / ours:,.0f}",
                   f"time_{model}_all": f"{table1_times.median_ms(measured[copy], table1_times.STAGES):,.0f}"}
        if model == "bunny00":
            values["vertices_bunny00"] = f"{measured[copy][0]['vertices']:,}"
    for model in ("bear", "bunny00"):
        at = _columns_at(results, "fidelity", model=model, method="vsm", size=SIZE)
        half = _columns_at(results, "fidelity", model=model, method="vsm", size=SIZE // 2)
        double = _columns_at(results, "fidelity", model=model, method="vsm", size=2 * SIZE)
        values |= {f"vertex_{model}": scientific(at["vertex_mean"]), f"vertex_{model}_std": scientific(at["vertex_std"]), f"surface_{model}": scientific(symmetric(at)),
                   f"furthest_{model}": scientific(largest(at)), f"gain_to_{model}": f"{symmetric(half) / symmetric(at):.1f}", f"gain_beyond_{model}": f"{symmetric(at) / symmetric(double):.1f}"}
    for method in ("spd", "vsm", "hybrid"):
        at = _columns_at(results, "fidelity", model="bunny00", method=method, size=SIZE)
        values |= {f"bunny_{method}": scientific(symmetric(at)), f"bunny_{method}_furthest": scientific(largest(at))}
    size = max(results.parameters("recipe", "size"))
    recipe = {row["parameters"]["recipe"]: row["columns"] for row in results.rows("recipe") if row["model"] == "bear" and row["parameters"]["size"] == size}
    values |= {"recipe_size": str(size), "recipe_paper": scientific(symmetric(recipe["paper"])), "recipe_default": scientific(symmetric(recipe["default"])),
               "recipe_regular": scientific(symmetric(recipe["regular grid"])), "recipe_factor": f"{symmetric(recipe['paper']) / symmetric(recipe['default']):.1f}"}
    weights = {(row["parameters"]["alpha"], row["parameters"]["iterations"]): symmetric(row["columns"]) for row in results.rows("iterations") if row["model"] == "bear"}
    values |= {"weights_tutte": scientific(weights[0, 0]), "weights_paper": scientific(weights[0, 1]), "weights_default": scientific(weights[0.5, 4])}
    topology = results.rows("topology")
    values |= {"topology_good": str(sum(is_good(row["columns"]) for row in topology)), "topology_all": str(len(topology)),
               "blank": f"{100 * (1 - min(row['columns']['used_fraction'] for row in topology)):.2f}"}
    frame = results.rows("frames")[0]["columns"]
    for stage in ("reconstruct", "pose", "morph", "transfer"):
        values |= {f"frames_{stage}": f"{1000 / frame[f'{stage}_frame_ms']:.0f}", f"frame_{stage}": f"{frame[f'{stage}_frame_ms']:.1f}"}
    values |= {"frames_paper": str(table1_times.PAPER_FRAMES), "device": results.record("frames")["device"]["name"]}
    distance = results.rows("distance")[0]["columns"]
    values |= {"distance_furthest": f"{100 * distance['max']:.1f}", "volume_restored": f"{100 * (distance['volume restored'] - 1):+.1f}", "volume_not_restored": f"{100 * (distance['volume not restored'] - 1):+.1f}"}
    posing = [row["columns"] for row in results.rows("posing") if row["parameters"]["method"] == "vsm"]
    values |= {"posing_bodies": str(len(posing)), "posing_poses": str(sum(columns["poses"] for columns in posing))}
    for rule in ("smooth", "paper", "dual_quaternions", "linear"):
        values |= {f"folds_{rule}": f"{sum(columns[f'{rule}_new_folds'] for columns in posing):,}", f"crossings_{rule}": f"{sum(columns[f'{rule}_new_intersections'] for columns in posing):,}"}
    morph = results.rows("morph")
    values |= {"morph_closed": str(sum(bool(row["columns"]["closed"]) for row in morph)), "morph_all": str(len(morph))}
    for row in results.rows("morph_methods"):
        if row["parameters"]["pair"] == "bull-camel":
            values |= {f"dirichlet_{row['parameters']['method']}": f"{row['columns']['symmetric_dirichlet']:.0f}"}
    transfer = results.rows("transfer")
    values |= {"transfer_closed": str(sum(bool(row["columns"]["closed"]) for row in transfer)), "transfer_all": str(len(transfer))}
    for blend in ("none", "cosine"):
        values[f"transfer_folds_{blend}"] = f"{sum(row['columns']['folded edges'] for row in transfer if row['parameters']['blend'] == blend):,}"
    genus = [row["columns"]["genus"] for row in results.rows("cyclic") if row["columns"]["closed"]]
    values |= {"cyclic_count": str(len(genus)), "cyclic_genus": str(genus[0])}
    record = results.record("fidelity")
    values |= {"machine": f"{record['machine']['processor']}, {record['machine']['cores']} cores", "opencl": f"{record['device']['name']} ({record['device']['platform']})", "compiler": record["compiler"],
               "commit": ", ".join(unique(results.record(name)["git"]["commit"][:10] for name in results.experiments())), "version": record["version"]}
    sizes = sorted(results.parameters("fidelity", "size"))
    table = ["| model, method | " + " | ".join(str(size) for size in sizes) + " |", "|---|" + "---|" * len(sizes)]
    for model in ("bear", "bunny00"):
        for method in results.parameters("fidelity", "method"):
            at = {point["size"]: point for point in fig14_fidelity.curve(results, model, method)}
            table.append(f"| {model}, {method} | " + " | ".join(scientific(at[size]["mean"]) for size in sizes) + " |")
    values["table_fidelity"] = "\n".join(table)
    table = ["| model | vertices | half edges | segmentation | parameterization | encoding |", "|---|---|---|---|---|---|"]
    for model, repeats in measured.items():
        table.append(f"| {model} | {repeats[0]['vertices']:,} | " + " | ".join(f"{table1_times.median_ms(repeats, [stage]):,.0f} ms" for stage in table1_times.STAGES) + " |")
    for model, bones, vertices, *times in table1_times.PAPER:
        table.append(f"| the paper's {model}, {bones} bones | {vertices}k | " + " | ".join(f"{time:,} ms" for time in times) + " | not told |")
    values["table_times"] = "\n".join(table)
    return values
