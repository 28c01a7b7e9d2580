#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Makes the pictures of this folder anew, all but pipeline.svg, which is drawn by hand. Run it from anywhere after a build:
#   docs/pictures/make.sh [PROGRAM]      default: build/release/bin/skeletex
set -euo pipefail
cd "$(dirname "$0")/../.."
skeletex=$(realpath "${1:-build/release/bin/skeletex}")
target=docs/pictures
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

for name in bear man; do
  "$skeletex" encode "build/meshes/$name.off" "configs/skeletons/$name.skeleton.json" -o "$work/$name.skx.exr"
done
"$skeletex" reconstruct "$work/bear.skx.exr" -o "$work/bear.ply" --size 128
bear=(--azimuth 25 --elevation 10)
view=(--up 0,0,1 --front 0,-1,0 --elevation 8 --size 320x520)
man=("${view[@]}" --azimuth 20)
posed=("${view[@]}" --azimuth 50)

# Tutorial: the input, the texture, the reconstruction and its error.
"$skeletex" render configs/models/bear.json --mode segments --show-skeleton "${bear[@]}" --size 480x520 -o "$work/1.png"
"$skeletex" render "$work/bear.skx.exr" --mode layout --size 520x520 -o "$work/2.png"
"$skeletex" render "$work/bear.skx.exr" "${bear[@]}" --size 480x520 -o "$work/3.png"
"$skeletex" render configs/models/bear.json --mode error --against "$work/bear.ply" "${bear[@]}" --size 720x520 -o "$work/error.png"

# Poses: bind pose, sitting, walking, and the weights of one bone.
"$skeletex" render "$work/man.skx.exr" "${man[@]}" -o "$work/bind.png"
"$skeletex" render "$work/man.skx.exr" --pose configs/poses/man_sit.json --time 1 "${posed[@]}" -o "$work/sit.png"
"$skeletex" render "$work/man.skx.exr" --pose configs/poses/man_walk.json --time 1 "${posed[@]}" -o "$work/walk.png"
"$skeletex" render "$work/man.skx.exr" --mode weights --bone left_upper_arm "${man[@]}" -o "$work/weights.png"

# Filters.
"$skeletex" filter "$work/man.skx.exr" smooth --scale 0.02 --keep-volume -o "$work/smooth.skx.exr"
"$skeletex" filter "$work/man.skx.exr" enhance --gain 2 -o "$work/enhance.skx.exr"
"$skeletex" filter "$work/man.skx.exr" noise --amplitude 0.004 --wavelength 0.03 -o "$work/noise.skx.exr"
for name in smooth enhance noise; do
  "$skeletex" render "$work/$name.skx.exr" "${man[@]}" -o "$work/$name.png"
done

# The page, wide and on a phone.
modules=build/release/core/page/node_modules
"$skeletex" encode build/meshes/homer.off configs/skeletons/homer.skeleton.json -o "$work/homer.skx.exr"
"$skeletex" view "$work/man.skx.exr" "$work/homer.skx.exr" --up z --size 256 -o "$work/morph.html"
"$skeletex" view "$work/bear.skx.exr" --against build/meshes/bear.off -o "$work/bear.html"
node docs/pictures/page.mjs "$modules" "$work/morph.html" '#t=0.3&mode=segments' 1100x720 light "$work/wide.png"
node docs/pictures/page.mjs "$modules" "$work/bear.html" '#mode=checker' 380x720 dark "$work/phone.png"

# The examples in Python.
for name in first_steps shape_space; do
  PYTHONPATH=build/release/python MPLBACKEND=Agg /usr/bin/python3 -W ignore "python/examples/$name.py" "$work"
done

/usr/bin/python3 - "$work" "$target" <<'PYTHON'
import pathlib
import sys

from PIL import Image

work, target = map(pathlib.Path, sys.argv[1:])


def side_by_side(names, name, is_dithered=False):
    images = [Image.open(work / f"{n}.png").convert("RGB") for n in names]
    height = max(image.height for image in images)
    row = Image.new("RGB", (sum(image.width for image in images), height), "white")
    x = 0
    for image in images:
        row.paste(image, (x, (height - image.height) // 2))
        x += image.width
    if is_dithered:  # many colours
        palette = row.quantize(256, method=Image.Quantize.MAXCOVERAGE)
        row = row.quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG)
    row.quantize(256).save(target / f"{name}.png", optimize=True)


side_by_side(["1", "2", "3"], "tutorial")
side_by_side(["error"], "error")
side_by_side(["bind", "sit", "walk", "weights"], "pose")
side_by_side(["bind", "smooth", "enhance", "noise"], "filter")
side_by_side(["wide", "phone"], "view")
side_by_side(["first_steps"], "python", is_dithered=True)
side_by_side(["shape_space"], "shape-space")
PYTHON
ls -l "$target"
