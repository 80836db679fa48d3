#!/usr/bin/env bash
# Executes the notebooks and writes them as pages to $1 (a temporary folder by default); the notebooks in the tree stay
# as they are, without outputs. $PYTHON has the package and tests/requirements.txt.
set -euo pipefail
cd "$(dirname "$0")"
python=${PYTHON:-python3}
out=${1:-$(mktemp -d)}
mkdir -p "$out"
out=$(cd "$out" && pwd)

# Pages that ask nothing of the network: there are no formulas in them, and no widgets.
nothing='data:text/javascript,//'
offline=("--HTMLExporter.require_js_url=$nothing" "--HTMLExporter.mathjax_url=$nothing")

for notebook in *.ipynb; do
    "$python" - "$notebook" <<'CHECK'
import json, sys
cells = json.load(open(sys.argv[1], encoding="utf-8"))["cells"]
if any(c.get("outputs") or c.get("execution_count") for c in cells):
    sys.exit(f"{sys.argv[1]} is committed with outputs: jupyter nbconvert --clear-output --inplace {sys.argv[1]}")
CHECK
    start=$SECONDS
    "$python" -m jupyter nbconvert --log-level WARN --to html --execute --embed-images \
        "${offline[@]}" \
        --ExecutePreprocessor.timeout=300 --output-dir "$out" "$notebook"
    echo "$notebook: $((SECONDS - start)) s"
done
echo "pages: $out"
