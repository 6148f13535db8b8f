#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The legs of `./run check`: other compilers, sanitizers, instruction sets, packagings. A leg's build lies in build/<leg>.
#
#   tests/legs/check.sh [--short] LEG...      all: every leg, one after the other, with a table of times at the end
#
# --short: a part of each leg that takes minutes, for CI. What each leg holds stands beside it below.
set -euo pipefail
cd "$(dirname "$0")/../.."
source cmake/packages.sh
export PYTHONDONTWRITEBYTECODE=1  # as ./run

readonly LEGS=(format headers docs install wheel targets memcheck werror asan fuzz tsan scalar clang clang-new tidy coverage aarch64)
# Where the short form of a sanitizer's or compiler's leg looks: what files of strangers reach, and what runs in threads.
readonly FILES_TESTS='^(base_|io_|fuzz_replay|api_c|scene_)' THREADS_TESTS='^(base_few_threads|api_renderer|render_pipeline|nn_tape|nn_lanes|base_worker_groups)'
# Tests that hold kernels to their references.
readonly KERNEL_TESTS='^(base_simd|base_array|raster_|render_|renderer_|shade|shaded|nn_|compat_|rivals_)'
# Those that valgrind, which takes fifty times as long, runs in minutes.
readonly MEMCHECK_TESTS='^(base_simd|base_array|raster_(project|interp|vis|extr)|render_|renderer_|shade|shaded|nn_[^a]|nn_a[^l]|compat_)'
readonly MEMCHECK_SHORT='^(base_array|raster_(project|interp)|renderer_simd|shade|nn_ops|compat_)'
readonly OUT=$PWD/out/check

SHORT=
LAUNCHER=()
! command -v ccache >/dev/null || LAUNCHER=(-DCMAKE_CXX_COMPILER_LAUNCHER=ccache)

# targets BUILD PATTERN: the programs behind tests whose names match, as targets of ninja.
targets() {
  tests/legs/programs.py "$1" "$2"
}

# leg_configure PRESET NAME [OPTION OF CMAKE]...: configures build/NAME.
leg_configure() {
  local preset=$1 name=$2
  shift 2
  [ -f "build/$name/build.ninja" ] || cmake --preset "$preset" -B "build/$name" "${LAUNCHER[@]}" "$@" >"$OUT/configure-$name.log" 2>&1 \
    || { tail -n 30 "$OUT/configure-$name.log"; die "configuring $name failed"; }
}

# build_and_test NAME PATTERN: builds and runs the short tests that match, of build/NAME.
build_and_test() {
  local chosen
  mapfile -t chosen < <(targets "build/$1" "$2")
  [ "${#chosen[@]}" -gt 0 ] || die "no test of build/$1 matches $2"
  compile "build/$1" --target "${chosen[@]}" -- -k 0
  ctest --test-dir "build/$1" -L short -R "$2" --output-on-failure --no-tests=error -j "$(nproc)"
}

# tree PRESET NAME SHORT_PATTERN [OPTION]...: a leg that is a build of its own with its tests.
tree() {
  local preset=$1 name=$2 pattern=$3
  shift 3
  leg_configure "$preset" "$name" "$@"
  if [ -n "$SHORT" ]; then build_and_test "$name" "$pattern"; return; fi
  compile "build/$name" -- -k 0  # one error does not hide the others
  ctest --test-dir "build/$name" -L short --output-on-failure --no-tests=error -j "$(nproc)"
}

# targets_build PATTERN: builds tests in build/targets, whose kernels are compiled for every instruction set and EMU128.
targets_build() {
  leg_configure release targets -DTILEGRAD_SIMD=all -DTILEGRAD_BENCH=OFF -DTILEGRAD_PYTHON=OFF
  local chosen
  mapfile -t chosen < <(targets build/targets "$1")
  [ "${#chosen[@]}" -gt 0 ] || die "no test of build/targets matches $1"
  compile build/targets --target "${chosen[@]}"
}

# only TARGET: the tests of build/targets, where Highway finds this target and no other.
only() {
  local library=$OUT/only_$1.so
  g++ -O1 -shared -fPIC -x c++ -o "$library" - -lhwy <<CODE
#include <hwy/targets.h>
__attribute__((constructor)) static void Only() { hwy::DisableTargets(~static_cast<int64_t>(HWY_$1)); }
CODE
  LD_PRELOAD=$library kernel_tests
}

leg_format() { ./run lint; }

# Every header compiles by itself: it includes what it uses, as far as a compiler can tell.
leg_headers() {
  local flags=(-std=c++20 -fsyntax-only -Iinclude -Isrc -DTOML_HEADER_ONLY=0 -DFMT_SHARED -DHWY_BROKEN_EMU128=0)
  git ls-files 'include/*.h' 'src/*.h' | grep -v -e '-inl\.h$' | xargs -P "$(nproc)" -n 8 bash -c '
    for f in "${@:'$((${#flags[@]} + 1))'}"; do g++ "${@:1:'${#flags[@]}'}" -x c++ -include "$f" /dev/null || { echo "not by itself: $f"; bad=1; }; done
    exit "${bad:-0}"' _ "${flags[@]}"
}

leg_docs() { ./run docs; python3 tests/structure/references.py; }
leg_install() {
  leg_configure portable portable
  compile build/portable
  cmake -DBUILD="$PWD/build/portable" -DSOURCE="$PWD" -DWORK="$OUT/install" -DCC=gcc -DCXX=g++ -DFLAGS= -DLINK_FLAGS= -P tests/install/install_test.cmake
}
leg_wheel() {
  ./run wheel
  local environment
  environment=$(mktemp -d)
  /usr/bin/python3 -m venv --system-site-packages "$environment"  # Debian's, which has NumPy
  "$environment/bin/pip" install -q --no-index --no-deps --force-reinstall out/wheel/*.whl
  (cd / && "$environment/bin/python" -c 'import tilegrad; print(tilegrad.__file__)' && "$environment/bin/tilegrad" selftest --only files)
  rm -rf "$environment"
}
kernel_tests() { ctest --test-dir build/targets -L short -R "$KERNEL_TESTS" --output-on-failure --no-tests=error -j "$(nproc)"; }
# Each kernel beside its reference on every instruction set that this machine has; then all else that calls kernels, on some of them.
leg_targets() {
  targets_build "$KERNEL_TESTS"
  kernel_tests
  only EMU128
  ! grep -q -m 1 avx2 /proc/cpuinfo || only AVX2
}
# Values that nobody set, in kernels: valgrind runs them as far as AVX2. Tests of how long something takes are left out.
memcheck() {  # NAME PROGRAM FILTER
  local log=$OUT/memcheck-$1.txt
  valgrind -q --error-exitcode=9 --suppressions=tests/legs/memcheck.supp --show-mismatched-frees=no --num-callers=20 "$2" \
    --gtest_brief=1 "$3:*Death*:*AllocatesNothing*:*ManyTensors*" >"$log" 2>&1 || { echo "not clean: $1"; tail -n 40 "$log"; exit 1; }
}
leg_memcheck() {
  require valgrind
  local pattern=$MEMCHECK_TESTS
  [ -z "$SHORT" ] || pattern=$MEMCHECK_SHORT
  targets_build "$pattern"
  export -f memcheck
  export OUT
  tests/legs/programs.py build/targets "$pattern" --filters | tr '\t' '\n' | xargs -d '\n' -P "$(nproc)" -n 3 bash -c 'memcheck "$@"' _
}
leg_werror() { tree release werror '^(base_|scene_|structure)' -DTILEGRAD_WERROR=ON -DTILEGRAD_UNITY=OFF; }
leg_asan() {  # by clang, which takes half as long for it
  require clang-14 libclang-rt-14-dev
  tree asan asan "$FILES_TESTS" -DCMAKE_C_COMPILER=clang-14 -DCMAKE_CXX_COMPILER=clang++-14
}
leg_fuzz() { ./run fuzz "$([ -n "$SHORT" ] && echo 5 || echo 20)"; }
leg_tsan() {
  export TSAN_OPTIONS=suppressions=$PWD/tests/legs/thread_sanitizer.supp
  tree tsan tsan "$THREADS_TESTS"
}
# With the flags of werror, so that ccache shares what has no kernels.
leg_scalar() { tree scalar scalar "$KERNEL_TESTS" -DTILEGRAD_WERROR=ON -DTILEGRAD_UNITY=OFF; }
# by_clang NAME VERSION. Clang warns of the same at any level, so the quickest that tests bear is taken.
# GCC 12's std::stable_sort calls what GCC 12 deprecates, so that is no error.
by_clang() {
  require "clang-$2"
  tree dev "$1" "$FILES_TESTS" -DCMAKE_C_COMPILER="clang-$2" -DCMAKE_CXX_COMPILER="clang++-$2" -DTILEGRAD_SIMD=few -DCMAKE_BUILD_TYPE=None \
    -DCMAKE_CXX_FLAGS="-O1 -Wno-error=deprecated-declarations" -DCMAKE_C_FLAGS=-O1
}
leg_clang() { by_clang clang 14; }
leg_clang-new() { by_clang clang-new 19; }
leg_tidy() {  # --short: every sixtieth file
  local every=1
  [ -z "$SHORT" ] || every=60
  git ls-files 'src/*.cc' | awk "NR % $every == 0" | xargs ./run lint --tidy
}
# Which lines of the readers their tests and the fuzz targets' seeds reach; --short: their tests alone.
leg_coverage() {
  require clang-14 libclang-rt-14-dev llvm-14
  leg_configure dev coverage -DCMAKE_C_COMPILER=clang-14 -DCMAKE_CXX_COMPILER=clang++-14 -DTILEGRAD_SIMD=few -DCMAKE_BUILD_TYPE=None \
    -DTILEGRAD_WERROR=OFF -DTILEGRAD_BENCH=OFF -DTILEGRAD_PYTHON=OFF -DCMAKE_CXX_FLAGS='-O0 -fprofile-instr-generate -fcoverage-mapping'
  local chosen
  mapfile -t chosen < <(targets build/coverage "$( [ -n "$SHORT" ] && echo "^io_" || echo "^(io_|fuzz_replay)")")
  compile build/coverage --target "${chosen[@]}"
  tests/legs/coverage.py build/coverage "$OUT/coverage" "${chosen[@]}"
}
leg_aarch64() {
  require g++-aarch64-linux-gnu qemu-user
  if [ -n "$SHORT" ]; then tests/cross/aarch64.sh -R '^(base_|raster_project|raster_visibility|shade)'; else tests/cross/aarch64.sh; fi
}

# leg NAME: runs it, says how long it took, and goes on after a failure.
RESULTS=()
leg() {
  local start=$SECONDS result=passed
  say "leg $1${SHORT:+ (short)}"
  bash tests/legs/check.sh ${SHORT:+--short} --one "$1" || result=FAILED  # in a shell of its own, which -e ends
  RESULTS+=("$(printf '%-10s %s %5d s' "$1" "$result" $((SECONDS - start)))")
  say "leg $1: $result after $((SECONDS - start)) s"
}

mkdir -p "$OUT"
[ "${1:-}" != --short ] || { SHORT=1; shift; }
[ $# -gt 0 ] || die "name legs, or all: ${LEGS[*]}"
[ "$1" != --one ] || { "leg_$2"; exit; }
[ "$*" != all ] || set -- "${LEGS[@]}"
for name; do [[ " ${LEGS[*]} " == *" $name "* ]] || die "no leg $name; there are: ${LEGS[*]}"; done
for name; do leg "$name"; done
say "legs"
printf '%s\n' "${RESULTS[@]}" | tee -a "$OUT/legs.txt"
! printf '%s\n' "${RESULTS[@]}" | grep -q FAILED
