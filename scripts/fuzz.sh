#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Fuzzes what reads files, and what edits models, with libFuzzer and the address and undefined-behaviour sanitizers:
#   [SKELETEX_FUZZ_SEED=1] scripts/fuzz.sh [SECONDS each, 60] [TARGET ..]
# Without a seed, each run tries other inputs. Targets are tests/fuzz/<target>_fuzz.cpp; without any, all of them. A
# finding ends with 1; its input stays in build/fuzz/tests/fuzz/faults, and build/fuzz/bin/<target>_fuzz INPUT shows it
# again.
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=${1:-60}
[ $# -eq 0 ] || shift
[[ $seconds =~ ^[1-9][0-9]*$ ]] || { echo "fuzz.sh: \"$seconds\" is no number of seconds" >&2; exit 2; }
targets=()
for target in "$@"; do
  [ -e "tests/fuzz/${target}_fuzz.cpp" ] || { echo "fuzz.sh: no tests/fuzz/${target}_fuzz.cpp" >&2; exit 2; }
  targets+=("${target}_fuzz")
done
names=$(IFS='|'; echo "${*:-.*}")
faults=build/fuzz/tests/fuzz/faults
cmake --preset fuzz -D SKELETEX_FUZZ_SECONDS="$seconds" -D SKELETEX_FUZZ_SEED="${SKELETEX_FUZZ_SEED:-0}"
cmake --build --preset fuzz --target "${targets[@]:-fuzz_targets}"
touch build/fuzz/started
ctest --preset fuzz --parallel "$(nproc)" -R "^fuzz/($names)\$" && exit
echo "fuzz.sh: findings:" >&2
find "$faults" -type f -newer build/fuzz/started >&2
exit 1
