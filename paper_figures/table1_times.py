# SPDX-License-Identifier: MIT
"""Table 1: preprocessing times, median and spread of the repeats (the first one, which warms up, is left out), beside the
paper's; and frames per second."""
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
    """Models as they are, then the copies that are decimated to the paper's numbers of vertices."""
    rows = [(row["model"], row) for row in style.rows(results, "times") or []] + [(row["parameters"]["copy"], row) for row in style.rows(results, "times_decimated") or []]
    if not rows:
        return None
    head = ["model", "vertices", "half edges (t_OM)", "segmentation (t_S)", "parameterization (t_P)", "encoding", "altogether", "repeats"]
    lines = []
    for model in style.unique(name for name, _ in rows):
        some = [row["columns"] for name, row in rows if name == model and row["parameters"]["repeat"] > 0]
        if not some:
            continue
        cells = [model, str(some[0]["vertices"])]
        for values in [[columns[stage] for columns in some] for stage in STAGES] + [[sum(columns[stage] for stage in STAGES) for columns in some]]:
            cells.append(f"{statistics.median(values):.0f} ms ({min(values):.0f} to {max(values):.0f})")
        lines.append(cells + [str(len(some))])
    return head, lines


def frames_table(results):
    rows = style.rows(results, "frames")
    if not rows:
        return None
    head = ["models", "stage", "frames per second", "frame", "of it on the device", "a device copy of the same bytes"]
    lines = []
    for row in rows:
        columns = row["columns"]
        for stage in ("reconstruct", "pose", "morph", "transfer"):
            if f"{stage}_frame_ms" not in columns:  # of a run before this stage was measured
                continue
            frame = columns[f"{stage}_frame_ms"]
            lines.append([row["parameters"]["pair"], stage, f"{1000 / frame:.3g}", f"{frame:.1f} ms", f"{columns[f'{stage}_device_ms']:.1f} ms", f"{columns[f'{stage}_copy_ms']:.1f} ms"])
    return head, lines
