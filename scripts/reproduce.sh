#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Installs what is missing, builds, runs the experiments of configs/paper.json on real models and writes one page with every
# figure and table: results/report/index.html. The main job, models to textures and back with their errors, comes first.
#
#   scripts/reproduce.sh --main     the main job alone: a few minutes
#   scripts/reproduce.sh --quick    every experiment, reduced
#   scripts/reproduce.sh            every experiment in full
#   scripts/reproduce.sh [--quick] MESH SKELETON    a model of your own: its row of Figure 15, its curves of Figure 14, its row of
#                                   Table 1, its segments, methods and levels of detail; on results/own/report/index.html
#
# What is done is kept: after an interruption the same command goes on.
set -euo pipefail
usage() { echo "usage: scripts/reproduce.sh [--main|--quick] | [--quick] MESH SKELETON" >&2; exit 2; }
options=() main=""
case "${1:-}" in
  --quick) options=(--quick); shift ;;
  --main) main=yes; shift ;;
  -*) usage ;;
esac
list=configs/paper.json results=results
case $# in
  0) ;;
  2) [ -z "$main" ] || usage
     set -- "$(realpath -m "$1")" "$(realpath -m "$2")"
     for file in "$1" "$2"; do [ -r "$file" ] || { echo "cannot read $file" >&2; exit 1; }; done
     list=configs/own_model.json results=results/own
     options+=(--mesh "$1" --skeleton "$2" -o "$results") ;;
  *) usage ;;
esac

cd "$(dirname "$0")/.."
bash scripts/install-dependencies.sh
cmake --preset release
targets=(skeletex)
[ -n "$main" ] || targets+=(peers pose_rules)  # what experiments compare with
cmake --build --preset release --target "${targets[@]}"
program=build/release/bin/skeletex

if [ -n "$main" ]; then
  "$program" run configs/experiments/main.json --resume
  exit
fi
status=0
"$program" run "$list" --resume "${options[@]}" || status=$?
page=$(/usr/bin/python3 paper_figures/report.py "$results")  # the interpreter that python3-matplotlib belongs to
echo "Everything on one page: $page"
exit "$status"
