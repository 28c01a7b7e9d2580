#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Exports models and has the Khronos validator check them: gltf_test.sh SKELETEX SOURCE WORK
# The validator comes from npm. Skipped (exit code 77) where node or npm is missing.
set -euo pipefail
program=$1 source=$2 work=$3
for tool in node npm; do command -v $tool >/dev/null || { echo "$tool is not installed"; exit 77; }; done
mkdir -p "$work"
cp "$source"/tests/gltf/{package.json,package-lock.json,validate.mjs} "$work"
cd "$work"
[ -d node_modules ] || npm ci --silent
for model in man eight; do
  "$program" encode "$source/build/meshes/$model.off" "$source/configs/skeletons/$model.skeleton.json" -o $model.skx.exr --size 128
done
"$program" export man.skx.exr -o still.glb
"$program" export man.skx.exr -o man.glb --up z --lod 64 \
  --animation "$source/configs/poses/man_walk.json" --animation "$source/configs/poses/man_sit.json"
echo '{"frames": [{"time": -1, "pose": {}}, {"time": 0.5, "pose": {"nodes": {"left_outer_up": [0.1, 0.2, 0.3]}}}]}' >move.json
"$program" export eight.skx.exr -o eight.glb --animation move.json
"$program" reconstruct eight.skx.exr -o plain.glb
# The same with a colour for each vertex, which goes out by vertex and as a picture.
awk 'NF == 0 { next } !head { head = 1; print "COFF"; next } !count { count = $1; print; next }
  row < count { printf "%s %d 128 %d 255\n", $0, row % 256, 255 * row / count; ++row; next } { print }' \
  "$source/build/meshes/eight.off" >coloured.off
"$program" encode coloured.off "$source/configs/skeletons/eight.skeleton.json" -o coloured.skx.exr --size 64
"$program" export coloured.skx.exr -o coloured.glb
"$program" export coloured.skx.exr -o picture.glb --lod 32 --texture 128
"$program" export coloured.skx.exr -o displaced.glb --lod 16 --displacement displaced.exr
"$program" export coloured.skx.exr -o tangents.glb --lod 16 --displacement tangents.exr --displacement-for maya
"$program" reconstruct coloured.skx.exr -o plain_picture.glb --texture picture.png
node validate.mjs still.glb man.glb eight.glb plain.glb coloured.glb picture.glb displaced.glb tangents.glb plain_picture.glb
