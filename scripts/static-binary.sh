#!/usr/bin/env bash
# Makes the command as one file that needs nothing of the system that it runs on: particlegs-VERSION-ARCH-linux, stripped,
# its SHA-256 beside it. Holds it to that: nothing dynamic in it, and tried in an empty root directory (try-binary.sh).
# Usage: scripts/static-binary.sh [FOLDER [TARGET]]
#   FOLDER  where to put it (default: dist)
#   TARGET  default: this machine's musl where `rustup target add` has it, else its gnu with glibc linked in.
#           Another machine's goes through cargo-zigbuild (`pip install cargo-zigbuild ziglang`), such as
#           aarch64-unknown-linux-musl; it is tried where qemu-ARCH-static is (Debian: qemu-user-static).
# The same sources, toolchain and target give the same bytes, wherever the sources lie.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

# shellcheck source=scripts/handed-out.sh
. scripts/handed-out.sh

folder=${1:-dist}
installed() { rustup target list --installed 2>/dev/null | grep -qx "$1"; }
target=${2:-$machine-unknown-linux-musl}
if [ -z "${2:-}" ] && ! installed "$target"; then target=$machine-unknown-linux-gnu; fi
architecture=${target%%-*}
build=build
if [ "$architecture" != "$machine" ]; then build=zigbuild; fi

# Random numbers by the system call: a static glibc does not find its function by name, a static musl has lost it where
# only the standard library's weak wish for it is left after all units became one, and there may be no /dev.
compile_with -C target-feature=+crt-static --cfg 'getrandom_backend="linux_raw"'
# Not with `gpu`: a static program cannot load the driver of a GPU.
cargo "$build" --profile dist --locked --target "$target" --package particlegs-cli --bin particlegs

binary=$built/$target/dist/particlegs
if readelf --wide --program-headers --dynamic "$binary" | grep -E 'INTERP|NEEDED'; then
    echo "$binary is not static" >&2
    exit 1
fi
if readelf --wide --sections "$binary" | grep -E '\.symtab|\.debug'; then
    echo "$binary is not stripped" >&2
    exit 1
fi
if [ "$architecture" = "$machine" ]; then
    scripts/try-binary.sh "$binary"
elif emulator=$(command -v "qemu-$architecture-static"); then
    scripts/try-binary.sh "$binary" "$emulator"
else
    echo "not tried: this machine is $machine, and has no qemu-$architecture-static" >&2
fi

version=$(cargo pkgid --locked --package particlegs-cli)
name=particlegs-${version##*[#@]}-$architecture-linux
mkdir -p "$folder"
cp "$binary" "$folder/$name"
(cd "$folder" && sha256sum "$name" | tee "$name.sha256")
echo "$folder/$name: $target, $(stat -c %s "$folder/$name") bytes, nothing dynamic"
