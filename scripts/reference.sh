#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Makes the committed reference run anew: the numbers and figures of the quick suite (results/reference), and docs/replication.md from them.
# Run it on a clean checkout, after scripts/reproduce.sh --quick has made results/ with the same commit.
set -euo pipefail
cd "$(dirname "$0")/.."

# Numbers that are kept come from a commit that everybody can check out.
/usr/bin/python3 - results/*/record.json <<'PYTHON'
import json
import sys

unclean = [path for path in sys.argv[1:] if json.load(open(path))["git"]["changed_files"] != "0"]
if unclean:
    sys.exit("reference: made with changed files, or outside of a git checkout: " + ", ".join(unclean) + "; run scripts/reproduce.sh --quick from a clean checkout")
PYTHON

target=results/reference
rm -rf "$target"
mkdir -p "$target/figures"
for results in results/*/results.json; do
  folder=$(dirname "$results")
  mkdir "$target/$(basename "$folder")"
  cp "$folder"/{results.json,results.csv,record.json} "$target/$(basename "$folder")/"
done
# Small enough to be kept: 256 colours, at most 1100 pixels wide, and narrower until it has at most 200 KB.
/usr/bin/python3 - results/figures "$target/figures" <<'PYTHON'
import pathlib
import sys

from PIL import Image

for path in sorted(pathlib.Path(sys.argv[1]).glob("*.png")):
    image = Image.open(path).convert("RGB")
    kept = pathlib.Path(sys.argv[2]) / path.name
    for width in (1100, 950, 800, 650, 500):
        small = image.resize((width, round(image.height * width / image.width)), Image.Resampling.LANCZOS) if width < image.width else image
        small.quantize(256).save(kept, optimize=True)
        if kept.stat().st_size <= 200000:
            break
    else:
        sys.exit(f"reference: {path} is larger than 200 KB at 500 pixels across")
PYTHON
/usr/bin/python3 paper_figures/replication.py  # the article is filled in from these numbers
du -sh "$target"
