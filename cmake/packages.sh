# SPDX-License-Identifier: Apache-2.0
# Debian packages and builds for ./run and tests/legs/check.sh, which source this file.

say() { printf '\n== %s\n' "$*"; }
die() { printf '%s: %s\n' "${0##*/}" "$*" >&2; exit 1; }

# Prints those of its arguments that are not installed.
missing_packages() {
  local name
  for name in "$@"; do
    [ "$(dpkg-query -W -f='${db:Status-Status}' "$name" 2>/dev/null)" = installed ] || printf '%s\n' "$name"
  done
}

# installed PACKAGE...: whether all of them are there.
installed() { [ -z "$(missing_packages "$@")" ]; }

# apt ARGUMENT...: apt-get with these; its status lines go to stdout, all else that it says to stderr.
# The lock may be another apt-get's, as on a machine that updates itself. sudo passes no descriptor above 2, so the shell behind it makes the third.
apt() {
  local as=()
  [ "$(id -u)" = 0 ] || as=(sudo)
  "${as[@]}" env DEBIAN_FRONTEND=noninteractive sh -c 'exec apt-get "$@" 3>&1 >&2' apt-get -o APT::Status-Fd=3 -o DPkg::Lock::Timeout=300 -qq "$@" </dev/null
}

# apt_progress WHAT: makes one line, drawn anew, of apt's status lines; nothing but on a terminal.
apt_progress() {
  local kind percent step
  while IFS=: read -r kind _ percent _; do
    case $kind in dlstatus) step=downloading ;; pmstatus) step=installing ;; *) continue ;; esac
    [ ! -t 1 ] || printf '\r\e[K== %s %s: %s %%' "$step" "$1" "${percent%%.*}"
  done
}

# prepare_apt: once, before apt is called. Fails where it must not be, or cannot.
APT_READY= APT_SAID=  # the latter: why the last call of `install` failed
unset APT_UPDATED     # what `apt-get update` complained of, once it was called
prepare_apt() {
  [ -z "$APT_READY" ] || return "$APT_READY"
  APT_READY=1
  if [ -n "${TILEGRAD_NO_INSTALL:-}" ]; then APT_SAID="TILEGRAD_NO_INSTALL is set"; return 1; fi
  if [ "$(id -u)" != 0 ] && ! { command -v sudo >/dev/null && { sudo -n true 2>/dev/null || { [ -t 0 ] && sudo -v; }; }; }; then
    APT_SAID="neither root nor sudo"; return 1
  fi
  APT_READY=0
}

# install PACKAGE...: installs those that are missing, in one call of apt; 0 if all of them are there in the end.
install() {
  local missing what started=$SECONDS
  mapfile -t missing < <(missing_packages "$@")
  [ "${#missing[@]}" -gt 0 ] || return 0
  prepare_apt || return 1
  what="${#missing[@]} packages"
  [ "${#missing[@]}" -gt 1 ] || what=${missing[0]}
  printf '\n== installing %s' "$what"
  [ -t 1 ] || echo
  [ -n "${APT_UPDATED+x}" ] || APT_UPDATED=$(apt update 2>&1 >/dev/null) || true  # old lists may do
  if { APT_SAID=$({ apt install -y --no-install-recommends "${missing[@]}" | apt_progress "$what" >&4; } 2>&1); } 4>&1; then
    [ ! -t 1 ] || printf '\r\e[K== '
    printf 'installed %s in %d s\n' "$what" $((SECONDS - started))
    return 0
  fi
  [ ! -t 1 ] || printf '\r\e[K'
  return 1
}

# require PACKAGE... [-- OPTIONAL...]: installs what is missing, or ends with the command to type. Of the optional ones it says which cannot be had.
require() {
  command -v dpkg-query >/dev/null || { printf '%s: not a Debian system: the packages are assumed to be there\n' "${0##*/}" >&2; return 0; }
  local needed=() package
  while [ $# -gt 0 ] && [ "$1" != -- ]; do needed+=("$1"); shift; done
  [ $# = 0 ] || shift
  ! install "${needed[@]}" "$@" || return 0
  { [ $# -gt 0 ] && install "${needed[@]}"; } || {
    printf '%s\n' "${APT_UPDATED:-}" "$APT_SAID" | tail -n 15 >&2
    die "these packages are missing; type:  sudo apt-get install --no-install-recommends $(missing_packages "${needed[@]}" | tr '\n' ' ')"
  }
  for package; do
    install "$package" || printf 'NOTE: %s is not installed (%s): what needs it is left out.\n' "$package" "$(tail -n 1 <<<"$APT_SAID")"
  done
}

# compile BUILD [OPTION]...: as cmake --build; where that is no terminal, a line for every tenth instead of one for every file.
compile() {
  if [ -t 1 ]; then cmake --build "$@"; return; fi
  NINJA_STATUS='[%p] ' cmake --build "$@" 2>&1 | {
    local line tenth=0
    while IFS= read -r line || [ -n "$line" ]; do
      if [[ $line =~ ^\[\ *([0-9]+)%\]\  ]]; then
        [ $((BASH_REMATCH[1] / 10)) -gt "$tenth" ] || continue
        tenth=$((BASH_REMATCH[1] / 10)) line="$((10 * tenth)) %"
      fi
      printf '%s\n' "$line"
    done
  }
}
