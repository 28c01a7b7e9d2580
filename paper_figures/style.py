# SPDX-License-Identifier: MIT
"""What all figures share: one look that prints in grey, and reading results."""
import json
import pathlib

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parent.parent

# Colours differ in lightness too, and every series has its own marker and dash, so that a grey print can be read.
SERIES = [("#1b3a6b", "o", "-"), ("#c8553d", "s", "--"), ("#3f8f5f", "^", "-."), ("#8a6bb1", "D", ":"), ("#d9a441", "v", "-"), ("#5b5b5b", "P", "--"),
          ("#6fb1c7", "X", "-.")]

plt.rcParams.update({
    "font.family": "sans-serif", "font.size": 9, "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True, "grid.color": "#dddddd",
    "grid.linewidth": 0.6, "axes.axisbelow": True, "legend.frameon": False, "figure.dpi": 110, "savefig.bbox": "tight", "pdf.fonttype": 42,
})


def rows(results, experiment):
    """The rows of an experiment that are done, or None when it has not been run."""
    path = results / experiment / "results.json"
    if not path.exists():
        return None
    return [row for row in json.loads(path.read_text())["rows"] if row["status"] == "done"]


def symmetric(columns):
    return (columns["forward_mean"] + columns["backward_mean"]) / 2


def largest(columns):
    return max(columns["forward_max"], columns["backward_max"])


def unique(values):
    return list(dict.fromkeys(values))


def save(figure, folder, name):
    """PDF for papers, PNG for screens. PNG metadata is left out, so that equal figures are equal files."""
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / f"{name}.pdf", metadata={"CreationDate": None})
    figure.savefig(folder / f"{name}.png", metadata={"Software": None})
    plt.close(figure)
    return folder / f"{name}.png"


def sheet(results, experiment, picture_rows, column_titles, row_titles, folder, name, cell=2.4):
    """Pictures of an experiment as a table; missing ones stay empty."""
    figure, axes = plt.subplots(len(picture_rows), len(picture_rows[0]), figsize=(cell * len(picture_rows[0]), cell * len(picture_rows)), squeeze=False)
    for i, pictures in enumerate(picture_rows):
        for j, picture in enumerate(pictures):
            axis = axes[i][j]
            axis.set_xticks([])
            axis.set_yticks([])
            axis.grid(False)
            for side in axis.spines.values():
                side.set_visible(False)
            path = results / experiment / picture
            if path.exists():
                axis.imshow(plt.imread(path))
            if i == 0 and column_titles:
                axis.set_title(column_titles[j], fontsize=9)
            if j == 0 and row_titles:
                axis.set_ylabel(row_titles[i], fontsize=9)
    figure.subplots_adjust(wspace=0.03, hspace=0.06)
    return save(figure, folder, name)
