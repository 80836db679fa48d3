#!/usr/bin/env bash
# Tests the plug-in in Debian's ParaView 5.11, without a screen and with software GL: installs ParaView, runs
# tests/in_paraview.py, and draws the four pictures of figure.py.
#
#     test.sh WHEEL [FOLDER]     the package's wheel; folder for pictures [default: target/paraview]
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
wheel=$(realpath "${1:?the wheel of particlegs: maturin build makes one in python/target/wheels}")
out=$(realpath -m "${2:-$root/target/paraview}")

if ! command -v pvbatch xvfb-run >/dev/null; then
    SECONDS=0
    export DEBIAN_FRONTEND=noninteractive
    as_root=$([ "$(id -u)" = 0 ] || echo sudo)
    $as_root apt-get update -q
    $as_root apt-get install -y -q --no-install-recommends \
        paraview python3-paraview python3-pip xvfb xauth libgl1-mesa-dri
    echo "installed ParaView in $SECONDS s"
fi

mkdir -p "$out"
# Debian's ParaView runs Debian's Python, with Debian's NumPy.
/usr/bin/python3 -m pip install -q --no-deps --upgrade --target "$out/packages" "$wheel"

# -noreset: otherwise Xvfb restarts when ParaView closes its first connection.
paraview() {
    LIBGL_ALWAYS_SOFTWARE=1 xvfb-run -a -s "-screen 0 2400x1600x24 -noreset" pvbatch "$@"
}

echo "loaded as a script"
PYTHONPATH="$out/packages" paraview "$here/tests/in_paraview.py" "$root/samples/nbody64" "$out/checks"
echo "loaded by the plug-in manager"
PYTHONPATH="$out/packages:$here" paraview "$here/tests/in_paraview.py" "$root/samples/nbody64" "$out/checks"
echo "the figure"
PYTHONPATH="$out/packages" paraview "$here/figure.py" "$out/checks/sample.pgs" \
    --snapshot "$out/checks/truth.vtp" -o "$out"
for picture in ellipsoids recovered density compared; do
    [ -s "$out/$picture.png" ]
done
