#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Installs the packages that Skeletex needs, where they are missing, and unpacks the standard meshes (from Debian's package
# libcgal-demo) into build/meshes. As root, or with sudo. Nothing to do: ends at once.
#
#   scripts/install-dependencies.sh main       to build the program and run the main job
#   scripts/install-dependencies.sh package    to build the Debian package (scripts/package.sh)
#   scripts/install-dependencies.sh figures    to run all experiments and draw their figures
#   scripts/install-dependencies.sh [all]      to run every test too
#
# Debian 12; on Ubuntu 22.04 and 24.04 by the names there. SKELETEX_SKIP_PACKAGES names packages to leave out, because you
# have installed what they hold by hand.
set -euo pipefail
cd "$(dirname "$0")/.."
set_name=${1:-all}

main=(
  g++ cmake ninja-build                                              # build
  ocl-icd-opencl-dev ocl-icd-libopencl1 opencl-headers opencl-clhpp-headers pocl-opencl-icd  # OpenCL, on the CPU
  libopenmesh-dev libeigen3-dev libopenexr-dev libxxhash-dev nlohmann-json3-dev libfmt-dev libsleef-dev  # library
  libpng-dev libturbojpeg0-dev libjpeg62-turbo-dev zlib1g-dev liblzma-dev libtinygltf-dev            # pictures, the page, glTF
  libdraco-dev libmeshoptimizer-dev libstb-dev libwebp-dev           # glTF that is compressed
  libegl-dev libopengl-dev libegl1 libegl-mesa0 libgl1-mesa-dri libcairo2-dev pkg-config fonts-dejavu-core  # renderer, without a GPU too
  libcli11-dev libspdlog-dev libembree-dev                           # program (bench compares with Embree)
)
page=()
# The page of `skeletex view` is bundled with npm. Debian has it as a package of its own; that of nodejs.org and of
# NodeSource brings it, and refuses Debian's.
command -v npm >/dev/null || page=(nodejs npm)
package=("${main[@]}" "${page[@]}" libcgal-dev dpkg-dev file debootstrap)  # debootstrap: package.sh --try
figures=(
  "${main[@]}" "${page[@]}" python3 python3-matplotlib python3-pil
  libbenchmark-dev libcgal-dev draco                                 # what the experiments compare with
)
# shellcheck disable=SC2034  # by its name below
all=(
  "${figures[@]}" "${package[@]}"
  libgtest-dev librapidcheck-dev openexr oclgrind                    # tests (models against exrheader, kernels under Oclgrind)
  clang-format clang-tidy clang-14 libclang-rt-14-dev                                    # scripts/lint.sh, scripts/fuzz.sh
  groff-base zsh fish                                                # tests: manual pages, and completions by the shells
  pybind11-dev python3-dev python3-numpy python3-setuptools python3-venv python3-pytest mypy  # the Python package, and its tests
  chromium                                                                              # tests: the report and the page of `view` in a browser
  snakemake slurmctld slurmd slurm-client munge                                         # tests: sweeps on many machines
)
case $set_name in
  main | package | figures | all) declare -n packages=$set_name ;;
  *) echo "usage: scripts/install-dependencies.sh [main | package | figures | all]" >&2; exit 2 ;;
esac

# What Ubuntu calls otherwise; "-": it has no such package (its Chromium is a snap).
declare -A ubuntu=([libjpeg62-turbo-dev]=libjpeg-turbo8-dev [chromium]=-)
# What Ubuntu 22.04 has, but too old.
declare -A too_old=([cmake]="3.22, and 3.25 is needed" [libopenexr-dev]="OpenEXR 2.5, and 3.1 is needed")

# shellcheck source=/dev/null
system=$(. /etc/os-release && echo "$ID ${VERSION_ID:-}")
wanted=() lacking=() old=()
for package in $(printf '%s\n' "${packages[@]}" | sort -u); do
  [[ " ${SKELETEX_SKIP_PACKAGES:-} " != *" $package "* ]] || continue
  if [[ $system == ubuntu* ]]; then
    [[ $system != "ubuntu 22.04" || -z "${too_old[$package]:-}" ]] || old+=("$package: ${too_old[$package]}")
    package=${ubuntu[$package]:-$package}
  fi
  [ "$package" = - ] || wanted+=("$package")
done
if [ ${#old[@]} -gt 0 ]; then
  printf 'install-dependencies: %s has\n' "$system" >&2
  printf '  %s\n' "${old[@]}" >&2
  echo "Install newer ones by hand and name these packages in SKELETEX_SKIP_PACKAGES, or use the container (docs/install.md)." >&2
  exit 1
fi
[[ $system != ubuntu* || $set_name != all ]] || command -v chromium google-chrome >/dev/null ||
  echo "install-dependencies: Ubuntu has no package of Chromium; tests in a browser need \`snap install chromium\`" >&2

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
for package in "${wanted[@]}"; do
  dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q 'ok installed' || missing+=("$package")
done
if [ ${#missing[@]} -gt 0 ]; then
  echo "Installing ${missing[*]}"
  update_lists
  for package in "${missing[@]}"; do
    [[ $(apt-cache policy "$package") == *"Candidate: "[!\(]* ]] || lacking+=("$package")
  done
  [ ${#lacking[@]} -eq 0 ] || {
    echo "install-dependencies: the archive of $system lacks ${lacking[*]}; install by hand what they hold, and name them in SKELETEX_SKIP_PACKAGES" >&2
    exit 1
  }
  as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends "${missing[@]}" </dev/null
fi

[ "$set_name" != package ] || exit 0  # needs no meshes

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
