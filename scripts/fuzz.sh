#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Fuzzes every reader with libFuzzer, address and undefined-behaviour sanitizers: scripts/fuzz.sh [SECONDS each, 20] [READER ..]
# Readers are those of tests/fuzz. A finding ends with 1, and its input lies in build/fuzz/tests/fuzz/faults.
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=${1:-20}
shift || true
readers=$(IFS='|'; echo "${*:-.*}")
cmake --preset fuzz -D SKELETEX_FUZZ_SECONDS="$seconds"
cmake --build --preset fuzz
ctest --preset fuzz --parallel "$(nproc)" -R "^fuzz/($readers)$"
