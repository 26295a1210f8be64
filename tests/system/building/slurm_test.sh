#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
# Maps a building under Slurm, on two nodes on this machine: a killed run, and a killed node with all its processes,
# cost time but change no byte of the results. Compares with the same plan on this machine alone, and adds a recording.
#
# Usage: slurm_test.sh CAIRN SOURCE; exit code 77 if Slurm or Snakemake is not installed
set -euo pipefail
cairn=$(realpath "$1") source=$(realpath "$2")
for program in snakemake slurmctld slurmd sbatch; do
  command -v "$program" > /dev/null || { echo "$program is not installed"; exit 77; }
done
[ "$(id -u)" = 0 ] || { echo "Slurm's daemons run jobs as root alone"; exit 77; }
work=$(mktemp -d)
export SLURM_CONF=$work/slurm.conf CI=true  # with which Snakemake asks for its jobs each second, in place of each tenth
declare -A daemons
finish() {
  for pid in "${daemons[@]}"; do kill -9 "$pid" 2> /dev/null && wait "$pid" 2> /dev/null || true; done
  pkill -9 -f "slurmstepd.*$work" 2> /dev/null || true
  rm -rf "$work"
}
trap finish EXIT
failed() { echo "FAILED: $1"; tail -n 30 "$work"/*.log "$work"/slurm/*.log 2> /dev/null || true; exit 1; }

# Two recordings of a room, the first with two segments and the second with one, and a recording to be added.
arguments="--voxel-size 0.08 --checkpoint 0.1"
frames=(0 40 25 25)
for seed in 1 2 3; do
  "$cairn" synth room --frames "${frames[seed]}" --width 320 --seed "$seed" -o "$work/walk-$seed" > /dev/null 2>&1
done
plan() { "$cairn" plan "${@:2}" -o "$work/$1" --frames-per-part 25 --overlap 10 > /dev/null; }
engine() { # PLAN OPTION...
  snakemake -s "$source/scripts/building/Snakefile" --config plan="$work/$1" cairn="$cairn" arguments="$arguments" \
    "${@:2}" > "$work/$1.log" 2>&1
}
# Checksums of the results, without reports.
outcome() {
  (cd "$work/$1" && find . -name '*.glb' -o -name 'tileset.json' -o -name 'map.vdb' -o -name 'trajectory*.txt' \
    -o -path './loops/*.json' -o -path './cells/*.json' -o -name graph.g2o | LC_ALL=C sort | xargs sha256sum)
}

plan here "$work/walk-1" "$work/walk-2"
# Without arguments, as in docs/buildings.md: the last word of the command is the plan's own.
arguments="" engine here -n -p
grep -q 'cairn reconstruct .* -o "$map" --no-mesh $how *\\$' "$work/here.log" || failed 'arguments=""'
engine here -j2 || failed "Snakemake on this machine"
outcome here > "$work/here.sums"
[ "$(wc -l < "$work/here.sums")" -gt 10 ] || failed "little came out"

# Two nodes on loopback.
mkdir -p "$work/slurm"
host=$(hostname -s)
port=$((20000 + RANDOM % 20000))
cat > "$SLURM_CONF" << EOF
ClusterName=test
SlurmctldHost=$host(127.0.0.1)
SlurmUser=$(id -un)
SlurmdUser=$(id -un)
AuthType=auth/none
CredType=cred/none
SlurmctldPort=$port
StateSaveLocation=$work/slurm
SlurmdSpoolDir=$work/slurm/%n
SlurmctldPidFile=$work/slurm/ctld.pid
SlurmdPidFile=$work/slurm/%n.pid
SlurmctldLogFile=$work/slurm/ctld.log
SlurmdLogFile=$work/slurm/%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SwitchType=switch/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
ReturnToService=2
SlurmdTimeout=10
MinJobAge=600
SchedulerParameters=batch_sched_delay=0,sched_interval=2
NodeName=one NodeHostname=$host NodeAddr=127.0.0.1 Port=$((port + 1)) CPUs=1
NodeName=two NodeHostname=$host NodeAddr=127.0.0.1 Port=$((port + 2)) CPUs=1
PartitionName=all Nodes=one,two Default=YES MaxTime=INFINITE State=UP
EOF
mkdir -p "$work/slurm/one" "$work/slurm/two"
start() { # NAME COMMAND...
  "${@:2}" > "$work/slurm/$1.out" 2>&1 &
  daemons[$1]=$!
}
start ctld slurmctld -D -f "$SLURM_CONF"
for node in one two; do start $node slurmd -D -N $node -f "$SLURM_CONF"; done
for ((i = 0; i < 60; i++)); do
  [ "$(sinfo -h -t idle -o %D 2> /dev/null)" = 2 ] && break
  sleep 0.5
done
[ "$(sinfo -h -t idle -o %D)" = 2 ] || failed "Slurm's nodes do not come up"

plan there "$work/walk-1" "$work/walk-2"
cluster=(-j4 --cores 1 --latency-wait 30 --cluster "sbatch --parsable -c 1 -o $work/slurm/job-%j.out"
  --cluster-status "$source/scripts/building/slurm-status" --restart-times 3)
engine there "${cluster[@]}" & running=$!

# Kills a run as soon as its session exists, then a node with all its processes.
wait_for() { for ((i = 0; i < 600; i++)); do eval "$1" && return; kill -0 $running 2> /dev/null || return 1; sleep 0.1; done; return 1; }
of_a_part() { # the program that maps a part which has come to its first checkpoint
  local pid map
  for pid in $(pgrep -x cairn); do
    map=$(tr '\0' '\n' < "/proc/$pid/cmdline" 2> /dev/null | grep "^$work/there/maps/...$") || continue
    [ -e "$map/session/state.cbor" ] && [ ! -e "$map/report.json" ] && echo "$pid" && return
  done
  return 1
}
killed=
wait_for 'killed=$(of_a_part)' || failed "no part is mapped"
kill -9 "$killed"
job=
wait_for 'job=$(squeue -h -t R -w two -o %i | head -n 1); [ -n "$job" ]' || failed "nothing runs on the second node"
kill -9 "${daemons[two]}" && wait "${daemons[two]}" 2> /dev/null || true
pkill -9 -f "slurmstepd.*\\[$job" 2> /dev/null || true
for pid in $(pgrep -f "$work/there" || true); do
  tr '\0' '\n' < "/proc/$pid/environ" 2> /dev/null | grep -qx "SLURMD_NODENAME=two" && kill -9 "$pid" 2> /dev/null || true
done
echo "a run was killed, and node two with job $job"
# The controller does the same, but needs a minute to notice the lost node, and two more to restart its job.
scontrol update NodeName=two State=DOWN Reason=killed
wait_for 'scontrol -o show job "$job" | grep -q "JobState=PENDING.*Restarts=1"' || failed "the node's job is not begun again"
scontrol update JobId="$job" StartTime=now
start two slurmd -D -N two -f "$SLURM_CONF"
scontrol update NodeName=two State=RESUME
wait $running || failed "Snakemake under Slurm"
outcome there > "$work/there.sums"
diff "$work/here.sums" "$work/there.sums" || failed "other bytes came out"
echo "the same $(wc -l < "$work/here.sums") files came out"

# Another recording: existing maps stay unchanged.
touch "$work/before"
sleep 1
plan here "$work/walk-1" "$work/walk-2" "$work/walk-3"
engine here -j2 || failed "Snakemake with another recording"
[ -z "$(find "$work"/here/maps/00[0-2] -name report.json -newer "$work/before")" ] || failed "a map was made again"
[ -n "$(find "$work"/here/maps/003 -name report.json -newer "$work/before")" ] || failed "the new one has no map"
[ -z "$(find "$work"/here/loops -name '00[0-2]-00[0-2].json' -newer "$work/before")" ] || failed "a pair was matched again"
echo "another recording joined, and no other map was made again"
