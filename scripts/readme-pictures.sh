#!/usr/bin/env bash
# The pictures of the README and the guide, made of the bundled sample: docs/images/{sample,density}.png, turn.gif and,
# where Chromium is and `npm ci` was done in web/, page-*.png; in 256 colours each, by ffmpeg.
# Usage: scripts/readme-pictures.sh [PARTICLEGS]
set -euo pipefail
cd "$(dirname "$0")/.."
p=${1:-target/release/particlegs}
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
"$p" compress samples/nbody64 -o "$out/nbody64.pgs" --pictures "$out" --certificate none --quiet >/dev/null
cp "$out/comparison.png" docs/images/sample.png
cp "$out/density.png" docs/images/density.png
"$p" render "$out/nbody64.pgs" --turntable 36 --elevation 20 --fit box --axes cube --opacity 0.15 \
    --size 320x240 --video docs/images/turn.gif --fps 12 --quiet >/dev/null
PARTICLEGS=$p node tests/browser/screenshots.mjs docs/images
for name in sample density page-density page-split; do
    ffmpeg -v error -y -i "docs/images/$name.png" \
        -vf 'split[a][b];[a]palettegen=256:reserve_transparent=0[p];[b][p]paletteuse=dither=none' "$out/$name.png"
    mv "$out/$name.png" "docs/images/$name.png"
done
ls -l docs/images/{sample,density,page-density,page-split}.png docs/images/turn.gif
