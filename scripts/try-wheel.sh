#!/usr/bin/env bash
# Tries a wheel in fresh environments: with the oldest NumPy that is served (1.24) and the newest that this Python has.
# Compresses the sample by the package and by the command that came with it, holds their bytes to each other, draws, and
# holds the time of the import to its bound.
# Usage: scripts/try-wheel.sh WHEEL [PYTHON...]
#   PYTHON  interpreters to try (default: those of python3.9 to python3.14 that run, else python3)
set -euo pipefail
wheel=$(realpath "${1:?usage: scripts/try-wheel.sh WHEEL [PYTHON...]}")
shift
cd "$(dirname "${BASH_SOURCE[0]}")/.."
here=$PWD

pythons=("$@")
if [ $# = 0 ]; then
    for minor in 9 10 11 12 13 14; do
        if "python3.$minor" -c 'import ensurepip, venv' 2>/dev/null; then pythons+=("python3.$minor"); fi
    done
    if [ ${#pythons[@]} = 0 ]; then pythons=(python3); fi
fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
for python in "${pythons[@]}"; do
    numpys='numpy'
    # 1.24 has wheels for Python 3.8 to 3.11.
    if "$python" -c 'import sys; sys.exit(sys.version_info >= (3, 12))'; then numpys+=' numpy==1.24.*'; fi
    for numpy in $numpys; do
        rm -rf "$work/env" "$work/away"
        "$python" -m venv "$work/env"
        "$work/env/bin/python" -m pip install --quiet --disable-pip-version-check --only-binary :all: "$numpy" "$wheel"
        # Away from the tree, whose folder python/ must not be what is imported, and without the tree's PATH.
        mkdir "$work/away"
        cp -r samples/nbody64 "$work/away/"
        (
            cd "$work/away"
            PATH=$work/env/bin:/usr/bin:/bin
            particlegs compress nbody64 -o command.pgs --effort fast --quiet >/dev/null
            [ "$(particlegs --version)" = "particlegs $(python -c 'import particlegs; print(particlegs.__version__)')" ]
            python "$here/scripts/try-wheel.py"
            # Any driver will do, as Mesa's software one: the command finds it at run time.
            if ls /usr/share/vulkan/icd.d/*.json >/dev/null 2>&1; then
                for device in 0 cpu; do
                    particlegs render command.pgs --size 160x90 --device $device --quiet -o $device >/dev/null
                done
                particlegs compare 0 cpu --json views.json
                python -c 'import json; assert all(v["largest_difference"] <= 1 for v in json.load(open("views.json"))["views"])'
            fi
            python "$here/scripts/import-time.py" --at-most 0.2
        )
    done
done
