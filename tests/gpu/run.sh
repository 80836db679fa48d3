#!/usr/bin/env bash
# Kernels against their twins, and the command with `--device`, on Mesa's software Vulkan where there is no card.
set -euo pipefail
cd "$(dirname "$0")/../.."

as_root=''
if [ "$(id -u)" != 0 ]; then as_root=sudo; fi
if ! ls /usr/share/vulkan/icd.d/*.json >/dev/null 2>&1; then
    $as_root apt-get update -qq
    $as_root apt-get install -y -qq --no-install-recommends mesa-vulkan-drivers
fi
export XDG_RUNTIME_DIR=${XDG_RUNTIME_DIR:-$(mktemp -d)}
# Without an adapter tests fail instead of being skipped.
export PARTICLEGS_GPU_TESTS=1
cargo test --locked -p particlegs-gpu
cargo test --locked -p particlegs-cli --features gpu,lab --test it gpu
