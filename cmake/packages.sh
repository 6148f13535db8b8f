# SPDX-License-Identifier: Apache-2.0
# Debian packages for ./run and tests/legs/check.sh, which source this file.

say() { printf '\n== %s\n' "$*"; }
die() { printf '%s: %s\n' "${0##*/}" "$*" >&2; exit 1; }

# Prints those of its arguments that are not installed.
missing_packages() {
  local name
  for name in "$@"; do
    [ "$(dpkg-query -W -f='${db:Status-Status}' "$name" 2>/dev/null)" = installed ] || printf '%s\n' "$name"
  done
}

# install PACKAGE...: 0 if all of them are there in the end.
install() {
  local as=() missing
  mapfile -t missing < <(missing_packages "$@")
  [ "${#missing[@]}" -gt 0 ] || return 0
  [ -z "${TILEGRAD_NO_INSTALL:-}" ] || return 1
  if [ "$(id -u)" != 0 ]; then
    command -v sudo >/dev/null || return 1
    sudo -n true 2>/dev/null || [ -t 0 ] || return 1
    as=(sudo)
  fi
  say "installing ${missing[*]}"
  local wait=DPkg::Lock::Timeout=300  # another apt-get may be at work, as on a machine that updates itself
  "${as[@]}" apt-get -o "$wait" update -qq || true  # an old list may do
  "${as[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -o "$wait" install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
}

# require PACKAGE...: installs what is missing, or ends with the command to type.
require() {
  command -v dpkg-query >/dev/null || { printf '%s: not a Debian system: the packages are assumed to be there\n' "${0##*/}" >&2; return 0; }
  install "$@" || die "these packages are missing; type:  sudo apt-get install --no-install-recommends $(missing_packages "$@" | tr '\n' ' ')"
}
