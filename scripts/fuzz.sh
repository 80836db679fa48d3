#!/usr/bin/env bash
# Fuzzes each target of fuzz/ for some seconds: scripts/fuzz.sh [SECONDS] [TARGET...]
# Needs a nightly toolchain and `cargo install cargo-fuzz`. An input that crashes a target is left in fuzz/artifacts.
set -euo pipefail
cd "$(dirname "$0")/../fuzz"
seconds=${1:-60}
shift || true
targets=("$@")
if [ ${#targets[@]} = 0 ]; then mapfile -t targets < <(cargo +nightly fuzz list); fi
failed=()
for target in "${targets[@]}"; do
    echo "== $target"
    # 2 GiB: no reader may take more for an input of 64 KiB.
    cargo +nightly fuzz run "$target" -- -max_total_time="$seconds" -rss_limit_mb=2048 -max_len=65536 || failed+=("$target")
done
if [ ${#failed[@]} != 0 ]; then
    echo "error: ${failed[*]} failed; fuzz/artifacts has the inputs" >&2
    exit 1
fi
