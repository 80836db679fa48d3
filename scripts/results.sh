#!/usr/bin/env bash
# Every page of docs/results that `bench` writes, measured anew or gone on with:
#   scripts/results.sh WORK PYTHON SNAPSHOT [SNAPSHOT ...] [-- OPTIONS]
# SNAPSHOT: nbody128 first, then those of lab/datasets/make.sh; PYTHON has crates/particlegs-lab/lab/requirements.txt;
# OPTIONS are bench's (--training). The program has the feature `lab`. Keep the machine quiet: seconds are measured too.
set -euo pipefail
cd "$(dirname "$0")/.."
work=$1 python=$2
shift 2
program=${PARTICLEGS:-target/release/particlegs}
snapshots=() options=()
while (($#)); do
    if [[ $1 == -- ]]; then shift; options=("$@"); break; fi
    snapshots+=("$1"); shift
done
"$program" bench all "${snapshots[@]}" -o "$work" --python "$python" "${options[@]}"
scripts/results-pages.py "$work" docs/results
