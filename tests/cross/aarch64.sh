#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Cross-compiles base, scene, raster, shade, render and nn with their tests for aarch64 (NEON) and runs the tests under qemu-user.
#
#   tests/cross/aarch64.sh [CTEST OPTIONS]      e.g. -R raster; default: all short tests of these folders
#
# Wants (Debian 12): g++-aarch64-linux-gnu qemu-user cmake ninja-build. The libraries for arm64 are fetched with apt into
# build/aarch64/sysroot, with package lists of their own: nothing is installed, no root is needed.
set -euo pipefail
cd "$(dirname "$0")/../.."

readonly WORK=$PWD/build/aarch64
readonly SYSROOT=$WORK/sysroot
readonly LIBRARIES=(libhwy-dev libhwy1 libtbb-dev libtbb12 libtbbmalloc2 libtbbbind-2-5 libfmt-dev libfmt9 libglm-dev libgtest-dev
  nlohmann-json3-dev)

die() { printf 'aarch64.sh: %s\n' "$*" >&2; exit 1; }

for tool in aarch64-linux-gnu-g++ qemu-aarch64 cmake ninja apt-get dpkg-deb; do
  command -v "$tool" >/dev/null || die "$tool is missing; on Debian: sudo apt-get install g++-aarch64-linux-gnu qemu-user"
done

fetch_libraries() {
  local apt=$WORK/apt
  mkdir -p "$apt/state/lists/partial" "$apt/cache/archives/partial" "$apt/packages"
  : >"$apt/status"
  cat >"$apt/apt.conf" <<TEXT
#clear APT::Architectures;
APT::Architecture "arm64";
APT::Architectures { "arm64"; };
Dir::State "$apt/state";
Dir::State::status "$apt/status";
Dir::Cache "$apt/cache";
TEXT
  (cd "$apt/packages" && export APT_CONFIG=$apt/apt.conf && apt-get update -qq && apt-get download -qq "${LIBRARIES[@]}")
  local package
  for package in "$apt"/packages/*.deb; do dpkg-deb -x "$package" "$SYSROOT"; done
  touch "$SYSROOT/complete"
}

[ -e "$SYSROOT/complete" ] || fetch_libraries
cmake --preset aarch64
cmake --build --preset aarch64
# qemu-user keeps books on each page of addresses that a program ever reserved; the networks' arenas take 64 GB of them each where
# they may, and less where they may not.
export QEMU_RESERVED_VA=8G
export TILEGRAD_TEST_NO_FORK=1  # qemu-user stops at an assertion of its own where a forked child starts a thread
exec ctest --preset aarch64 -L short "$@"
