#!/usr/bin/env bash
# The viewer's tests: a real Chromium against the real server, which `cargo test` has built. Installs Chromium and
# Node.js by apt-get where there are none, and says so.
set -euo pipefail
cd "$(dirname "$0")/.."

say() { printf 'test-viewer: %s\n' "$*" >&2; }
fail() { say "error: $*"; exit 1; }

browser() { command -v "${CHROMIUM:-chromium}" || command -v google-chrome || true; }

missing=()
[ -n "$(browser)" ] || missing+=(chromium)
command -v node >/dev/null || missing+=(nodejs)
command -v npm >/dev/null || missing+=(npm)
if [ ${#missing[@]} -gt 0 ]; then
    command -v apt-get >/dev/null || fail "install ${missing[*]}: there is no apt-get to do it"
    as_root=()
    if [ "$EUID" -ne 0 ]; then
        command -v sudo >/dev/null || fail "as root, run: apt-get install ${missing[*]}"
        as_root=(sudo)
    fi
    say "installing Debian's ${missing[*]}"
    "${as_root[@]}" apt-get update -qq || say "apt-get update failed; trying with the package lists that are there"
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >&2 ||
        fail "apt-get could not install ${missing[*]}"
fi

[ -d tests/viewer/node_modules/playwright-core ] ||
    npm install --prefix tests/viewer --no-audit --no-fund --no-package-lock --silent
CHROMIUM="$(browser)" SPAO_SERVER="${SPAO_SERVER:-$PWD/target/debug/spao-server}" node --test tests/viewer/viewer.test.mjs
