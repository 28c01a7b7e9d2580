#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Installs what is missing, builds everything, holds the code against the project's rules (scripts/lint.sh) and runs every test.
# Another preset by name runs its tests alone: scripts/test.sh asan
set -euo pipefail
cd "$(dirname "$0")/.."
preset=${1:-release}

bash scripts/install-dependencies.sh
cmake --preset "$preset"
cmake --build --preset "$preset"
[ "$preset" != release ] || bash scripts/lint.sh
ctest --preset "$preset" --parallel "$(nproc)"
