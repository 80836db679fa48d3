#!/usr/bin/env bash
# A job folder driven by Snakemake: a block told to stop and a block killed (both tried again), then
# Snakemake itself killed, run again, run once more with nothing to do; then compared with what one process
# makes, byte by byte. Fails where Snakemake is neither there (SNAKEMAKE, PATH) nor installable.
# shellcheck source=tests/engines/common.sh
. "$(dirname "$0")/common.sh"

snakemake=${SNAKEMAKE:-$(command -v snakemake || true)}
if [ -z "$snakemake" ]; then
  venv=target/engines/snakemake
  snakemake=$root/$venv/bin/snakemake
  if [ ! -x "$snakemake" ]; then
    if ! { python3 -m venv "$venv" && "$venv/bin/pip" install --quiet --disable-pip-version-check 'snakemake>=8'; } >&2; then
      rm -rf "$venv"
      fail "Snakemake cannot be installed here"
    fi
  fi
fi
main=''
# The blocks that a killed Snakemake leaves behind are this test's to end.
end_rest() {
  local i pid
  if [ -n "$main" ]; then kill -KILL "$main" 2>/dev/null || true; fi
  for i in 0 1 2 3 4 5; do if pid=$(block_pid "$i"); then kill -KILL "$pid" || true; fi; done
}
trap 'end_rest; rm -rf "$work"' EXIT

"$program" plan "${options[@]}" -o "$job" --emit snakemake --quiet >"$work/Snakefile"
sed -i -E 's/^(MINUTES, THREADS = .*), [0-9]+  #/\1, 1  #/' "$work/Snakefile"
run() { "$snakemake" --snakefile "$work/Snakefile" --directory "$work" --cores 2 --quiet all "$@"; }

echo "the first two blocks: one told to stop, one killed; then Snakemake killed"
run >"$work/first.log" 2>&1 &
main=$!
at_work() { for i in 0 1 2 3 4 5; do block_pid "$i" || true; done; }
two_at_work() { [ "$(at_work | wc -l)" -ge 2 ]; }
wait_for 120 "two blocks at work" two_at_work
sleep 0.5
mapfile -t pids < <(at_work)
kill -USR1 "${pids[0]}"
kill -KILL "${pids[1]}"
wait_for 60 "two blocks at work again" two_at_work
kill -KILL "$main"
wait "$main" 2>/dev/null || true
end_rest

echo "run again"
run --unlock >"$work/unlock.log" 2>&1
run --rerun-incomplete >"$work/second.log" 2>&1 || { tail -n 20 "$work/second.log" >&2; fail "the second run"; }
model=$(sed -n 's/^MODEL = "\(.*\)"$/\1/p' "$work/Snakefile")
[ -f "$model" ] || fail "no merged file"
compare_with_direct "$model"

echo "run once more: nothing to do"
before=$(stat -c %Y "$model")
run >"$work/third.log" 2>&1
[ "$before" = "$(stat -c %Y "$model")" ] || fail "a finished job was done again"
echo "ok: Snakemake $("$snakemake" --version), $(wc -c <"$model") bytes, the same as in one process"
