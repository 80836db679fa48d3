#!/usr/bin/env bash
# Builds the assets of the page in crates/particlegs-view/assets: the engine (crates/particlegs-web compiled to
# WebAssembly) and the bundled sources of this folder. With --check it builds in a temporary folder and compares: always
# scripts and style, the engine only if the same compiler built the committed one.
set -euo pipefail
cd "$(dirname "$0")/.."
root=$PWD
assets=crates/particlegs-view/assets
out=$assets
if [ "${1:-}" = --check ]; then
    out=$(mktemp -d)
    trap 'rm -rf "$out"' EXIT
fi

if ! rustup target list --installed | grep -qx wasm32-unknown-unknown; then
    rustup target add wasm32-unknown-unknown
fi
# Keeps paths of this machine out of the module.
cargo=${CARGO_HOME:-$HOME/.cargo}
flags="-C target-feature=+simd128 --remap-path-prefix $cargo=/cargo --remap-path-prefix $root=/particlegs"
RUSTFLAGS=$flags cargo build --quiet --locked -p particlegs-web --profile web --target wasm32-unknown-unknown \
    --target-dir target/web
engine=target/web/wasm32-unknown-unknown/web/particlegs_web.wasm

cd web
# Other stages may use what lies there: it is replaced only if another list of packages is wanted.
[ node_modules/.package-lock.json -nt package-lock.json ] || npm ci --silent --no-audit --no-fund
npx tsc --noEmit
if [ "$out" = "$assets" ]; then node build.mjs "../$out" "../$engine"; else node build.mjs "$out"; fi
cd ..

compiler=$(rustc --version)
if [ "$out" = "$assets" ]; then
    echo "$compiler" > "$assets/engine.txt"
    wc -c "$assets"/*
    exit
fi
for name in viewer.js{,.sha256} worker.js viewer.css{,.sha256}; do
    cmp "$out/$name" "$assets/$name" || { echo "$assets/$name is out of date: run web/build.sh and commit" >&2; exit 1; }
done
if [ "$compiler" = "$(cat "$assets/engine.txt")" ]; then
    cmp "$engine" <(gzip -dc "$assets/engine.wasm.gz") ||
        { echo "$assets/engine.wasm.gz is out of date: run web/build.sh and commit" >&2; exit 1; }
else
    echo "the committed engine was built by $(cat "$assets/engine.txt"), not $compiler: built, not compared"
fi
