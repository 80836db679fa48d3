#!/usr/bin/env bash
# A particlegs job for Slurm, written by `particlegs plan --emit slurm`. It is yours: edit it.
#   bash THIS_FILE          on a login node: submits scatter -> blocks -> merge and returns
#   bash THIS_FILE          again after failures: finished tasks are skipped, interrupted ones continue
# Progress: particlegs status JOB. Logs of the tasks: JOB/logs.
set -euo pipefail

program=@PROGRAM@
job=@JOB@
model=@MODEL@
chunks=@CHUNKS@             # chunks of the input to scatter; 0: nothing to scatter
blocks=@BLOCKS@
memory=@MEMORY@M         # for a chunk or a block, as planned
merge_memory=@MERGE_MEMORY@M   # for the merge, with all particles if it measures a certificate
cpus=@THREADS@
time=04:00:00        # per task; longer tasks stop at a checkpoint and queue again
notice=120           # seconds before its end at which a task gets the signal to stop
at_once=100          # most tasks of an array that run at the same time
array=1000           # most tasks in an array (also limited by the site's MaxArraySize); more blocks go in batches
site=()              # options that your site needs: site=(--partition=long --account=me)

ending='' signalled='' child=''

# Requeues only this task: SLURM_JOB_ID may name the whole array. If Slurm itself ends the task (scancel,
# preemption, requeue), Slurm decides whether it runs again.
again() {
  [ -n "$ending" ] || scontrol requeue "${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID"
  exit 75
}

# An array task: its items, one after the other. The program runs in the background, so that this shell
# receives signals at once and passes them on; SIGTERM also reaches the program directly.
items() { # scatter|block COUNT BATCH
  local i code first=$((SLURM_ARRAY_TASK_ID * $3)) end=$(((SLURM_ARRAY_TASK_ID + 1) * $3))
  trap 'signalled=yes; kill -USR1 "$child" 2>/dev/null || true' USR1
  trap 'signalled=yes ending=yes' TERM
  for ((i = first; i < end && i < $2; i++)); do
    "$program" "$1" "$job" "$i" --threads "$SLURM_CPUS_PER_TASK" --quiet &
    child=$!
    while signalled='' code=0; wait "$child" || code=$?; [ -n "$signalled" ]; do :; done
    if [ "$code" = 75 ]; then again; fi
    # Killed (out of memory, by hand): it continues from its checkpoint, at most three times.
    if [ "$code" -gt 128 ] && [ "${SLURM_RESTART_COUNT:-0}" -lt 3 ]; then again; fi
    if [ "$code" != 0 ]; then exit "$code"; fi
  done
}

submit() { # NAME DEPENDENCY, then arguments for sbatch: prints the job id
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
