#!/usr/bin/env bash
# Checks the Python package: style, tests with types, notebooks, and their pages in browsers. $PYTHON must have the
# package and tests/requirements.txt. Conversions are tested if tests/requirements-handover.txt is installed too, and
# files are compared with those of the command ($PARTICLEGS or in target/).
set -euo pipefail
cd "$(dirname "$0")"
python=${PYTHON:-python3}

"$python" -m ruff check .
"$python" -m ruff format --check .
"$python" -m pytest -q tests
pages=$(mktemp -d)
trap 'rm -rf "$pages"' EXIT
PYTHON=$python notebooks/run.sh "$pages"
# tests/browser/install.sh installs the browsers and their drivers.
if command -v node chromium firefox-esr >/dev/null && [ -d ../web/node_modules ]; then
    NOTEBOOKS=$pages node --test ../tests/browser/notebook.test.mjs
else
    echo "no browsers found, so the pages were not opened: run tests/browser/install.sh first"
fi
