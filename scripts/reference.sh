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
cp results/figures/*.png "$target/figures/"
too_large=$(find "$target" -name '*.png' -size +200k)
[ -z "$too_large" ] || { echo "reference: larger than 200 KB: $too_large" >&2; exit 1; }
du -sh "$target"
