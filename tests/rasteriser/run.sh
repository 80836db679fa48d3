#!/usr/bin/env bash
# Pictures of alpha-blend models by the program and by tests/rasteriser/splats.py, written from the published
# equations: at least 60 dB in every view.
set -euo pipefail
cd "$(dirname "$0")/../.."
# shellcheck source=tests/common.sh
. tests/common.sh
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

"$particlegs" compress samples/nbody64 -o "$work/trained.pgs" --train fast --law alpha-blend \
    --config tests/rasteriser/tiny.toml --effort fast --size 20kB --certificate none --quiet >/dev/null

passed=0 failed=0
for model in crates/particlegs-compress/tests/fixtures/format-1.0-alpha.pgs "$work/trained.pgs"; do
    echo "$(basename "$model"):"
    "$python" tests/rasteriser/splats.py views "$model" "$work/views.json"
    rm -rf "$work/pictures"
    "$particlegs" render "$model" --views "$work/views.json" --style expected --out "$work/pictures" --quiet >/dev/null
    if "$python" tests/rasteriser/splats.py compare "$model" "$work/views.json" "$work/pictures"; then
        passed=$((passed + 1))
    else
        failed=$((failed + 1))
    fi
done
echo "$passed passed, $failed failed"
[ "$failed" = 0 ]
