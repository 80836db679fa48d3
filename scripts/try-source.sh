#!/usr/bin/env bash
# Tries a source archive (source-archive.sh): unpacked away from the tree, with the toolchain and an empty home, cargo kept
# from every network, the command is installed from it as the recipes in packaging/ do, and compresses the sample. The
# Python package's crates are looked up only: maturin, which builds it, is none of them.
# Usage: scripts/try-source.sh ARCHIVE
set -euo pipefail
archive=$(realpath "${1:?usage: scripts/try-source.sh ARCHIVE}")

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
tar xJ -C "$work" -f "$archive"
cd "$work"/particlegs-*-source
bare=(env -i "PATH=$PATH" "HOME=$work" "CARGO_HOME=$work/cargo" "RUSTUP_HOME=${RUSTUP_HOME:-$HOME/.rustup}" CARGO_NET_OFFLINE=true)

(cd python && "${bare[@]}" cargo metadata --locked --format-version 1 >/dev/null)
"${bare[@]}" cargo install --quiet --locked --no-track --profile dist --features gpu --path crates/particlegs-cli --root "$work/out"
"$work/out/bin/particlegs" compress samples/nbody64 -o "$work/sample.pgs" --effort fast --quiet >/dev/null
echo "$("$work/out/bin/particlegs" --version), from ${archive##*/} without a network"
echo "the sample at --effort fast: $(sha256sum <"$work/sample.pgs" | cut -d ' ' -f 1)"
