#!/usr/bin/env bash
# Everything that a change of the Python package passes: style, tests with types, notebooks, and their pages in real
# browsers. $PYTHON has the package and tests/requirements.txt; what is handed over is tested where
# tests/requirements-handover.txt is there, too, and the bytes against the command of $PARTICLEGS or target/.
set -euo pipefail
cd "$(dirname "$0")"
python=${PYTHON:-python3}

"$python" -m ruff check .
"$python" -m ruff format --check .
"$python" -m pytest -q tests
pages=$(mktemp -d)
trap 'rm -rf "$pages"' EXIT
PYTHON=$python notebooks/run.sh "$pages"
# The browsers and their drivers come with tests/browser/run.sh.
if command -v node chromium firefox-esr >/dev/null && [ -d ../web/node_modules ]; then
    NOTEBOOKS=$pages node --test ../tests/browser/notebook.test.mjs
else
    echo "no browsers here: the pages were not opened (tests/browser/run.sh)"
fi
