#!/usr/bin/env bash
# Model files read by tests/decoder/pgs.py, which knows docs/format.md alone, and by the program: the same bits.
set -euo pipefail
cd "$(dirname "$0")/../.."
# shellcheck source=tests/common.sh
. tests/common.sh
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

compress() { "$particlegs" compress "$@" --certificate none --quiet >/dev/null; }
compress samples/nbody64 -o "$work/sample.pgs" --ratio 300
# All that a certificate can hold.
"$particlegs" compress samples/nbody64 -o "$work/full.pgs" --effort fast --min-correlation 0.99 --cell 1 --certificate full \
    --quiet >/dev/null
compress samples/nbody64 -o "$work/blocks.pgs" --effort fast --ratio 100 --blocks 3
# More than 65536 Gaussians: a trunk and segments.
compress samples/nbody64 -o "$work/segments.pgs" --effort fast --gaussians 70000
# Layers, and particles with weights of their own.
compress crates/particlegs-formats/tests/fixtures/species.hdf5 -o "$work/layers.pgs" --gaussians 20
# P(k) by mass, of layers; a certificate that is added up of parts.
"$particlegs" compress crates/particlegs-formats/tests/fixtures/species.hdf5 -o "$work/masses.pgs" --gaussians 20 \
    --certificate quick --quiet >/dev/null
"$particlegs" compress samples/nbody64 -o "$work/parts.pgs" --effort fast --certificate blocks --quiet >/dev/null
compress samples/nbody64 -o "$work/alpha.pgs" --train fast --law alpha-blend --config tests/rasteriser/tiny.toml \
    --effort fast --size 20kB
# Fields: a vector, a scalar, and one that never changes; particles with weights; blocks.
"$python" - samples/nbody64 "$work/flow" <<'END'
import sys
from pathlib import Path
import numpy as np
source, folder = map(Path, sys.argv[1:])
folder.mkdir()
place = [np.fromfile(source / f"{axis}{axis}.f32", "<f4")[::50] for axis in "xyz"]
noise = np.random.default_rng(1).normal(size=(4, len(place[0])))
columns = dict(zip(["xx", "yy", "zz"], place), ww=1 + np.arange(len(place[0])) % 3, still=np.full(len(place[0]), 2.5))
columns |= {f"v{axis}": 100 * np.sin(place[k - 1] / 3) + 30 * noise[k] for k, axis in enumerate("xyz")}
columns["temperature"] = np.exp(8 + np.cos(place[0] / 4) + 0.9 * noise[3])
for name, column in columns.items():
    column.astype("<f4").tofile(folder / f"{name}.f32")
END
compress "$work/flow" -o "$work/fields.pgs" --effort fast --gaussians 300 --blocks 2 --fields all
# Types that share Gaussians; a category of three values.
"$python" - "$work" <<'END'
import json
import sys
from pathlib import Path
import numpy as np
work, random = Path(sys.argv[1]), np.random.default_rng(2)
place = (random.random((300, 3))[np.arange(9000) % 300] * 10 + 0.2 * random.normal(size=(9000, 3))).astype("<f4")
kinds = np.sort(np.arange(9000) % 7 // 3)
(work / "kinds").mkdir()
for k, axis in enumerate("xyz"):
    place[:, k].tofile(work / "kinds" / f"{axis}{axis}.f32")
layers = [{"name": f"k{k}", "particles": int((kinds == k).sum()), "particle_mass": k + 1.5} for k in range(3)]
(work / "kinds/meta.json").write_text(json.dumps({"layers": layers}))
states = (place[:, 0] // 4 + 2 * (random.random(9000) < 0.1)).astype(int)
rows = "".join(f"{x} {y} {z}\n" for x, y, z in place.tolist())
(work / "states.vtk").write_text("# vtk DataFile Version 3.0\nstates\nASCII\nDATASET POLYDATA\nPOINTS 9000 float\n" + rows
    + "POINT_DATA 9000\nSCALARS state int 1\nLOOKUP_TABLE default\n" + "\n".join(map(str, states)) + "\n")
END
compress "$work/kinds" -o "$work/shared.pgs" --share-gaussians yes --ratio 60
compress "$work/kinds" -o "$work/shared-blocks.pgs" --share-gaussians yes --ratio 60 --blocks 2
compress "$work/states.vtk" -o "$work/states.pgs" --gaussians 200 --fields state
# Series: Gaussians that move, stay and are born; weights, layers and fields; a cell that grows and leans.
"$python" tests/decoder/frames.py "$work"
"$particlegs" series "$work"/moving-? -o "$work/series.pgs" --gaussians 150 --certificate none --quiet >/dev/null
"$particlegs" series "$work"/weights-? -o "$work/series-weights.pgs" --gaussians 60 --certificate none \
    --fields all --quiet >/dev/null
"$particlegs" series "$work"/weights-? -o "$work/series-blocks.pgs" --gaussians 100 --certificate none \
    --fields all --blocks 2 --quiet >/dev/null
"$particlegs" series "$work"/leaning.dump --frames 0:5 -o "$work/series-leaning.pgs" --gaussians 80 --certificate quick \
    --quiet >/dev/null
# Open files that end early: stages, blocks and layers are missing.
for name in alpha blocks fields layers segments shared-blocks; do
    "$python" tests/decoder/pgs.py --cut "$work/$name" "$work/$name.pgs"
done

passed=0 failed=0
for model in crates/particlegs-compress/tests/fixtures/format-1.*.pgs "$work"/*.pgs; do
    "$decoded_bits" "$model" >"$work/ours"
    "$python" tests/decoder/pgs.py "$model" >"$work/theirs"
    if cmp -s "$work/ours" "$work/theirs"; then
        echo "$(basename "$model"): the same bits, $(wc -l <"$work/ours") lines"
        passed=$((passed + 1))
    else
        echo "$(basename "$model"): the program (<) and the page (>) differ:"
        diff "$work/ours" "$work/theirs" | cut -c1-200 | head -4 || true
        failed=$((failed + 1))
    fi
done
echo "$passed passed, $failed failed"
[ "$failed" = 0 ]
