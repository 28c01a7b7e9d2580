# SPDX-License-Identifier: MIT
"""One look for all figures, which prints in grey. Figures are as wide as the page, so that their letters can be read."""
import io
import logging
import pathlib
import time

import matplotlib
from PIL import Image, ImageDraw, ImageFont

matplotlib.use("Agg")
logging.getLogger("fontTools").setLevel(logging.ERROR)  # it finds the dates odd that are left out
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


SHEET = 2000  # pixels across
_FONT = ImageFont.truetype(str(pathlib.Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"), 26)


def save_sheet(sheet, folder):
    """The pictures of a sheet as one picture, as they lie on the page."""
    rows = [row[i:i + sheet.wrap] for row in sheet.rows for i in range(0, len(row), sheet.wrap)]
    cell = SHEET // max(len(row) for row in rows)
    lines = []
    for row in rows:
        pictures = []
        for entry in row:
            picture = Image.open(entry.path).convert("RGB")
            pictures.append((picture.resize((cell - 8, round(picture.height * (cell - 8) / picture.width)), Image.Resampling.LANCZOS), _fitting(entry.caption, cell - 8)))
        lines.append((pictures, max(picture.height for picture, _ in pictures), max(len(words) for _, words in pictures)))
    page = Image.new("RGB", (SHEET, sum(height + 34 * words + 16 for _, height, words in lines)), "white")
    pen = ImageDraw.Draw(page)
    y = 0
    for pictures, height, words in lines:
        for j, (picture, caption) in enumerate(pictures):
            page.paste(picture, (j * cell + 4, y + height - picture.height))
            for k, line in enumerate(caption):
                pen.text((j * cell + cell // 2, y + height + 34 * k + 4), line, fill="#222222", font=_FONT, anchor="ma")
        y += height + 34 * words + 16
    folder.mkdir(parents=True, exist_ok=True)
    page.save(folder / f"{sheet.name}.png")
    page.save(folder / f"{sheet.name}.pdf", quality=92, creationDate=time.gmtime(0), modDate=time.gmtime(0))


def _fitting(text, width):
    """Lines of at most this width."""
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and _FONT.getlength(longer) > width:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines
