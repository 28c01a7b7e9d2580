#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Installs what is missing, builds, runs the experiments of configs/paper.json on real models and writes one page with every
# figure and table: results/report/index.html. The main job, models to textures and back with their errors, comes first.
#
#   scripts/reproduce.sh --main     the main job alone: a few minutes
#   scripts/reproduce.sh --quick    every experiment, reduced
#   scripts/reproduce.sh            every experiment in full
#
# What is done is kept: after an interruption the same command goes on.
set -euo pipefail
cd "$(dirname "$0")/.."
case "${1:-}" in
  "") options=() ;;
  --quick) options=(--quick) ;;
  --main) options=() ;;
  *) echo "usage: scripts/reproduce.sh [--main|--quick]" >&2; exit 2 ;;
esac

bash scripts/install-dependencies.sh
cmake --preset release
cmake --build --preset release --target skeletex
program=build/release/bin/skeletex

if [ "${1:-}" = --main ]; then
  "$program" run configs/experiments/main.json --resume
  exit
fi
status=0
"$program" run configs/paper.json --resume "${options[@]}" || status=$?
page=$(/usr/bin/python3 paper_figures/report.py)  # the interpreter that python3-matplotlib belongs to
echo "Everything on one page: $page"
exit "$status"
