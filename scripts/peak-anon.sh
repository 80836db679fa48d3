#!/usr/bin/env bash
# Runs a command and prints its wall-clock seconds and its peak anonymous memory (RssAnon, mapped
# files apart) on stderr: scripts/peak-anon.sh COMMAND [ARGUMENT ...]
start=$(date +%s.%N)
"$@" &
pid=$!
peak=0
while kill -0 "$pid" 2>/dev/null; do
  now=$(awk '/^RssAnon/ {print $2}' "/proc/$pid/status" 2>/dev/null)
  if [ "${now:-0}" -gt "$peak" ]; then peak=$now; fi
  sleep 0.1
done
wait "$pid"
code=$?
echo "wall $(echo "$(date +%s.%N) - $start" | bc) s, peak anonymous $((peak / 1024)) MiB, exit $code" >&2
exit "$code"
