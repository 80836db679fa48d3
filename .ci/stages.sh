# shellcheck shell=bash
# Sourced by the scripts of this folder: what a fresh machine may lack, and how long each stage takes.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

# What only a second build would gain from.
export CARGO_INCREMENTAL=0

# By name; the toolchain itself is the one prerequisite.
if ! cargo fmt --version >/dev/null 2>&1; then rustup component add rustfmt; fi
if ! cargo clippy --version >/dev/null 2>&1; then rustup component add clippy; fi
# shellcheck source=tests/packages.sh
. tests/packages.sh
python3 -c 'import ensurepip, venv' 2>/dev/null || packages python3 python3-venv

# stage NAME COMMAND...: runs it, and notes its time.
times=$(mktemp)
stage() {
    local name=$1 start=$SECONDS
    shift
    echo "== $name: $*"
    "$@"
    printf '%6d s  %s\n' $((SECONDS - start)) "$name" >>"$times"
}

# together FUNCTION...: runs them at the same time, and shows what each printed when it has ended. The first, which takes
# longest, goes before the others.
together() {
    local logs function failed=0 jobs=()
    logs=$(mktemp -d)
    for function; do
        (
            trap - EXIT
            if [ "$function" != "$1" ]; then renice -n 10 -p "$BASHPID" >/dev/null; fi
            "$function"
        ) >"$logs/$function" 2>&1 &
        jobs+=($!)
    done
    for function; do
        wait "${jobs[0]}" || failed=1
        jobs=("${jobs[@]:1}")
        cat "$logs/$function"
    done
    rm -r "$logs"
    return "$failed"
}
trap 'cat "$times"; printf "%6d s  in all\n" "$SECONDS"; rm "$times"' EXIT
