#!/usr/bin/env bash
# Makes particlegs-VERSION-ARCH.sif, a container for Apptainer, of the static binary (scripts/static-binary.sh, where it is
# not made yet), by packaging/particlegs.def; runs the tests in it, and the command once on the bundled sample.
# Usage: scripts/apptainer.sh [FOLDER [BOOTSTRAP BASE]]
#   FOLDER     where the binary is and the container is put (default: dist)
#   BOOTSTRAP BASE  what it stands on (default: docker debian:bookworm-slim), such as `localimage base.sif` where no
#                   registry can be reached
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

folder=${1:-dist}
command -v apptainer >/dev/null || {
    echo 'apptainer is not installed: https://apptainer.org/docs/admin/main/installation.html' >&2
    exit 1
}
newest() { find "$folder" -maxdepth 1 -name "particlegs-*-$(uname -m)-linux" -printf '%T@ %p\n' 2>/dev/null | sort -n | tail -n 1 | cut -d ' ' -f 2-; }
binary=$(newest)
if [ -z "$binary" ]; then
    scripts/static-binary.sh "$folder"
    binary=$(newest)
fi
version=$("$binary" --version)
sif=$folder/particlegs-${version##* }-$(uname -m).sif

arguments=(--build-arg "binary=$binary" --build-arg "version=${version##* }")
if [ $# -ge 3 ]; then arguments+=(--build-arg "bootstrap=$2" --build-arg "base=$3"); fi
# The tests run at the end of the build, too.
apptainer build --force "${arguments[@]}" "$sif" packaging/particlegs.def
apptainer test "$sif"

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
apptainer run --bind "$work" "$sif" compress samples/nbody64 -o "$work/inside.pgs" --effort fast --quiet >/dev/null
"$binary" compress samples/nbody64 -o "$work/outside.pgs" --effort fast --quiet >/dev/null
cmp "$work/inside.pgs" "$work/outside.pgs"
(cd "$folder" && sha256sum "${sif##*/}" >"${sif##*/}.sha256")
echo "$sif: $(stat -c %s "$sif") bytes; in it, the sample's model has the same bytes as outside"
