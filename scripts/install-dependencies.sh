#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Installs the Debian packages that Skeletex is built and tested with, where they are missing, and unpacks the standard
# meshes (from the package libcgal-demo) into build/meshes. As root, or with sudo. Nothing to do: ends at once.
set -euo pipefail
cd "$(dirname "$0")/.."

packages=(
  g++ cmake ninja-build                                              # build
  ocl-icd-opencl-dev ocl-icd-libopencl1 opencl-headers opencl-clhpp-headers pocl-opencl-icd  # OpenCL, on the CPU
  libopenmesh-dev libeigen3-dev libopenexr-dev libxxhash-dev nlohmann-json3-dev libfmt-dev libsleef-dev  # library
  libpng-dev libturbojpeg0-dev libjpeg62-turbo-dev zlib1g-dev liblzma-dev libtinygltf-dev            # pictures, the page, glTF
  libegl-dev libopengl-dev libegl1 libegl-mesa0 libgl1-mesa-dri libcairo2-dev pkg-config fonts-dejavu-core  # renderer, without a GPU too
  libcli11-dev libspdlog-dev libembree-dev                           # program (bench compares with Embree)
  libgtest-dev openexr oclgrind                                      # tests (models against exrheader, kernels under Oclgrind)
  qemu-user                                                          # scripts/same-bytes.py on other processors
  clang-format clang-tidy                                            # scripts/lint.sh
  libbenchmark-dev python3 python3-matplotlib python3-pil                               # benchmarks, tables of the experiments
  libmeshoptimizer-dev libcgal-dev draco libdraco-dev                                   # what the experiments compare with
  pybind11-dev python3-dev python3-numpy python3-setuptools python3-venv python3-pytest mypy  # the Python package, and its tests
  chromium                                                                              # tests: the report and the page of `view` in a browser
)
# The page of `skeletex view` is bundled with npm. Debian has it as a package of its own; that of nodejs.org and of
# NodeSource brings it, and refuses Debian's.
command -v npm >/dev/null || packages+=(nodejs npm)

as_root() {
  if [ "$(id -u)" -eq 0 ]; then "$@"; elif command -v sudo >/dev/null; then sudo "$@"; else
    echo "install-dependencies: run this as root, or install sudo: $*" >&2
    exit 1
  fi
}
have_lists=
update_lists() {
  [ -n "$have_lists" ] || as_root env DEBIAN_FRONTEND=noninteractive apt-get update -q </dev/null
  have_lists=1
}

missing=()
for package in "${packages[@]}"; do
  dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q 'ok installed' || missing+=("$package")
done
if [ ${#missing[@]} -gt 0 ]; then
  echo "Installing ${missing[*]}"
  update_lists
  as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends "${missing[@]}" </dev/null
fi

meshes_complete() {
  local name
  for name in $(sed -n 's/.*"mesh": *"\([^"]*\)".*/\1/p' configs/skeletons/*.json | sort -u); do
    [ -s "build/meshes/$name" ] || return 1
  done
}
if ! meshes_complete; then
  echo "Unpacking the standard meshes into build/meshes"
  mkdir -p build/meshes
  work=$(mktemp -d)
  trap 'rm -rf "$work"' EXIT
  data=/usr/share/doc/libcgal-dev/data.tar.gz
  if [ ! -s "$data" ]; then  # not installed, or an image that drops /usr/share/doc: the package is only unpacked
    update_lists
    [ "$(id -u)" -ne 0 ] || chown _apt "$work" || true  # apt downloads as its own user
    (cd "$work" && apt-get download -q libcgal-demo </dev/null && dpkg-deb -x libcgal-demo_*.deb .)
    data=$(find "$work" -name data.tar.gz | head -n 1)
    [ -n "$data" ] || { echo "install-dependencies: libcgal-demo holds no data.tar.gz" >&2; exit 1; }
  fi
  mkdir "$work/data"
  tar -xzf "$data" -C "$work/data"
  find "$work/data" -path '*/meshes/*.off' -exec cp -n {} build/meshes/ \;
  meshes_complete || { echo "install-dependencies: $data lacks meshes that configs/skeletons names" >&2; exit 1; }
fi
