#!/usr/bin/env bash
# Makes sure that target/tools/python is a virtual environment with what the Python client's tests need, and prints the
# path of its Python.
set -euo pipefail
cd "$(dirname "$0")/.."

requirements=clients/python/requirements-test.txt
environment=target/tools/python

fail() {
    printf 'ensure-python: error: %s\n' "$*" >&2
    exit 1
}

if ! cmp -s "$requirements" "$environment/installed.txt"; then
    # Debian's python3 comes without what venv needs.
    python3 -c 'import ensurepip, venv' 2>/dev/null || scripts/apt-install.sh ensure-python python3 python3-venv
    python3 -c 'import sys; sys.exit(sys.version_info < (3, 10))' || fail "python3 must be 3.10 or later"
    python3 -m venv "$environment" >/dev/null ||
        fail "python3 cannot make a virtual environment (Debian: apt-get install python3-venv)"
    "$environment/bin/pip" install --quiet --disable-pip-version-check --only-binary :all: \
        --requirement "$requirements" >&2 || fail "pip could not install $requirements"
    cp "$requirements" "$environment/installed.txt"
fi
printf '%s\n' "$PWD/$environment/bin/python"
