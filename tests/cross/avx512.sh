#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs tests of build/targets on a CPU with AVX-512 that Bochs emulates, where the machine has none: Debian's kernel for clouds,
# busybox and the tests start in it, and what they print comes out of its serial port.
#
#   tests/cross/avx512.sh [NAME[:GTEST FILTER]...]   e.g. shade 'nn_conv2d:Conv2dWinograd.*'; default: the kernels' quicker tests
#
# The tests find AVX3, Highway's name for AVX-512, and no other target. They take some 200 times as long as on the machine, after
# a minute in which the kernel starts.
#
# Wants the PACKAGES below (Debian 12) and the tests built (./run check targets). The kernel is fetched with apt into build/avx512: nothing
# is installed, no root is needed.
set -euo pipefail
cd "$(dirname "$0")/../.."

readonly BUILD=build/targets WORK=$PWD/build/avx512
readonly PACKAGES='bochs bochs-term vgabios isolinux syslinux-common xorriso busybox-static cpio'
readonly KERNEL=$WORK/kernel ROOT=$WORK/root DISC=$WORK/disc
readonly SYSLINUX=/usr/lib/syslinux/modules/bios/ldlinux.c32 ISOLINUX=/usr/lib/ISOLINUX/isolinux.bin
readonly QUICK=(base_array_checks raster_project raster_visibility raster_interpolate_backward
  raster_extremes render_topologies shade nn_reduce nn_axis_map nn_pointwise nn_adam 'nn_conv2d:Conv2dWinograd.*'
  'nn_gemm:-*Random*')

die() { printf 'avx512.sh: %s\n' "$*" >&2; exit 1; }

for tool in bochs xorriso busybox cpio script apt-get dpkg-deb g++; do
  command -v "$tool" >/dev/null || die "$tool is missing; on Debian: sudo apt-get install $PACKAGES"
done
for file in "$ISOLINUX" "$SYSLINUX" /usr/share/vgabios/vgabios.bin /usr/lib/*/bochs/plugins/libbx_term_gui.so; do
  [ -e "$file" ] || die "$file is missing; on Debian: sudo apt-get install $PACKAGES"
done

fetch_kernel() {
  local package
  package=$(apt-cache depends linux-image-cloud-amd64 | sed -n 's/^ *Depends: \(linux-image-.*\)/\1/p' | head -n 1)
  [ -n "$package" ] || die 'apt knows no linux-image-cloud-amd64'
  rm -rf "$KERNEL" && mkdir -p "$KERNEL"
  (cd "$KERNEL" && apt-get download -qq "$package" && dpkg-deb -x ./*.deb .)
  mv "$KERNEL"/boot/vmlinuz-* "$KERNEL/vmlinuz"
}

# A file and the shared libraries that it wants, where they are on this machine.
add_program() {  # FROM TO
  install -D "$1" "$ROOT$2"
  local library
  for library in $(ldd "$1" 2>/dev/null | grep -o '/[^ ]*'); do
    [ -e "$ROOT$library" ] || install -D "$library" "$ROOT$library"
  done
}

# Takes all targets but AVX3 from Highway.
add_only_avx3() {
  g++ -O1 -shared -fPIC -x c++ -o "$WORK/only_avx3.so" - -lhwy <<'CODE'
#include <hwy/targets.h>
__attribute__((constructor)) static void Only() { hwy::DisableTargets(~HWY_AVX3); }
CODE
  add_program "$WORK/only_avx3.so" /only_avx3.so
}

add_init() {
  cat >"$ROOT/init" <<'CODE'
#!/bin/busybox sh
/bin/busybox --install -s /bin
export PATH=/bin HOME=/tmp
mkdir -p /dev /proc /tmp
mount -t devtmpfs dev /dev && mount -t proc proc /proc && mount -t tmpfs tmp /tmp
exec </dev/null >/dev/ttyS0 2>&1
cd /tmp
echo "@ $(grep -m 1 -o -w -E 'avx512[a-z]*' /proc/cpuinfo | tr '\n' ' ')"
grep -q -w avx512f /proc/cpuinfo || : >/jobs  # the tests would find another target and pass
while read -r name filter; do
  echo "@ $name $filter"
  LD_PRELOAD=/only_avx3.so "/tests/$name" --gtest_brief=1 --gtest_color=no "--gtest_filter=$filter"
  echo "@ $name $filter: exit status $?"
done </jobs
echo '@ end'
sleep 1  # until the port has sent it
reboot -f
CODE
  chmod +x "$ROOT/init"
}

make_root() {  # NAME[:FILTER]...
  rm -rf "$ROOT" && mkdir -p "$ROOT"
  add_program "$(command -v busybox)" /bin/busybox
  add_only_avx3
  add_init
  local job name binary filter
  for job; do
    name=${job%%:*}
    IFS=$'\t' read -r _ binary filter < <(tests/legs/programs.py "$BUILD" "^$name\$" --filters) || die "$BUILD has no test $name"
    case $job in *:*) filter=--gtest_filter=${job#*:} ;; esac
    [ -x "$binary" ] || die "there is no $binary: build it with ./run check targets"
    "$binary" "$filter" --gtest_list_tests | grep '^  ' >/dev/null || die "$name has no test '$filter'"
    add_program "$binary" "/tests/$name"
    strip "$ROOT/tests/$name"
    printf '%s %s\n' "$name" "${filter#--gtest_filter=}" >>"$ROOT/jobs"
  done
}

# The emulated CPU tells sizes of compacted register states that the kernel finds wrong, whereupon it would do without AVX: xsavec
# and xsaves are therefore kept from it. Interrupts and time come from the oldest hardware, which Bochs has without ACPI.
make_disc() {
  rm -rf "$DISC" && mkdir -p "$DISC"
  (cd "$ROOT" && find . | cpio -o -H newc --quiet | gzip -1) >"$DISC/initrd"
  cp "$KERNEL/vmlinuz" "$ISOLINUX" "$SYSLINUX" "$DISC"
  cat >"$DISC/isolinux.cfg" <<'TEXT'
DEFAULT tests
PROMPT 0
LABEL tests
  KERNEL /vmlinuz
  APPEND initrd=/initrd loglevel=2 console=ttyS0,115200 clearcpuid=xsavec,xsaves nosmp noapic nolapic acpi=off tsc=unstable lpj=1000000 nokaslr mitigations=off cryptomgr.notests random.trust_cpu=on panic=-1 reboot=t
TEXT
  xorriso -as mkisofs -quiet -o "$WORK/disc.iso" -b isolinux.bin -c boot.cat -no-emul-boot -boot-load-size 4 -boot-info-table \
    "$DISC" 2>"$WORK/xorriso.log"
}

# Debian's Bochs has its debugger in it, which waits to be told to continue; and a display that wants a terminal.
start_bochs() {
  echo continue >"$WORK/debugger"
  cat >"$WORK/bochsrc" <<TEXT
config_interface: textconfig
display_library: term
cpu: model=corei7_skylake_x, count=1, ips=50000000, reset_on_triple_fault=0
memory: guest=2048, host=2048
romimage: file=/usr/share/bochs/BIOS-bochs-latest
vgaromimage: file=/usr/share/vgabios/vgabios.bin
ata0-master: type=cdrom, path=$WORK/disc.iso, status=inserted
boot: cdrom
com1: enabled=1, mode=file, dev=$WORK/serial.txt
log: $WORK/bochs.log
panic: action=fatal
clock: sync=none
TEXT
  exec script -qec "exec bochs -q -f '$WORK/bochsrc' -rc '$WORK/debugger'" /dev/null </dev/null >"$WORK/screen.txt" 2>&1
}

[ $# -gt 0 ] || set -- "${QUICK[@]}"
[ -e "$KERNEL/vmlinuz" ] || fetch_kernel
make_root "$@"
make_disc
: >"$WORK/serial.txt"
start_bochs &
bochs=$!
trap 'kill "$bochs" 2>/dev/null || true' EXIT
tail -f --pid="$bochs" "$WORK/serial.txt" | sed -u 's/\r$//'
wait "$bochs" || true  # it ends by the kernel's restart, which Bochs is told to take for an error
grep -q '^@ end' "$WORK/serial.txt" || die "the tests did not come to their end; see $WORK/serial.txt and bochs.log"
grep -q '^@ avx512f' "$WORK/serial.txt" || die 'the kernel finds no AVX-512 on the emulated CPU: nothing was tested'
! grep '^@ .*: exit status [^0]' "$WORK/serial.txt" || die 'these failed'
