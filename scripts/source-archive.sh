#!/usr/bin/env bash
# Makes particlegs-VERSION-source.tar.xz, its SHA-256 beside it: HEAD's files, and in vendor/ every crate that the command
# and the Python package are built from on any system, so that cargo needs no network. Tries it (try-source.sh).
# Usage: scripts/source-archive.sh [FOLDER]
#   FOLDER  where to put it (default: dist)
# The same commit gives the same bytes, by the same tar and xz.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

folder=${1:-dist}
version=$(cargo pkgid --locked --package particlegs-cli)
name=particlegs-${version##*[#@]}-source
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

git archive --prefix="$name/" HEAD | tar x -C "$work"
(
    cd "$work/$name"
    mkdir .cargo
    cargo vendor --quiet --locked --versioned-dirs --sync python/Cargo.toml vendor
    printf '[source.%s]\n%s\n' crates-io 'replace-with = "vendor"' vendor 'directory = "vendor"' >.cargo/config.toml
)
mkdir -p "$folder"
tar c -C "$work" --sort=name --owner=0 --group=0 --numeric-owner --mode=go=rX,u+rw \
    --mtime="@$(git log -1 --format=%ct)" "$name" | xz -T1 -6 >"$folder/$name.tar.xz"
scripts/try-source.sh "$folder/$name.tar.xz"
(cd "$folder" && sha256sum "$name.tar.xz" | tee "$name.tar.xz.sha256")
echo "$folder/$name.tar.xz: $(stat -c %s "$folder/$name.tar.xz") bytes"
