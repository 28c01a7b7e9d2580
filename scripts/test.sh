#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Installs what is missing, builds everything and runs every test. Another preset by name: scripts/test.sh asan
set -euo pipefail
cd "$(dirname "$0")/.."
preset=${1:-release}

bash scripts/install-dependencies.sh
cmake --preset "$preset"
cmake --build --preset "$preset"
ctest --preset "$preset" --parallel "$(nproc)"
