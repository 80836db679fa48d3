#!/bin/sh
# Quick versions of all data sets, twice: counts, the same bytes, and that the program reads them.
#   test.sh PARTICLEGS        (PYTHON as for make.sh)
set -eu
[ $# -eq 1 ] || { echo "usage: test.sh PARTICLEGS" >&2; exit 2; }
here=$(cd "$(dirname "$0")" && pwd)
python=${PYTHON:-python3}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# JAX compiles once, not once a data set.
export JAX_COMPILATION_CACHE_DIR="$work/jax" JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS=0
"$here/make.sh" "$work/one" --quick
"$here/make.sh" "$work/two" --quick > /dev/null
"$here/make.sh" "$work/one" --quick | grep -v ': there$' && { echo "error: made again what was there" >&2; exit 1; }
"$python" "$here/check.py" "$1" "$work/one" "$work/two"
