#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
# Packs the bundle, unpacks it into an empty root, and starts it there and here.
# Usage: tests/system/bundle/run.sh FOLDER     to work in
set -euo pipefail
work=$1
rm -rf "$work"
mkdir -p "$work/root"
"$(dirname "$0")/../../../scripts/bundle" "$work/bundle"
bytes=$(stat -c %s "$work"/bundle.tar.*)
# The destination takes 64 MiB; with floor plans (cairo and its dependencies) the bundle has 42 MB. Bundles are made on
# Debian 12, with the oldest C library; the libraries of Debian 13 are larger.
most=46000000
[[ $(. /etc/os-release && echo "${VERSION_ID:-}") == 12 ]] || most=50000000
[[ $bytes -le $most ]] || { echo "the bundle has $bytes bytes, $most are allowed"; exit 1; }
tar -C "$work/root" -xf "$work"/bundle.tar.*

as_root=()
[[ $EUID -eq 0 ]] || as_root=(unshare -r)
in_root() { "${as_root[@]}" chroot "$work/root" /bundle/glibc/ld-linux-x86-64.so.2 --library-path /bundle/glibc:/bundle/lib "$@"; }
[[ $(in_root /bundle/bin/cairn --version) == "$("$work/bundle/cairn" --version)" ]]
told=$(in_root /bundle/bin/cairn devices 2>&1 || true)
[[ $told == *"no Vulkan device"* ]] || { echo "without a driver it says: $told"; exit 1; }
in_root /bundle/bin/cairn_device_tests --gtest_list_tests | grep -q '^Raycast\.'
"$work/bundle/cairn" devices
"$work/bundle/cairn_device_tests" --gtest_filter='Batch.*' | tail -n 1
