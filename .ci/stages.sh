# shellcheck shell=bash
# Sourced by the scripts of this folder: what a fresh machine may lack, and how long each stage takes.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

# What only a second build would gain from.
export CARGO_INCREMENTAL=0

# By name; the toolchain itself is the one prerequisite.
if ! cargo fmt --version >/dev/null 2>&1; then rustup component add rustfmt; fi
if ! cargo clippy --version >/dev/null 2>&1; then rustup component add clippy; fi
if ! python3 -c 'import ensurepip, venv' 2>/dev/null; then
    as_root=''
    if [ "$(id -u)" != 0 ]; then as_root=sudo; fi
    $as_root apt-get update -qq
    $as_root apt-get install -y -qq python3 python3-venv
fi

# stage NAME COMMAND...: runs it, and says its time at the end.
times=''
stage() {
    local name=$1 start=$SECONDS
    shift
    echo "== $name: $*"
    "$@"
    times+=$(printf '%6d s  %s' $((SECONDS - start)) "$name")$'\n'
}
trap 'printf "%s%6d s  together\n" "$times" "$SECONDS"' EXIT
