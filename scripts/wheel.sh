#!/usr/bin/env bash
# Makes the wheel of the package `particlegs` for Linux: the extension and, as its script, the command itself (no Python
# starts for it), both linked by zig against a glibc of 2012, so that any manylinux2014 system takes them. Says what it
# weighs, holds it to its bounds and its tags, and tries it in fresh environments (try-wheel.sh).
# Usage: scripts/wheel.sh [FOLDER [TARGET]]
#   FOLDER  where to put it (default: dist)
#   TARGET  default: this machine's, such as x86_64-unknown-linux-gnu; another machine's wheel is made and not tried
# maturin, zig and auditwheel come from PyPI into target/.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

# shellcheck source=scripts/handed-out.sh
. scripts/handed-out.sh

folder=${1:-dist}
target=${2:-$machine-unknown-linux-gnu}
mkdir -p "$folder"
folder=$(cd "$folder" && pwd)
tools=$built/wheel-tools
wanted='maturin==1.16.0 ziglang==0.17.1 cargo-zigbuild==0.24.0 auditwheel==6.8.2 abi3audit==0.0.26 zopflipy==1.14'
if [ "$(cat "$tools/installed" 2>/dev/null)" != "$wanted" ]; then
    rm -rf "$tools"
    python3 -m venv "$tools"
    # shellcheck disable=SC2086
    "$tools/bin/python" -m pip install --quiet --disable-pip-version-check $wanted
    echo "$wanted" >"$tools/installed"
fi
PATH=$tools/bin:$PATH

# shellcheck disable=SC2119
compile_with
cargo zigbuild --profile dist --locked --target "$target.2.17" --package particlegs-cli --bin particlegs \
    --features gpu

# The command lies where maturin looks for what a wheel has beside its package, for as long as that takes.
beside=python/particlegs._particlegs.data
work=$(mktemp -d)
trap 'rm -rf "$beside" "$work"' EXIT
rm -rf "$beside"
mkdir -p "$beside/scripts"
cp "$built/$target/dist/particlegs" "$beside/scripts/particlegs"
# Smaller than by the profile's own, for twice its time.
export CARGO_PROFILE_RELEASE_LTO=fat
(cd python && maturin build --release --locked --zig --target "$target" --compatibility manylinux2014 --out "$work")

made=$(echo "$work"/*.whl)
python scripts/pack-wheel.py "$made" "$work/packed"
# Of everything in it, the command too, where maturin looks at the extension alone.
auditwheel show "$work/packed"/*.whl | tee "$work/audited"
tr '\n' ' ' <"$work/audited" | grep -q "platform tag: \"manylinux_2_17_${target%%-*}\"" || {
    echo 'the wheel needs a newer system than manylinux2014' >&2
    exit 1
}
abi3audit --strict "$work/packed"/*.whl
wheel=$folder/${made##*/}
mv "$work/packed/${made##*/}" "$wheel"
echo "$wheel"
if [ "${target%%-*}" = "$machine" ]; then
    scripts/try-wheel.sh "$wheel"
else
    echo "not tried: this machine is $machine" >&2
fi
