# shellcheck shell=bash disable=SC2034
# What the engines' tests share; sourced.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
cd "$root"

# The program under test; cargo builds the default where it is missing.
program=${PARTICLEGS:-$root/target/debug/particlegs}
[ -x "$program" ] || cargo build --locked -p particlegs-cli
work=$(mktemp -d)
job="$work/a job"
# The sample, each particle four times, as eight layers: a block has eight fits of its own, and a checkpoint after each.
# Long enough to be caught at work, short enough for a test.
data="$root/target/engines/data"
mkdir -p "$data"
for axis in xx yy zz; do cat "samples/nbody64/$axis.f32"{,,,} >"$data/$axis.f32"; done
layers=$(for name in a b c d e f g h; do printf '{"name": "%s", "particles": 131072}\n' "$name"; done | paste -sd,)
echo "{\"box\": 25.0, \"periodic\": true, \"layers\": [$layers]}" >"$data/meta.json"
options=("$data" --blocks 6 --ratio 120 --seed 7 --certificate none)

fail() { echo "FAILED: $*" >&2; exit 1; }

# wait_for SECONDS WHAT COMMAND...: until the command succeeds.
wait_for() {
  local tries=$(($1 * 5)) what=$2
  shift 2
  for _ in $(seq "$tries"); do if "$@" >/dev/null 2>&1; then return; fi; sleep 0.2; done
  fail "waited in vain for $what"
}

# The process that works on a block of this test's own job folder; fails where there is none.
block_pid() {
  local pid words
  for pid in $(pgrep -x particlegs); do
    # It may end while it is looked at.
    mapfile -d '' -t words < <(cat "/proc/$pid/cmdline" 2>/dev/null)
    if is_block "$1" "${words[@]}"; then
      echo "$pid"
      return
    fi
  done
  return 1
}

# is_block I, then a command line: whether it is this job's block I.
is_block() {
  local i=$1
  shift
  while [ $# -gt 2 ]; do
    if [ "$1" = block ] && [ "$2" = "$job" ]; then [ "$((10#$3))" = "$i" ]; return; fi
    shift
  done
  return 1
}

# What one process makes of the same options: made once for all engines, anew for another program.
direct() {
  local key made
  key=$({ cat "$program"; printf '%s\n' "${options[@]}"; } | sha256sum | cut -c1-16)
  made="$root/target/engines/direct-$key.pgs"
  if [ ! -f "$made" ]; then
    rm -f "$root"/target/engines/direct-*.pgs
    "$program" compress "${options[@]}" -o "$made" --quiet >/dev/null
  fi
  echo "$made"
}

compare_with_direct() {
  cmp "$(direct)" "$1" || fail "the merged file differs from what one process makes"
  "$program" verify "$job" --quiet >/dev/null || fail "verify refuses the job folder"
}
