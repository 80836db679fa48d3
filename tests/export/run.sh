#!/usr/bin/env bash
# Exported models opened by others' readers, and their numbers held to the model: PLY by splat-transform, glTF by
# Khronos' validator and three.js, NPY and NPZ by NumPy, VTI by VTK, FITS by astropy, DX by GridDataFormats, MRC
# by mrcfile, CSV by Python's csv.
set -euo pipefail
cd "$(dirname "$0")/../.."
# shellcheck source=tests/common.sh
. tests/common.sh
# shellcheck source=tests/packages.sh
. tests/packages.sh

missing=()
# Node may be there with an npm of its own, beside which Debian's cannot be.
command -v npm >/dev/null || missing+=(nodejs npm)
command -v chromium >/dev/null || missing+=(chromium)
packages "${missing[@]}"
# By name, beside what cargo builds. The newest splat-transform wants a newer Node than Debian has.
readers=$target/export-readers
wanted='@playcanvas/splat-transform@2.7.1 gltf-validator@2.0.0-dev.3.10 three@0.187.0'
if [ "$(cat "$readers/installed" 2>/dev/null)" != "$wanted" ]; then
    mkdir -p "$readers"
    # shellcheck disable=SC2086
    npm install --prefix "$readers" --no-audit --no-fund --ignore-scripts --loglevel error $wanted
    echo "$wanted" >"$readers/installed"
fi
if ! "$python" -c 'import astropy, gridData, mrcfile, scipy, vtk' 2>/dev/null; then
    "$python" -m pip install --quiet --disable-pip-version-check astropy GridDataFormats mrcfile scipy vtk
fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# The sample; layers and masses without a unit; splats of the other law.
"$particlegs" compress samples/nbody64 -o "$work/sample.pgs" --effort fast --ratio 100 --certificate none --quiet >/dev/null
"$particlegs" compress crates/particlegs-formats/tests/fixtures/species.hdf5 -o "$work/layers.pgs" --gaussians 20 \
    --length-unit kpc --fields all --certificate none --quiet >/dev/null
"$particlegs" compress crates/particlegs-formats/tests/fixtures/mdanalysis.xtc -o "$work/molecules.pgs" --gaussians 20 \
    --certificate none --quiet >/dev/null
cp crates/particlegs-compress/tests/fixtures/format-1.0-alpha.pgs "$work/alpha.pgs"

# The newest Node resolves packages from where a script lies.
cp tests/export/gltf.mjs "$readers/gltf.mjs"
for model in sample layers molecules alpha; do
    "$particlegs" info "$work/$model.pgs" --json "$work/$model.info" >/dev/null
    kinds='ply glb gltf npz csv'
    if [ "$model" != alpha ]; then kinds+=' npy vti fits dx mrc'; fi
    for kind in $kinds; do
        more=''
        case $kind in
        npy | dx | mrc) more='--grid 40' ;;
        vti | fits)
            more='--grid 40'
            if [ "$model" = layers ]; then more+=' --fields all'; fi
            ;;
        ply | glb | gltf) if [ "$model" = layers ]; then more='--color layer'; fi ;;
        esac
        # shellcheck disable=SC2086
        "$particlegs" export "$work/$model.pgs" -o "$work/$model.$kind" $more --quiet >/dev/null
    done
    node "$readers/node_modules/@playcanvas/splat-transform/bin/cli.mjs" -q -w "$work/$model.ply" "$work/$model.ply.csv"
    node "$readers/gltf.mjs" "$work/$model.glb" "$work/$model.gltf"
    "$python" tests/export/check.py "$work/$model"
done
# In the viewer itself, for which way is up is no number of the file.
if [ ! -d web/node_modules ]; then (cd web && npm ci --silent --no-audit --no-fund); fi
PARTICLEGS=$particlegs node tests/export/axes.mjs "$readers/node_modules/@playcanvas/splat-transform/bin/cli.mjs" "$work"
