#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Draws every figure whose experiment has been run, and one self-contained page with all of them, the tables and the numbers.

    paper_figures/report.py [RESULTS]      # default: results/; writes RESULTS/figures/ and RESULTS/report/index.html
"""
import base64
import html
import json
import pathlib
import sys

import fig14_fidelity
import pictures
import scale
import style
import sweeps
import table1_times

SECTIONS = [
    ("Figures 4 and 11: segments, layout, texture", "segments", pictures.fig04_11_segments,
     "Other models than the paper's, whose data were not published. Every texel is used; the paper's textures leave blank patches."),
    ("Figures 5 and 6: SPD, VSM, hybrid", "methods", pictures.fig05_06_methods,
     "SPD loses what the rays from the bone do not see (inside of the ears); VSM keeps all of the surface; hybrid takes SPD where it sees enough."),
    ("Figure 7: bone tangent space", "tangent_space", pictures.fig07_tangent_space,
     "The plane of texels (0, 0, w), w = 0.03 of the diagonal, in the bind pose and three others: everywhere as far from the bones, mitred where they meet."),
    ("Figure 9: from lattice to surface", "lattice", pictures.fig09_lattice, "96 x 96 texels, one per vertex; the layout, all texels (0, 0, 0.02 diagonals), the model."),
    ("Figure 10: distance restoration", "distance", pictures.fig10_distance,
     "The same pose, without and with the distances to the bones restored (paper 3.6.1): look at the elbows."),
    ("Figure 12: skeletons with cycles", "cyclic", pictures.fig12_cyclic, "Genus and closedness are measured on the reconstruction."),
    ("Figure 13: levels of detail", "detail", pictures.fig13_detail, "All from one model of 1024 x 1024 texels; every level is closed."),
    ("Figure 14: error against texture size", "fidelity", fig14_fidelity.draw,
     "The paper shows the distances of the original's vertices (top). They say little about the surface between them, so the symmetric surface distance is below."),
    ("Figure 15: input, layout, texture, reconstruction, error", "results", pictures.fig15_results, "Error: distance of the original's vertices, as in the paper; each row has its own scale."),
    ("Figure 16: morph sequences", "morph", pictures.fig16_morph,
     "Texels and skeletons interpolated, bones matched by the skeletons' graphs alone. Every in-between model is closed; the distortion of the map is in the numbers."),
    ("Figures 17 to 19: transfer", "transfer", pictures.fig17_transfer,
     "Chosen bones or limbs replaced by those of another model, or by the mirror image of its own, scaled to the target's bones; the target's seams stay. Without blending the whole patch is the source's and the seam shows."),
    ("Figure 19, left: what cannot be segmented", "limits", pictures.fig19_limits,
     "Separation planes that cross inside the body would leave surface behind them. The skeleton is refused, with the place and what to do; the paper leaves the model incomplete."),
    ("Figure 19, middle: SPD and VSM in morphing", "morph_methods", pictures.fig19_morph_methods,
     "Half-way between the two. VSM keeps all of both surfaces, and distorts what one of them lacks; SPD is smoother and leaves out what its rays do not see."),
    ("Figure 20: animation", "animation", pictures.fig20_animation,
     "Poses interpolated between key frames, and a pose that turns bones by 80 to 120 degrees. Closed in all of them. The surface is posed smoothly, by blended dual quaternions with "
     "weights in closed form; the paper's own rule bends sharply at every separation plane (Figure 10)."),
    ("Beyond the paper: poses beside skinning", "posing", sweeps.draw_posing,
     "New folds (edges that bend beyond 90 degrees) and new intersecting pairs of triangles, summed over the poses of configs/poses/evaluation, by each rule of this project and by skinning with each "
     "vertex' own bone diffused over 0.05 of the diagonal (narrow: 0.025)."),
    ("Beyond the paper: poses beside dual quaternion skinning", "skinning", pictures.skinning,
     "The bear has 60 degrees at every joint below its root, the man sits, the armadillo has an elbow and a knee bent by 90 degrees; 256 x 256 texels. The smooth rule makes fewer new folds than dual "
     "quaternion skinning, whose weights are each vertex' own bone diffused over 0.05 of the diagonal. It looks worse at the root of the sitting man's left thigh, where it leaves a blunt step, and at "
     "the bear's ear, which it stretches. Polishing takes away single folds and leaves the form. The paper's rule crumples the surface at the separation planes."),
    ("Beyond the paper: how far a joint reaches", "reach", pictures.reach,
     "Weights of the bone that turns, from 0 (dark) to 1 (bright); the bones beyond it go along as a whole. The man's upper arm moves the arm and its shoulder alone. A joint in the middle of a wide trunk "
     "reaches as far as the trunk is wide: the thighs of the camel and the cow take part of the other thigh along, and the armadillo's neck its chest, shell and upper arms."),
    ("Beyond the paper: iterations of VSM", "iterations", sweeps.draw_iterations,
     "The paper's weights w A even out areas in the texture; divided by a power of the surface area they even out the texels on the surface."),
    ("Beyond the paper: what the recipe's parts bring", "recipe", sweeps.draw_recipe, "The paper's own recipe, the default, the default on an regular grid, and that with one part taken back."),
    ("Beyond the paper: other ways to as many vertices", "simplification", sweeps.draw_simplification,
     "A texture is better than a uniform remesh. A simplification puts its vertices where the surface bends, which a lattice can where it has texels enough."),
    ("Beyond the paper: error against bytes", "bytes", sweeps.draw_bytes,
     "Half floats are those near the texels whose points stay nearest to the surface, or the nearest ones. Draco codes the input mesh alone and needs far fewer bytes. The texture pays for being editable: every texel is a displacement that can be posed, morphed and filtered."),
    ("Beyond the paper: time and memory against the number of triangles", "scale", scale.draw,
     "encode as a whole command, files included, at 512 x 512, regular grid: the armadillo remeshed or decimated, and subdivided. The dotted line is n log n through the fewest triangles beyond 100 000."),
]

STYLE = """body{font:16px/1.5 system-ui,sans-serif;max-width:72rem;margin:2rem auto;padding:0 1rem;color:#222}
img{max-width:100%;height:auto}table{border-collapse:collapse;font-size:.85rem;margin:.5rem 0}td,th{padding:.2rem .6rem;text-align:right;border-bottom:1px solid #ddd}
td:first-child,th:first-child{text-align:left}figure{margin:1rem 0}.quiet{color:#666;font-size:.85rem}details{margin:.5rem 0}"""


def table_html(head, lines):
    cells = "".join(f"<th>{html.escape(cell)}</th>" for cell in head)
    body = "".join("<tr>" + "".join(f"<td>{html.escape(str(cell))}</td>" for cell in line) + "</tr>" for line in lines)
    return f"<table><thead><tr>{cells}</tr></thead><tbody>{body}</tbody></table>"


def number(value):
    return "" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)


def numbers_html(results, experiment):
    path = results / experiment / "results.json"
    data = json.loads(path.read_text())["rows"]
    columns = style.unique(column for row in data for column in row["columns"])
    failed = [row for row in data if row["status"] != "done"]
    lines = [[row["key"]] + [number(row["columns"].get(column)) for column in columns] for row in data]
    text = f"<details><summary>Numbers ({len(data)} rows)</summary>{table_html(['item'] + columns, lines)}</details>"
    for row in failed:
        text += f"<p>Failed: {html.escape(row['key'])}: {html.escape(row.get('reason', ''))}</p>"
    return text


def record_html(results, experiment):
    record = json.loads((results / experiment / "record.json").read_text())
    parts = [f"commit {record['git']['commit'][:10] or 'unknown'}" + (f" with {record['git']['changed_files']} changed files" if record["git"]["changed_files"] not in ("", "0") else ""),
             record["compiler"], f"{record['device']['name']} ({record['device']['driver']})", f"{record['machine']['processor']}, {record['machine']['cores']} cores",
             f"{record['seconds']:.0f} s", f"peak {record['peak_memory_mb']:.0f} MB"]
    return f"<p class=quiet>{html.escape('; '.join(parts))}</p>"


def main():
    results = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else style.ROOT / "results"
    figures = results / "figures"
    body, missing = [], []
    for title, experiment, draw, note in SECTIONS:
        images = draw(results, figures)
        if not images:
            missing.append(experiment)
            continue
        body.append(f"<h2>{html.escape(title)}</h2><p>{html.escape(note)}</p>")
        for image in images:
            data = base64.b64encode(image.read_bytes()).decode()
            body.append(f'<figure><img alt="{html.escape(title)}" src="data:image/png;base64,{data}"></figure>')
        body.append(numbers_html(results, experiment) + record_html(results, experiment))
    times = table1_times.table(results)
    if times:
        body.append("<h2>Table 1: preprocessing times at 512 x 512</h2><p>Medians, with the smallest and the largest in brackets; the last rows are copies with the paper's numbers of vertices. The paper's machine and "
                    "models differ; its times leave the encoding of texels out, ours name it.</p>")
        body.append(table_html(*times) + "<p>The paper:</p>" + table_html(*table1_times.paper_table())
                    + "".join(record_html(results, name) for name in ("times", "times_decimated") if (results / name).is_dir()))
    else:
        missing.append("times")
    frames = table1_times.frames_table(results)
    if frames:
        body.append("<h2>Frames per second at 2048 x 2048</h2><p>The paper: some 90, drawn by a GeForce GTX 1080. Here a frame ends with all vertices on the OpenCL device and is "
                    "not drawn; a morph makes its texels anew for every frame.</p>")
        body.append(table_html(*frames) + record_html(results, "frames"))
    else:
        missing.append("frames")
    used = [row["columns"]["used_fraction"] for row in style.rows(results, "topology") or [] if row["columns"].get("used_fraction") is not None]
    if used:
        body.append(f"<h2>Texels that stay blank</h2><p>At most {100 * (1 - min(used)):.2f} % of the texels, over {len(used)} models, methods and sizes; the paper's textures show blank patches.</p>")
        body.append(numbers_html(results, "topology") + record_html(results, "topology"))
    else:
        missing.append("topology")
    if missing:
        body.append(f"<h2>Not run</h2><p>{html.escape(', '.join(missing))}. Run them with <code>skeletex run configs/experiments/NAME.json</code>.</p>")
    if len(missing) == len(SECTIONS) + 3:
        sys.exit(f"report: {results} holds no results; run skeletex run configs/paper.json first")
    page = results / "report" / "index.html"
    page.parent.mkdir(parents=True, exist_ok=True)
    temporary = page.with_suffix(".tmp")
    temporary.write_text(f'<!doctype html><html lang="en"><meta charset="utf-8"><title>Skeletex: results</title><style>{STYLE}</style><body><h1>Skeletex: figures and tables</h1>'
                         + "".join(body) + "</body></html>\n")
    temporary.replace(page)
    print(page)


if __name__ == "__main__":
    main()
