#!/usr/bin/env bash
# A whole Slurm on this machine, for tests: munged, slurmctld and slurmd on the loopback interface,
# with their own key, ports, configuration and state in one folder; nothing of the system's is used.
#
#   scripts/engines/slurm-loopback.sh install      Debian's packages, where they are missing (root)
#   scripts/engines/slurm-loopback.sh start DIR    starts; prints the line to evaluate: export SLURM_CONF=...
#   scripts/engines/slurm-loopback.sh stop DIR     stops exactly what `start DIR` started
#
# SLURM_CPUS: processors the node claims (default: those there are). SLURM_MAX_ARRAY: MaxArraySize
# (default 1001, Slurm's own). SLURM_PORT: slurmctld's port; slurmd's is the next (default 16817).
set -euo pipefail

fail() { echo "slurm-loopback: $*" >&2; exit 1; }

install() {
  if command -v slurmctld slurmd sbatch munged >/dev/null; then return; fi
  if [ "$(id -u)" != 0 ] || ! command -v apt-get >/dev/null; then fail "Slurm is missing, and only root can install it"; fi
  # No package may start a daemon of its own; apt's chatter belongs to nobody.
  export DEBIAN_FRONTEND=noninteractive
  local options=(-qq -y -o Dpkg::Use-Pty=0 --no-install-recommends)
  local packages=(slurmctld slurmd slurm-client munge)
  apt-get "${options[@]}" install "${packages[@]}" >/dev/null 2>&1 ||
    { apt-get -qq update && apt-get "${options[@]}" install "${packages[@]}" >/dev/null; } ||
    fail "apt-get could not install ${packages[*]}"
}

configuration() { # DIR
  local dir=$1 host cpus memory port=${SLURM_PORT:-16817}
  host=$(hostname -s)
  cpus=${SLURM_CPUS:-$(nproc)}
  memory=$(awk '/^MemTotal/ {print int($2 / 1024 * 0.9)}' /proc/meminfo)
  cat <<CONF
ClusterName=loopback
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$port
SlurmdPort=$((port + 1))
SlurmUser=$(id -un)
SlurmdUser=root
AuthType=auth/munge
CredType=cred/munge
# A requeued job waits as long as a credential lives, two minutes by default: tests do not.
AuthInfo=socket=$dir/munge.socket,cred_expire=5
StateSaveLocation=$dir/state
SlurmdSpoolDir=$dir/spool
SlurmctldPidFile=$dir/slurmctld.pid
SlurmdPidFile=$dir/slurmd.pid
SlurmctldLogFile=$dir/slurmctld.log
SlurmdLogFile=$dir/slurmd.log
# No cgroups and no systemd: a container has neither.
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
MpiDefault=none
MailProg=/bin/true
SwitchType=switch/none
ReturnToService=2
SchedulerType=sched/backfill
SchedulerParameters=sched_interval=2,bf_interval=2,batch_sched_delay=0,sched_min_interval=0
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
MaxArraySize=${SLURM_MAX_ARRAY:-1001}
KillWait=5
MinJobAge=600
NodeName=$host NodeAddr=127.0.0.1 CPUs=$cpus RealMemory=$memory State=UNKNOWN
PartitionName=test Nodes=$host Default=YES MaxTime=INFINITE State=UP
CONF
}

start() { # DIR
  local dir
  dir=$(mkdir -p "$1" && cd "$1" && pwd)
  command -v slurmctld slurmd sbatch munged >/dev/null || fail "Slurm is not installed; try: $0 install"
  mkdir -p "$dir/state" "$dir/spool"
  configuration "$dir" >"$dir/slurm.conf"
  (umask 077 && head -c 1024 /dev/urandom >"$dir/munge.key")
  # --force: the socket's folder may be of root, or in /tmp.
  munged --force --foreground --socket="$dir/munge.socket" --key-file="$dir/munge.key" \
    --pid-file="$dir/munge.pidfile" --seed-file="$dir/munge.seed" --log-file="$dir/munge.log" </dev/null >"$dir/munge.out" 2>&1 &
  echo $! >"$dir/started"
  for _ in $(seq 50); do [ -S "$dir/munge.socket" ] && break; sleep 0.1; done
  [ -S "$dir/munge.socket" ] || { tail -5 "$dir/munge.log" "$dir/munge.out" >&2; stop "$dir"; fail "munged did not start"; }

  export SLURM_CONF=$dir/slurm.conf
  slurmctld -D -f "$SLURM_CONF" </dev/null >"$dir/slurmctld.out" 2>&1 &
  echo $! >>"$dir/started"
  slurmd -D -f "$SLURM_CONF" </dev/null >"$dir/slurmd.out" 2>&1 &
  echo $! >>"$dir/started"
  for _ in $(seq 150); do
    if sinfo --noheader --format=%t 2>/dev/null | grep -qx idle; then
      echo "export SLURM_CONF=$(printf %q "$SLURM_CONF")"
      return
    fi
    sleep 0.2
  done
  tail -5 "$dir"/slurmctld.log "$dir"/slurmd.log >&2 || true
  stop "$dir"
  fail "the node did not become idle within 30 s"
}

# The daemons in the order slurmd, slurmctld, munged: each needs those after it to end cleanly.
stop() { # DIR
  local pid
  [ -f "$1/started" ] || return 0
  for pid in $(tac "$1/started"); do
    kill "$pid" 2>/dev/null || continue
    for _ in $(seq 100); do kill -0 "$pid" 2>/dev/null || break; sleep 0.1; done
    kill -9 "$pid" 2>/dev/null || true
  done
  rm -f "$1/started"
}

case "${1:-}" in
  install) install ;;
  start) start "${2:?a folder}" ;;
  stop) stop "${2:?a folder}" ;;
  *) sed -n '2,11s/^# \{0,1\}//p' "$0"; exit 2 ;;
esac
