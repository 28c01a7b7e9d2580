# SPDX-License-Identifier: MIT
"""Table 1: preprocessing times, median and spread of the repeats (the first one, which warms up, is left out), beside the paper's; and
frames per second."""
import statistics

from blocks import Table
from results import unique

# The paper's Table 1: model, bones, vertices in thousands, t_OM, t_S, t_P in ms.
PAPER = [("Bear", 15, 5, 3455, 2884, 143), ("Turtle", 13, 7, 4038, 3363, 169), ("Sheep", 15, 15, 18373, 13979, 366), ("Armadillo", 17, 17, 30685, 25360, 450),
         ("Einstein", 2, 24, 3676, 10815, 525), ("Bunny", 4, 35, 15797, 6588, 841)]
PAPER_STAGES = ["half_edge_ms", "segmentation_ms", "parameterization_ms"]  # t_OM, t_S, t_P
STAGES = PAPER_STAGES + ["encoding_ms"]
PAPER_FRAMES = 90  # per second at 2048 x 2048, section 4, on a GeForce GTX 1080, "approximately"


def measured(results):
    """Per model, or copy with the paper's number of vertices: the columns of its repeats without the first."""
    rows = [(row["model"], row) for row in results.rows("times")]
    if results.has("times_decimated"):
        rows += [(row["parameters"]["copy"], row) for row in results.rows("times_decimated")]
    return {model: [row["columns"] for name, row in rows if name == model and row["parameters"]["repeat"] > 0] for model in unique(name for name, _ in rows)}


def median_ms(repeats, stages):
    return statistics.median(sum(columns[stage] for stage in stages) for columns in repeats)


def paper_ms(model):
    return next(sum(row[3:]) for row in PAPER if row[0] == model)


def times(results):
    head = ["model", "vertices", "half edges (t_OM)", "segmentation (t_S)", "parameterization (t_P)", "these three", "encoding of texels", "altogether", "repeats"]
    lines = []
    for model, repeats in measured(results).items():
        if not repeats:
            continue
        cells = [model, f"{repeats[0]['vertices']:,}"]
        for stages in ([STAGES[0]], [STAGES[1]], [STAGES[2]], PAPER_STAGES, [STAGES[3]], STAGES):
            values = [sum(columns[stage] for stage in stages) for columns in repeats]
            cells.append(f"{statistics.median(values):,.0f} ms ({min(values):,.0f} to {max(values):,.0f})")
        lines.append(cells + [str(len(repeats))])
    made = [Table(head, lines, "This program at 512 x 512: medians, the smallest and the largest in brackets")]
    if not results.is_of_own_model():
        made.append(Table(["model", "bones", "vertices", "t_OM", "t_S", "t_P", "these three"],
                          [[model, str(bones), f"{vertices}k", f"{om:,} ms", f"{s:,} ms", f"{p:,} ms", f"{om + s + p:,} ms"] for model, bones, vertices, om, s, p in PAPER], "The paper"))
    return made


def frames(results):
    lines = []
    for row in results.rows("frames"):
        columns = row["columns"]
        for stage in ("reconstruct", "pose", "morph", "transfer"):
            frame = columns[f"{stage}_frame_ms"]
            lines.append([row["parameters"]["pair"], stage, f"{1000 / frame:.3g}", f"{frame:.1f} ms", f"{columns[f'{stage}_device_ms']:.1f} ms", f"{columns[f'{stage}_copy_ms']:.1f} ms"])
    return [Table(["models", "what is made anew", "frames per second", "frame", "of it on the device", "a device copy of the same bytes"], lines)]
