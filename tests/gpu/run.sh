#!/usr/bin/env bash
# The kernels against the CPU's results, and the command with `--device`, on Mesa's software Vulkan where there is no GPU.
# Usage: tests/gpu/run.sh [slow]
#   slow  the tests that take long on a software GPU, instead of all others
set -euo pipefail
cd "$(dirname "$0")/../.."

# shellcheck source=tests/packages.sh
. tests/packages.sh
ls /usr/share/vulkan/icd.d/*.json >/dev/null 2>&1 || packages mesa-vulkan-drivers
export XDG_RUNTIME_DIR=${XDG_RUNTIME_DIR:-$(mktemp -d)}
those=(--skip slow_)
if [ "${1:-}" = slow ]; then those=(slow_); fi
# Chosen together, these packages are those of `cargo test --workspace --all-features`: nothing is compiled again.
tests=(cargo test --locked --all-features -p particlegs-gpu -p particlegs-lab -p particlegs-cli)
"${tests[@]}" --lib -- --ignored "${those[@]}"
"${tests[@]}" --test it gpu:: -- --ignored "${those[@]}"
