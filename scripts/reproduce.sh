#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Installs what is missing, builds, runs the experiments of configs/paper.json on real models and writes one page with every
# figure and table: results/report/index.html. The main job, models to textures and back with their errors, comes first.
#
#   scripts/reproduce.sh --main     the main job alone: a few minutes
#   scripts/reproduce.sh --quick    every experiment, reduced
#   scripts/reproduce.sh            every experiment in full
#   scripts/reproduce.sh [--quick] MESH SKELETON    a model of your own: which size it needs, its errors, times, segments, methods and
#                                   levels of detail; on results/own/report/index.html
#
# What the same commit has done is kept: after an interruption the same command goes on. The page is made from a clean checkout only, so
# that its commit tells what ran; --draft, while you change the program, makes one all the same and says so on it.
set -euo pipefail
usage() { echo "usage: scripts/reproduce.sh [--main | --quick] [--draft] | [--quick] MESH SKELETON" >&2; exit 2; }
options=() main="" draft=()
while [[ "${1:-}" == -* ]]; do
  case "$1" in
    --quick) options+=(--quick) ;;
    --main) main=yes ;;
    --draft) draft=(--draft) ;;
    *) usage ;;
  esac
  shift
done
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
if [ "$results" = results ] && [ -z "$main" ] && [ "${#draft[@]}" -eq 0 ]; then
  changed=$(git status --porcelain) || { echo "reproduce: this is no git checkout, so the page could not say what ran; go on with --draft" >&2; exit 1; }
  [ -z "$changed" ] || { printf 'reproduce: changed files:\n%s\nCommit them or put them away, or go on with --draft.\n' "$changed" >&2; exit 1; }
fi
what=figures
[ -z "$main" ] || what=main
bash scripts/install-dependencies.sh "$what"
# A build with tests stays one.
if grep -qs '^SKELETEX_BUILD_TESTS:BOOL=ON' build/release/CMakeCache.txt; then what=release; fi
cmake --preset "$what"
targets=(skeletex)
[ -n "$main" ] || [ "$results" != results ] || targets+=(peers pose_rules)  # what experiments compare with
cmake --build --preset release --target "${targets[@]}"
program=build/release/bin/skeletex

if [ -n "$main" ]; then
  "$program" run configs/experiments/main.json --resume
  exit
fi
status=0
"$program" run "$list" --resume "${options[@]}" || status=$?
page=$(/usr/bin/python3 paper_figures/report.py "$results" "${draft[@]}")  # the interpreter that python3-matplotlib belongs to
echo "Everything on one page: $page"
exit "$status"
