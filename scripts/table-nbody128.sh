#!/usr/bin/env bash
# Every figure of docs/results/nbody128.md: reference renderer against VTK, models at two efforts
# and six ratios against VTK, with the time and size of each.
#   scripts/table-nbody128.sh DATA_DIR REFERENCE_DIR OUT_DIR
# DATA_DIR holds xx.f32 yy.f32 zz.f32; REFERENCE_DIR views.json, paraview/ and paraview-no-fxaa/.
set -euo pipefail
data=$1 reference=$2 out=$3
p=${PARTICLEGS:-target/release/particlegs}
mkdir -p "$out"

for style in paraview paraview-no-fxaa response response-fxaa; do
  "$p" reference "$data" --views "$reference/views.json" --style "$style" --out "$out/reference-$style" --quiet >/dev/null
done
for pair in paraview:paraview paraview-no-fxaa:paraview-no-fxaa response:paraview-no-fxaa response-fxaa:paraview; do
  "$p" compare "$out/reference-${pair%%:*}" "$reference/${pair##*:}" --json "$out/reference-${pair%%:*}.json" >/dev/null
done

model() { # NAME, then compress's options
  local name=$1; shift
  "$p" compress "$data" -o "$out/$name.pgs" --force --certificate none --json "$out/$name-compress.json" --quiet "$@" >/dev/null
  for style in paraview paraview-no-fxaa; do
    "$p" render "$out/$name.pgs" --views "$reference/views.json" --style "$style" --out "$out/$name-$style" --quiet >/dev/null
    "$p" compare "$out/$name-$style" "$reference/$style" --json "$out/$name-$style.json" >/dev/null
  done
}
for effort in fast default; do model "300-$effort" --ratio 300 --effort "$effort"; done
for ratio in 30 65 100 1000 3000; do model "$ratio-default" --ratio "$ratio"; done

python3 "$(dirname "$0")/table-nbody128.py" "$out"
