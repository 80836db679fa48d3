#!/usr/bin/env bash
# Compiles the crates for macOS and Windows as far as this machine can: `cargo check`, nothing linked and nothing run.
# Usage: scripts/other-systems.sh [TARGET...]
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

if [ $# = 0 ]; then set -- aarch64-apple-darwin x86_64-pc-windows-msvc; fi
rustup target add "$@"
for target in "$@"; do
    cargo check --workspace --locked --features particlegs-cli/lab,particlegs-cli/gpu --target "$target"
done
