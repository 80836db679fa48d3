#!/usr/bin/env bash
# Velocities of every code's headers through the program and back by h5py, pynbody and yt, in the versions of the Python tests.
set -euo pipefail
cd "$(dirname "$0")/../.."
# shellcheck source=tests/common.sh
. tests/common.sh
environment=$target/velocities
if [ ! -x "$environment/bin/python" ]; then python3 -m venv "$environment"; fi
"$environment/bin/python" -m pip install --quiet --disable-pip-version-check asdf h5py -r python/tests/requirements-handover.txt
"$environment/bin/python" tests/export/velocities.py "$particlegs" "$target/velocities-files"
