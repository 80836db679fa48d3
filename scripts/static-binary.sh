#!/usr/bin/env bash
# Makes the command as one file that needs nothing of the system that it runs on: particlegs-VERSION-ARCH-linux, stripped,
# its SHA-256 beside it. Holds it to that: nothing dynamic in it, and tried in an empty root directory (try-binary.sh).
# Usage: scripts/static-binary.sh [FOLDER [TARGET]]
#   FOLDER  where to put it (default: dist)
#   TARGET  default: this machine's musl where `rustup target add` has it, else its gnu with glibc linked in.
#           Another machine's goes through cargo-zigbuild (`pip install cargo-zigbuild ziglang`), such as
#           aarch64-unknown-linux-musl.
# The same sources, toolchain and target give the same bytes, wherever the sources lie.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

folder=${1:-dist}
machine=$(uname -m)
installed() { rustup target list --installed 2>/dev/null | grep -qx "$1"; }
target=${2:-$machine-unknown-linux-musl}
if [ -z "${2:-}" ] && ! installed "$target"; then target=$machine-unknown-linux-gnu; fi
architecture=${target%%-*}

# glibc's static getrandom is not found by name, which is how the crate looks for it; without /dev there is no other.
flags=(-C target-feature=+crt-static -C strip=symbols --cfg 'getrandom_backend="linux_getrandom"')
# Where sources lie is no part of what they make.
flags+=("--remap-path-prefix=$PWD=." "--remap-path-prefix=${CARGO_HOME:-$HOME/.cargo}=cargo"
    "--remap-path-prefix=$(rustc --print sysroot)=rust")
separator=$'\x1f'
encoded=$(printf "%s$separator" "${flags[@]}")
export CARGO_ENCODED_RUSTFLAGS=${encoded%"$separator"} CARGO_INCREMENTAL=0
build=build
if [ "$architecture" != "$machine" ]; then build=zigbuild; fi
cargo "$build" --profile dist --locked --target "$target" --package particlegs-cli --bin particlegs

version=$(cargo pkgid --locked --package particlegs-cli)
name=particlegs-${version##*[#@]}-$architecture-linux
built=$(cargo metadata --format-version 1 --no-deps --locked | sed 's/.*"target_directory":"\([^"]*\)".*/\1/')
mkdir -p "$folder"
cp "$built/$target/dist/particlegs" "$folder/$name"
(cd "$folder" && sha256sum "$name" >"$name.sha256")
readelf --wide --program-headers --dynamic "$folder/$name" >"$built/headers"
if grep -E 'INTERP|NEEDED' "$built/headers"; then
    echo "$folder/$name is not static" >&2
    exit 1
fi
if readelf --wide --sections "$folder/$name" | grep -E '\.symtab|\.debug'; then
    echo "$folder/$name is not stripped" >&2
    exit 1
fi
echo "$folder/$name: $target, $(stat -c %s "$folder/$name") bytes, nothing dynamic"
cat "$folder/$name.sha256"
if [ "$architecture" = "$machine" ]; then
    scripts/try-binary.sh "$folder/$name"
else
    echo "not tried: this machine is $machine" >&2
fi
