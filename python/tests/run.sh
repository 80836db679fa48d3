#!/usr/bin/env bash
# Builds the Python package into its own environment and runs all checks (check.sh), with the packages of
# conversions, and the tests of the ParaView plug-in under plain VTK.
set -euo pipefail
cd "$(dirname "$0")/../.."
# shellcheck source=tests/common.sh
. tests/common.sh

environment=$target/python
if [ ! -x "$environment/bin/python" ]; then "$python" -m venv "$environment"; fi
pip=("$environment/bin/python" -m pip install --quiet --disable-pip-version-check)
"${pip[@]}" maturin==1.16.0 h5py vtk -r python/tests/requirements.txt -r python/tests/requirements-handover.txt

cd python
cargo fmt --check
export CARGO_TARGET_DIR=$target
cargo clippy --quiet --locked -- -D warnings
# As tests are compiled; scripts/wheel.sh tries it as it is handed out.
VIRTUAL_ENV=$environment "$environment/bin/maturin" develop --quiet --locked

export PYTHON=$environment/bin/python PARTICLEGS=$particlegs
./check.sh
"$PYTHON" -m pytest -q paraview_plugin/tests
