# SPDX-License-Identifier: MIT
"""One look for all figures, which prints in grey. Figures are as wide as the page, so that their letters can be read."""
import io
import pathlib

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

# Colours differ in lightness too, and every series has its own marker and dash, so that a grey print can be read.
SERIES = [("#1b3a6b", "o", "-"), ("#c8553d", "s", "--"), ("#3f8f5f", "^", "-."), ("#8a6bb1", "D", ":"), ("#d9a441", "v", "-"), ("#5b5b5b", "P", "--"),
          ("#6fb1c7", "X", "-.")]
WIDTH = 11.0  # inches

plt.rcParams.update({
    "font.family": "sans-serif", "font.size": 11, "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True, "grid.color": "#dddddd",
    "grid.linewidth": 0.6, "axes.axisbelow": True, "legend.frameon": False, "legend.fontsize": 10, "axes.titlesize": 11.5, "figure.dpi": 110, "savefig.bbox": "tight",
    "pdf.fonttype": 42, "svg.hashsalt": "skeletex", "lines.markersize": 5, "lines.linewidth": 1.5,
})


def save(figure, folder, name):
    """PDF for papers, PNG for screens, and the SVG as text for the page. Metadata are left out, so that equal figures are equal files."""
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / f"{name}.pdf", metadata={"CreationDate": None})
    figure.savefig(folder / f"{name}.png", metadata={"Software": None})
    text = io.StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None, "Creator": None})
    plt.close(figure)
    return text.getvalue()


def bare(axis, equal=True):
    """No ticks, grid or frame: for schemes and pictures."""
    axis.set_xticks([])
    axis.set_yticks([])
    axis.grid(False)
    for side in axis.spines.values():
        side.set_visible(False)
    if equal:
        axis.set_aspect("equal")


def save_sheet(sheet, folder):
    """The pictures of a sheet as one figure, as they lie on the page."""
    rows = [row[i:i + sheet.wrap] for row in sheet.rows for i in range(0, len(row), sheet.wrap)]
    columns = max(len(row) for row in rows)
    cell = WIDTH / columns
    shapes = [[plt.imread(picture.path).shape for picture in row] for row in rows]
    heights = [max(shape[0] / shape[1] for shape in row) for row in shapes]
    caption = 0.3 + 0.18 * max(picture.caption.count("\n") for row in rows for picture in row)
    figure = plt.figure(figsize=(WIDTH, sum(height * cell + caption for height in heights)))
    grid = figure.add_gridspec(len(rows), columns, height_ratios=[height * cell + caption for height in heights], wspace=0.02, hspace=0.02)
    for i, row in enumerate(rows):
        for j, picture in enumerate(row):
            axis = figure.add_subplot(grid[i, j])
            bare(axis, equal=False)
            axis.imshow(plt.imread(picture.path), interpolation="lanczos")
            axis.set_title(picture.caption, fontsize=10, pad=3)
    return save_picture(figure, folder, sheet.name)


def save_picture(figure, folder, name):
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / f"{name}.pdf", metadata={"CreationDate": None}, dpi=150)
    figure.savefig(pathlib.Path(folder) / f"{name}.png", metadata={"Software": None}, dpi=150)
    plt.close(figure)
