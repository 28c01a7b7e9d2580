#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Makes the Debian package of the program: build/package/skeletex_VERSION_ARCHITECTURE.deb.
#
#   scripts/package.sh          installs what the build needs, and builds it
#   scripts/package.sh --try    then installs it in a bare Debian 12 (by debootstrap, as root) and encodes, reconstructs, measures
#                               and draws a model there
#   scripts/package.sh --try DEB    only tries a package that is there
set -euo pipefail
usage() { echo "usage: scripts/package.sh [--try [DEB]]" >&2; exit 2; }
case "$#:${1:-}" in 0: | 1:--try | 2:--try) ;; *) usage ;; esac
deb=
[ $# -lt 2 ] || deb=$(realpath -e "$2")
cd "$(dirname "$0")/.."

build() {
  bash scripts/install-dependencies.sh package
  local preset=main
  if grep -qs '^SKELETEX_BUILD_TESTS:BOOL=ON' build/release/CMakeCache.txt; then preset=release; fi  # a build with tests stays one
  cmake --preset "$preset"
  cmake --build --preset release --target skeletex skeletex_wrap
  [ -s build/release/core/page/page.html ] || { echo "package: the page of view could not be bundled (see above); npm needs the network once" >&2; exit 1; }
  rm -rf build/package
  cpack --config build/release/CPackConfig.cmake -B build/package
  deb=$(realpath -e build/package/skeletex_*.deb)
}

# A bare Debian 12 in $root. Packages come from where this machine's come from, if it is a Debian 12 too.
make_root() {
  local mirror
  mirror=$(apt-get indextargets --format '$(RELEASE) $(REPO_URI)' 'Created-By: Packages' | sed -n 's/^bookworm //p' | head -n 1)
  mkdir -p build/debs
  debootstrap --variant=minbase --cache-dir="$PWD/build/debs" bookworm "$root" ${mirror:+"$mirror"}
  if [ -n "$mirror" ]; then
    rm -f "$root/etc/apt/sources.list"
    (cd /etc/apt && cp -rL --parents --no-preserve=ownership apt.conf.d sources.list* auth.conf* trusted.gpg* "$root/etc/apt") 2>/dev/null || true
    [ ! -e /etc/resolv.conf ] || cp -L /etc/resolv.conf "$root/etc/resolv.conf"
  fi
}

inside() { env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/ DEBIAN_FRONTEND=noninteractive chroot "$root" "$@"; }

try() {
  [ "$(id -u)" -eq 0 ] || { echo "package: --try needs root, for debootstrap and chroot" >&2; exit 1; }
  bash scripts/install-dependencies.sh main  # the mesh
  command -v debootstrap >/dev/null || bash scripts/install-dependencies.sh package
  root=$(mktemp -d)
  trap 'umount "$root/proc" "$root/sys" 2>/dev/null || true; rm -rf --one-file-system "$root"' EXIT
  make_root
  mount -t proc proc "$root/proc"
  mount --bind /sys "$root/sys"  # PoCL looks there for processors and memory
  mkdir "$root/try"
  cp "$deb" build/meshes/bear.off configs/skeletons/bear.skeleton.json "$root/try"
  inside apt-get update -q
  inside apt-get install -y -q "/try/$(basename "$deb")"
  inside bash -euo pipefail -c '
    cd /try
    skeletex devices
    skeletex encode bear.off bear.skeleton.json -o bear.skx.exr --size 256
    skeletex reconstruct bear.skx.exr -o bear.ply
    skeletex metro bear.off bear.ply | tee metro.txt
    awk "/surface to B/ { found = 1; if (\$5 > 1e-4) exit 1 } END { exit !found }" metro.txt
    skeletex render bear.skx.exr -o bear.png
    skeletex view bear.skx.exr -o bear.html
    grep -q "<canvas" bear.html
    skeletex skeletonize bear.off -o made.skeleton.json
    skeletex_wrap --help >/dev/null
    ls -l bear.skx.exr bear.ply bear.png bear.html made.skeleton.json'
  mkdir -p build/package
  cp "$root/try/bear.png" build/package/try.png
  inside apt-get purge -y -q skeletex >/dev/null
  [ -z "$(inside find /usr -name '*skeletex*')" ] || { echo "package: files are left after it is removed" >&2; exit 1; }
  echo "$(basename "$deb") installs, runs and is removed on a bare Debian 12; the picture that it drew: build/package/try.png"
}

if [ -z "$deb" ]; then build; fi
if [ $# -gt 0 ]; then try; fi
