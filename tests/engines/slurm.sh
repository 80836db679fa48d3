#!/usr/bin/env bash
# A job folder driven by a real Slurm on the loopback interface: cancelled and submitted again, one task
# killed, one told to stop (SIGUSR1: checkpoint, exit 75), batches because of a small MaxArraySize; then
# merged, and compared with what one process makes, byte by byte. Fails where no Slurm can be installed and started.
# shellcheck source=tests/engines/common.sh
. "$(dirname "$0")/common.sh"

loopback=scripts/engines/slurm-loopback.sh
"$loopback" install || fail "no Slurm here, and none can be installed"
trap '"$loopback" stop "$work/slurm"; rm -rf "$work"' EXIT
started=$(SLURM_MAX_ARRAY=4 SLURM_PORT=$((20000 + RANDOM % 12000)) "$loopback" start "$work/slurm") || fail "Slurm's daemons do not start here"
eval "$started"

queue_is_empty() { [ -z "$(squeue --noheader)" ]; }
scontrol_says() { scontrol show job "$1" | grep -qE "$2"; }
array_number() { awk '/^blocks:/ {print $2}' "$work/submitted"; }

"$program" plan "${options[@]}" -o "$job" --emit slurm --quiet >"$work/job.slurm"
# The user's own edits: one processor a task, so that two run together here.
sed -i 's/^cpus=.*/cpus=1/' "$work/job.slurm"

echo "cancelled as a whole, while blocks are at work"
bash "$work/job.slurm" >"$work/submitted"
if bash "$work/job.slurm" 2>/dev/null; then fail "a queued job was submitted twice"; fi
wait_for 60 "block 0 at work" block_pid 0
sleep 0.5
scancel "$(array_number)"
wait_for 60 "an empty queue: the merge must go with its array" queue_is_empty
if [ -e "$job.pgs" ]; then fail "a cancelled job has a model"; fi

echo "submitted again: block 2 killed, block 4 told to stop"
bash "$work/job.slurm" >"$work/submitted"
array=$(array_number)
wait_for 60 "block 2 at work" block_pid 2
kill -KILL "$(block_pid 2)"
# A busy machine may not have finished a piece of the block yet: then once more, and later.
for pause in 0.5 1 2; do
  wait_for 60 "block 4 at work" block_pid 4
  sleep "$pause"
  # scancel says `try again later` until the requeue is through; nobody waits for it.
  scancel --signal=USR1 --batch "${array}_2" 2>/dev/null &
  wait_for 60 "the stopped task back in the queue" scontrol_says "${array}_2" 'JobState=PENDING'
  if [ -e "$job/blocks/00004.checkpoint" ]; then break; fi
done
[ -e "$job/blocks/00004.checkpoint" ] || fail "the stopped block left no checkpoint"
grep -q 'finished work is saved' "$job/logs/block-$array-2.log" || fail "block 4 did not stop with exit code 75"
wait_for 60 "the killed task's second turn" scontrol_says "${array}_1" 'Restarts=[1-9]'
wait_for 60 "the stopped task's second turn" scontrol_says "${array}_2" 'Restarts=[1-9]'
wait_for 180 "an empty queue" queue_is_empty
wait

model=$(sed -n 's/^model=//p' "$work/job.slurm" | xargs)
[ -f "$model" ] || fail "no merged file: $(tail -n 3 "$job"/logs/*)"
compare_with_direct "$model"
echo "ok: Slurm $(sinfo --version | cut -d' ' -f2), $(wc -c <"$model") bytes, the same as in one process"
