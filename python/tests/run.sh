#!/usr/bin/env bash
# The Python package: built, installed into an environment of its own, checked, and held to the command.
set -euo pipefail
cd "$(dirname "$0")/../.."
# shellcheck source=tests/common.sh
. tests/common.sh

environment=$target/python
if [ ! -x "$environment/bin/python" ]; then "$python" -m venv "$environment"; fi
pip=("$environment/bin/python" -m pip install --quiet --disable-pip-version-check)
"${pip[@]}" -r python/tests/requirements.txt

cd python
cargo fmt --check
# One build for both: what the linter has checked is not checked again for the wheel.
export CARGO_TARGET_DIR=$target/python-native
"$environment/bin/maturin" build --quiet --locked --release --out "$environment/wheels" --interpreter "$environment/bin/python"
"${pip[@]}" --force-reinstall --no-deps "$environment"/wheels/*.whl
"$environment/bin/ruff" check .
"$environment/bin/ruff" format --check .
# The package that is installed, not the sources beside it.
cd tests
PARTICLEGS=$particlegs "$environment/bin/python" -m pytest -q -p no:cacheprovider .
