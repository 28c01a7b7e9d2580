# SPDX-License-Identifier: MIT
"""Table 1: preprocessing times, median and spread of the repeats (the first one, which warms up, is left out), beside the
paper's."""
import statistics

import style

# The paper's Table 1: model, bones, vertices in thousands, t_OM, t_S, t_P in ms.
PAPER = [("Bear", 15, 5, 3455, 2884, 143), ("Turtle", 13, 7, 4038, 3363, 169), ("Sheep", 15, 15, 18373, 13979, 366), ("Armadillo", 17, 17, 30685, 25360, 450),
         ("Einstein", 2, 24, 3676, 10815, 525), ("Bunny", 4, 35, 15797, 6588, 841)]
STAGES = ["half_edge_ms", "segmentation_ms", "parameterization_ms", "encoding_ms"]


def paper_table():
    head = ["model", "bones", "vertices", "t_OM", "t_S", "t_P", "altogether"]
    return head, [[model, str(bones), f"{vertices}k", f"{om} ms", f"{s} ms", f"{p} ms", f"{(om + s + p) / 1000:.1f} s"] for model, bones, vertices, om, s, p in PAPER]


def table(results):
    rows = style.rows(results, "times")
    if not rows:
        return None
    head = ["model", "vertices", "half edges (t_OM)", "segmentation (t_S)", "parameterization (t_P)", "encoding", "altogether", "repeats"]
    lines = []
    for model in style.unique(row["model"] for row in rows):
        some = [row["columns"] for row in rows if row["model"] == model and row["parameters"]["repeat"] > 0]
        if not some:
            continue
        cells = [model, str(some[0]["vertices"])]
        for values in [[columns[stage] for columns in some] for stage in STAGES] + [[sum(columns[stage] for stage in STAGES) for columns in some]]:
            cells.append(f"{statistics.median(values):.0f} ms ({min(values):.0f} to {max(values):.0f})")
        lines.append(cells + [str(len(some))])
    return head, lines
