#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Makes the committed reference run anew: the numbers and figures of the quick suite (results/reference). Run it on a clean checkout, after
# scripts/reproduce.sh --quick has made results/ with the same commit.
set -euo pipefail
cd "$(dirname "$0")/.."

target=results/reference
rm -rf "$target"
mkdir -p "$target/figures"
for results in results/*/results.json; do
  folder=$(dirname "$results")
  mkdir "$target/$(basename "$folder")"
  cp "$folder"/{results.json,results.csv,record.json} "$target/$(basename "$folder")/"
done
# Small enough to be kept: at most 1100 pixels wide, 256 colours.
/usr/bin/python3 - results/figures "$target/figures" <<'PYTHON'
import pathlib
import sys

from PIL import Image

for path in sorted(pathlib.Path(sys.argv[1]).glob("*.png")):
    image = Image.open(path).convert("RGB")
    image.thumbnail((1100, 1600), Image.Resampling.LANCZOS)
    image.quantize(256).save(pathlib.Path(sys.argv[2]) / path.name, optimize=True)
PYTHON
too_large=$(find "$target" -name '*.png' -size +200k)
[ -z "$too_large" ] || { echo "reference: larger than 200 KB: $too_large" >&2; exit 1; }
du -sh "$target"
