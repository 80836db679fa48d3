#!/usr/bin/env bash
# A particlegs job for Slurm, written by `particlegs plan --emit slurm`. It is yours: edit it.
#   bash THIS_FILE          on a login node: submits scatter -> blocks -> merge and returns
#   bash THIS_FILE          again, after failures: what is done is skipped, what is interrupted continues
# Progress: particlegs status JOB. Logs of the tasks: JOB/logs.
set -euo pipefail

program=@PROGRAM@
job=@JOB@
model=@MODEL@
chunks=@CHUNKS@             # chunks of the input to scatter; 0: nothing to scatter
blocks=@BLOCKS@
memory=@MEMORY@M         # of a chunk or a block, as planned
merge_memory=@MERGE_MEMORY@M   # of the merge; where it measures a certificate, with all particles
cpus=@THREADS@
time=04:00:00        # of a task; what needs longer stops at a checkpoint and queues again
notice=120           # seconds before the end at which a task is told to stop
at_once=100          # tasks of an array that run together
array=1000           # tasks of an array at most (also the site's MaxArraySize): more blocks go in batches
site=()              # what your site wants: site=(--partition=long --account=me)

ending='' signalled='' child=''

# Another turn for this task alone: SLURM_JOB_ID may name the whole array. When Slurm itself ends the
# task (scancel, preemption, requeue), it decides about another turn, not we.
again() {
  [ -n "$ending" ] || scontrol requeue "${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID"
  exit 75
}

# A task of an array: its items, one after the other. The program runs in the background, so that
# this shell hears the signal at once and hands it on; SIGTERM reaches the program by itself.
items() { # scatter|block COUNT BATCH
  local i code first=$((SLURM_ARRAY_TASK_ID * $3)) end=$(((SLURM_ARRAY_TASK_ID + 1) * $3))
  trap 'signalled=yes; kill -USR1 "$child" 2>/dev/null || true' USR1
  trap 'signalled=yes ending=yes' TERM
  for ((i = first; i < end && i < $2; i++)); do
    "$program" "$1" "$job" "$i" --threads "$SLURM_CPUS_PER_TASK" --quiet &
    child=$!
    while signalled='' code=0; wait "$child" || code=$?; [ -n "$signalled" ]; do :; done
    if [ "$code" = 75 ]; then again; fi
    # Killed (out of memory, by hand): it continues from its checkpoint, three times at most.
    if [ "$code" -gt 128 ] && [ "${SLURM_RESTART_COUNT:-0}" -lt 3 ]; then again; fi
    if [ "$code" != 0 ]; then exit "$code"; fi
  done
}

submit() { # NAME DEPENDENCY, then sbatch's arguments: prints the job's number
  local name=$1 after=$2
  shift 2
  sbatch --parsable --job-name="$title-$name" --output="${job//%/%%}/logs/$name-%A-%a.log" --open-mode=append \
    --nodes=1 --ntasks=1 --cpus-per-task="$cpus" --time="$time" --requeue \
    ${after:+--dependency="afterok:$after" --kill-on-invalid-dep=yes} ${site[@]+"${site[@]}"} "$@" | cut -d';' -f1
}

submit_array() { # scatter|block COUNT DEPENDENCY
  local batch=$((($2 + array - 1) / array))
  submit "$1" "$3" --mem="$memory" --signal="B:USR1@$notice" --array="0-$((($2 + batch - 1) / batch - 1))%$at_once" "$0" "$1" "$2" "$batch"
}

case "${1:-submit}" in
  scatter | block) items "$@" ;;
  merge) exec "$program" merge "$job" -o "$model" --threads "$SLURM_CPUS_PER_TASK" ;;
  submit)
    title=particlegs-$(basename "$job" | tr -c '[:alnum:]\n' _)
    if squeue --noheader --user="$(id -un)" --format=%j | grep -q "^$title-"; then
      echo "this job is queued already: squeue --user=$(id -un)" >&2
      exit 1
    fi
    largest=$(scontrol show config | awk '$1 == "MaxArraySize" {print $3}')
    if [ "${largest:-0}" -gt 0 ] && [ "$largest" -lt "$array" ]; then array=$largest; fi
    mkdir -p "$job/logs"
    last=''
    if [ "$chunks" -gt 0 ]; then last=$(submit_array scatter "$chunks" ''); echo "scatter: $last"; fi
    last=$(submit_array block "$blocks" "$last"); echo "blocks: $last"
    last=$(submit merge "$last" --mem="$merge_memory" "$0" merge); echo "merge: $last"
    ;;
esac
