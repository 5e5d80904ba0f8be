#!/usr/bin/env bash
# apt-install.sh NAME PACKAGE...: installs Debian packages for the script NAME, and says so.
set -euo pipefail

name=$1
shift
say() { printf '%s: %s\n' "$name" "$*" >&2; }
fail() { say "error: $*"; exit 1; }

command -v apt-get >/dev/null || fail "there is no apt-get to install what Debian calls $*"
as_root=()
if [ "$EUID" -ne 0 ]; then
    command -v sudo >/dev/null || fail "as root, run: apt-get install $*"
    as_root=(sudo)
fi
say "installing Debian's $*"
# A fresh machine has no package lists. A mirror that fails here may still hold what the lists already name.
"${as_root[@]}" apt-get update -qq || say "apt-get update failed; trying with the package lists that are there"
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@" >&2 ||
    fail "apt-get could not install $*"
