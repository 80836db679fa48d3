#!/bin/sh
# Quick versions of all data sets, twice: counts, the same bytes, and that the program reads them.
#   test.sh PARTICLEGS        (PYTHON as for make.sh)
set -eu
[ $# -eq 1 ] || { echo "usage: test.sh PARTICLEGS" >&2; exit 2; }
here=$(cd "$(dirname "$0")" && pwd)
python=${PYTHON:-python3}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# What stands for the files of others.
fixtures=$here/../../crates/particlegs-formats/tests/fixtures
mkdir "$work/abacus" "$work/adk"
for end in gro xtc; do cp "$fixtures/mdanalysis.$end" "$work/adk/adk_oplsaa.$end"; done
"$python" - "$work/abacus" << 'END'
import json, sys
from pathlib import Path

import numpy as np

folder, random = Path(sys.argv[1]), np.random.default_rng(1)
for name in ("xx", "yy", "zz", "vx", "vy", "vz"):
    random.uniform(0, 32, 4096).astype("<f4").tofile(folder / f"{name}.f32")
(folder / "haloes.csv").write_text("x,y,z,particles\n1,2,3,300\n4,5,6,299\n31,8,9,4000\n")
(folder / "meta.json").write_text(json.dumps({"box": 32.0, "periodic": True, "length_unit": "Mpc/h", "a": 1.0}))
END
export ABACUS="$work/abacus" ADK="$work/adk"
# JAX compiles once, not once a data set.
export JAX_COMPILATION_CACHE_DIR="$work/jax" JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS=0
"$here/make.sh" "$work/one" --quick
"$here/make.sh" "$work/two" --quick > /dev/null
"$here/make.sh" "$work/one" --quick | grep -v ': there$' && { echo "error: made again what was there" >&2; exit 1; }
"$python" "$here/check.py" "$1" "$work/one" "$work/two"
