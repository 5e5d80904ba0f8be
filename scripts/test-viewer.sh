#!/usr/bin/env bash
# The viewer's tests: a real Chromium against the real server, which `cargo test` has built. Installs Chromium and
# Node.js by apt-get where there are none, and says so.
set -euo pipefail
cd "$(dirname "$0")/.."

browser() { command -v "${CHROMIUM:-chromium}" || command -v google-chrome || true; }

missing=()
[ -n "$(browser)" ] || missing+=(chromium)
command -v node >/dev/null || missing+=(nodejs)
command -v npm >/dev/null || missing+=(npm)
[ ${#missing[@]} -eq 0 ] || scripts/apt-install.sh test-viewer "${missing[@]}"

[ -d tests/viewer/node_modules/playwright-core ] ||
    npm install --prefix tests/viewer --no-audit --no-fund --no-package-lock --silent
CHROMIUM="$(browser)" SPAO_SERVER="${SPAO_SERVER:-$PWD/target/debug/spao-server}" node --test --test-concurrency=1 tests/viewer/*.test.mjs
