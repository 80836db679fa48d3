#!/usr/bin/env bash
# Every figure of docs/results/recovery.md: models of nbody128 at six ratios and two efforts, the
# particles recovered from them, and the statistics of these and of the models themselves.
#   scripts/table-recovery.sh DATA_DIR OUT_DIR
# DATA_DIR holds xx.f32 yy.f32 zz.f32 and meta.json (nbody128). What OUT_DIR holds already is kept. Writes
# OUT_DIR/recovery.json and, from it, docs/results/recovery.md.
set -euo pipefail
data=$1 out=$2
here=$(dirname "$0")
p=${PARTICLEGS:-target/release/particlegs}
mkdir -p "$out"

measure() { # NAME OTHER, then stats's options
  local name=$1 other=$2; shift 2
  [ -s "$out/$name/stats.json" ] || "$p" stats "$data" "$other" -o "$out/$name" --grid 50 --quiet "$@" >/dev/null
}
recover() { # MODEL METHOD
  rm -rf "$out/particles"
  "$p" recover "$out/$1.pgs" -o "$out/particles" --method "$2" --quiet >/dev/null
}
model() { # RATIO EFFORT
  local name="$1-$2"
  [ -s "$out/$name.pgs" ] || "$p" compress "$data" -o "$out/$name.pgs" --ratio "$1" --effort "$2" --certificate none \
    --json "$out/$name.json" --quiet >/dev/null
  measure "$name-model" "$out/$name.pgs" --only density,spectrum --spectrum-grid 512 --no-plots
  if [ ! -s "$out/$name-count/stats.json" ]; then recover "$name" count; measure "$name-count" "$out/particles" --spectrum-grid 512; fi
  for method in spaced stratified; do
    [ -s "$out/$name-$method/stats.json" ] && continue
    recover "$name" "$method"
    measure "$name-$method" "$out/particles" --only density,groups,neighbours --no-plots
  done
  rm -rf "$out/particles"
}
for ratio in 30 65 100 300 1000 3000; do model $ratio default; done
for ratio in 65 300; do model $ratio fast; done

python3 "$here/table-recovery.py" "$out" "$here/../docs/results/recovery.md"
