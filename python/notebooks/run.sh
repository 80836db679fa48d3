#!/usr/bin/env bash
# Executes the notebooks and writes them as HTML pages to $1 (a temporary folder by default). The notebooks themselves
# stay without outputs. $PYTHON must have the package and tests/requirements.txt.
set -euo pipefail
cd "$(dirname "$0")"
python=${PYTHON:-python3}
out=${1:-$(mktemp -d)}
mkdir -p "$out"
out=$(cd "$out" && pwd)

# Pages without network access: they have no formulas or widgets.
nothing='data:text/javascript,//'
offline=("--HTMLExporter.require_js_url=$nothing" "--HTMLExporter.mathjax_url=$nothing")

for notebook in *.ipynb; do
    "$python" - "$notebook" <<'CHECK'
import json, sys
cells = json.load(open(sys.argv[1], encoding="utf-8"))["cells"]
if any(c.get("outputs") or c.get("execution_count") for c in cells):
    sys.exit(f"{sys.argv[1]} has outputs; remove them: jupyter nbconvert --clear-output --inplace {sys.argv[1]}")
CHECK
    start=$SECONDS
    "$python" -m jupyter nbconvert --log-level WARN --to html --execute --embed-images \
        "${offline[@]}" \
        --ExecutePreprocessor.timeout=300 --output-dir "$out" "$notebook"
    echo "$notebook: $((SECONDS - start)) s"
done
echo "pages: $out"
