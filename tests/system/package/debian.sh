#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
# Makes Debian's packages of a build, checks them with lintian, installs them into an otherwise empty root of the
# current distribution, and uses them there as a user would.
# Usage: tests/system/package/debian.sh BUILD WORK [SUITE PACKAGES]     exit code 77: a root cannot be made here
# SUITE: another release; PACKAGES: folder of its packages (scripts/try-on SUITE ./scripts/package).
set -euo pipefail
build=$1 work=$2 packages=${4:-$1/packages} source=$(cd "$(dirname "$0")" && pwd)
. /etc/os-release
suite=${3:-$VERSION_CODENAME}
mirror=${DEBIAN_MIRROR:-http://deb.debian.org/debian}

for tool in mmdebstrap lintian; do
  command -v $tool >/dev/null || { echo "$tool is not here: scripts/install-deps --tests"; exit 77; }
done
mkdir -p "$work"
if [[ $# -lt 4 ]]; then
  cmake --build "$build" --target package >/dev/null
  lintian --no-cfg --allow-root --fail-on error "$packages"/*.deb
fi

root=$work/root
inside() { unshare --mount --pid --fork sh -c 'root=$1; shift; mount -t proc proc "$root/proc" && exec chroot "$root" "$@"' - "$root" "$@"; }
as_user() { inside su -l user -c "$*"; }
rm -rf "$root"
if ! { mmdebstrap --quiet --variant=apt --include=passwd "$suite" "$root" "$mirror" && inside true; } 2>"$work/why"; then
  cat "$work/why"
  exit 77
fi
trap 'rm -rf "$root"' EXIT
for name in cairn libcairn-dev python3-cairn; do cp "$packages/${name}"_*.deb "$root/$name.deb"; done
add() { inside env DEBIAN_FRONTEND=noninteractive apt-get install -qq --no-install-recommends "$@" >"$work/apt.log" 2>&1 || { tail -n 20 "$work/apt.log"; exit 1; }; }

inside apt-get update -qq
echo "== the program and the Python package"
add /cairn.deb /python3-cairn.deb
inside useradd --create-home --shell /bin/bash user
as_user cairn --version --verbose
as_user cairn demo -o demo
for file in mesh.glb map.vdb trajectory.txt report.html; do
  test -s "$root/home/user/demo/$file" || { echo "the demo wrote no $file"; exit 1; }
done
for file in usr/share/man/man1/cairn.1.gz usr/share/bash-completion/completions/cairn \
            usr/share/zsh/vendor-completions/_cairn usr/share/fish/vendor_completions.d/cairn.fish; do
  test -s "$root/$file" || { echo "there is no $file"; exit 1; }
done
grep -qs 1d27 "$root"/lib/udev/rules.d/*.rules || { echo "no udev rule lets users open a sensor"; exit 1; }
as_user 'python3 - <<END
import cairn
mapper = cairn.Mapper(cairn.Rig.kinect_v1(), voxel_size=0.02)
room = cairn.Scene("room")
eye = cairn.SceneCamera(room, mapper.rig.depth)
for i in range(3):
    seen = eye.look(room.pose(i / 30))
    assert mapper.add(seen.depth, seen.color, time=i / 30).pose is not None
print(len(mapper.mesh().triangles), "triangles from Python")
END'

echo "== the library, by CMake and by pkg-config"
add /libcairn-dev.deb g++ cmake make pkg-config
cp -r "$source" "$root/outside"
chmod -R a+rX "$root/outside"
as_user 'cp -r /outside . && sed -i /readme/d outside/CMakeLists.txt && cmake -S outside -B by-cmake -DCMAKE_BUILD_TYPE=Release >/dev/null && cmake --build by-cmake && by-cmake/cairn_user'
as_user 'g++ -O1 $(pkg-config --cflags cairn) outside/main.cpp -o by-pkg-config $(pkg-config --libs cairn) && ./by-pkg-config'

echo "== and they go again"
inside env DEBIAN_FRONTEND=noninteractive apt-get purge -qq cairn python3-cairn libcairn-dev >/dev/null
left=$(find "$root/usr" -iname '*cairn*' ! -path '*/zoneinfo/*')  # Pitcairn
[[ -z $left ]] || { echo "left behind: $left"; exit 1; }
