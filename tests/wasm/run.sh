#!/usr/bin/env bash
# particlegs-core under WebAssembly: the fixture models are decoded and drawn by Node, bit for bit the pictures of
# the native path without vector instructions and without threads.
set -euo pipefail
cd "$(dirname "$0")/../.."

if ! rustup target list --installed | grep -qx wasm32-unknown-unknown; then
    rustup target add wasm32-unknown-unknown
fi
# shellcheck source=tests/packages.sh
. tests/packages.sh
command -v node >/dev/null || packages nodejs

if cargo tree --manifest-path tests/wasm/Cargo.toml --locked --edges normal --prefix none | grep '^rayon'; then
    echo 'particlegs-core without its feature `threads` brings rayon' >&2
    exit 1
fi

target=target/wasm
build() { cargo build --quiet --release --locked --manifest-path tests/wasm/Cargo.toml --target-dir "$target" "$@"; }
build --lib --target wasm32-unknown-unknown
build --bin particlegs-wasm-test

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
for model in crates/particlegs-compress/tests/fixtures/format-1.*.pgs; do
    "$target/release/particlegs-wasm-test" "$model" "$work/pictures"
    node tests/wasm/draw.mjs "$target/wasm32-unknown-unknown/release/particlegs_wasm_test.wasm" "$model" "$work/pictures"
done
