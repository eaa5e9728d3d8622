#!/usr/bin/env bash
# The job array of docs/schedulers/cadmorph.sbatch on a Slurm of one node that this script sets up in
# a scratch folder, on the loopback interface, and stops: slurm_test.sh PROGRAM_FOLDER
#
# A task is killed half-way; the array submitted again must complete the batch, and the union must be
# that of a run without a scheduler. Then the commands of docs/schedulers.md are run as they stand.
unset SLURM_CONF
source "$(dirname "$0")/common.sh" "$1"
PATH="$PATH:/usr/sbin"
need munged slurmctld slurmd sbatch scontrol scancel
source "$(dirname "$0")/../formats/openfoam.sh" "$1"
need_openfoam

scratch=$(mktemp -d)
daemons=$scratch/daemons # their process ids

# Ends the jobs, the daemons, and whatever else of them still has a file of the scratch folder open.
clean_up() {
  local left
  if [[ -n ${SLURM_CONF:-} ]]; then timeout 5 scancel --user="$(id -un)" 2>/dev/null || true; fi
  if [[ -f $daemons ]]; then tac "$daemons" | xargs -r kill 2>/dev/null || true; fi
  sleep 1
  left=$(find /proc/[0-9]*/fd -lname "$scratch/*" 2>/dev/null | cut -d / -f 3 | sort -u) || true
  for process in $left; do
    if [[ $process != "$$" && $process != "$BASHPID" ]]; then kill -KILL "$process" || true; fi
  done
  rm -rf "$scratch"
}

stop() {
  local code=$?
  if ((code != 0)); then tail -n 15 "$scratch"/*.log >&2 || true; fi
  clean_up 2>/dev/null
}
trap stop EXIT
trap 'exit 1' INT TERM

# Outlives this script, to clean up when it is killed.
guard() {
  while kill -0 $$ 2>/dev/null; do sleep 1; done
  if [[ -d $scratch ]]; then clean_up; fi
}

start() {
  local name=$1
  shift
  "$@" >"$scratch/$name.log" 2>&1 &
  echo $! >>"$daemons"
}

# wait_until SECONDS COMMAND...
wait_until() {
  local end=$((SECONDS + $1))
  shift
  until "$@" >/dev/null 2>&1; do
    if ((SECONDS >= end)); then return 1; fi
    sleep 0.1
  done
}

free_port() {
  local port=$((20000 + RANDOM % 20000))
  while (: <"/dev/tcp/127.0.0.1/$port") 2>/dev/null; do port=$((port + 1)); done
  echo "$port"
}

set_up_slurm() {
  local host bind=''
  host=$(hostname -s)
  # Slurm binds to the address of the host's name or to all.
  if [[ $(getent hosts "$(hostname)") == 127.* ]]; then
    bind=CommunicationParameters=NoInAddrAny,NoCtldInAddrAny
  fi
  chmod 755 "$scratch"
  (umask 077 && head -c 1024 /dev/urandom >"$scratch/munge.key")
  mkdir "$scratch/run" "$scratch/state" "$scratch/spool"
  cat >"$scratch/slurm.conf" <<CONF
ClusterName=test
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$(free_port)
SlurmdPort=$(free_port)
$bind
SlurmUser=$(id -un)
SlurmdUser=$(id -un)
AuthType=auth/munge
AuthInfo=socket=$scratch/run/munge.sock
CredType=cred/munge
StateSaveLocation=$scratch/state
SlurmdSpoolDir=$scratch/spool
SlurmctldPidFile=$scratch/run/slurmctld.pid
SlurmdPidFile=$scratch/run/slurmd.pid
SlurmctldLogFile=$scratch/slurmctld.log
SlurmdLogFile=$scratch/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SchedulerType=sched/builtin
SchedulerParameters=sched_interval=1
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
ReturnToService=2
MpiDefault=none
NodeName=$host NodeAddr=127.0.0.1 CPUs=2 State=UNKNOWN
PartitionName=main Nodes=$host Default=YES MaxTime=5 State=UP
CONF
  export SLURM_CONF=$scratch/slurm.conf
  (guard </dev/null >/dev/null 2>&1 &)
  start munged munged --foreground --force --key-file="$scratch/munge.key" \
    --socket="$scratch/run/munge.sock" --pid-file="$scratch/run/munged.pid" \
    --log-file="$scratch/munge.log" --seed-file="$scratch/run/munge.seed"
  wait_until 20 test -S "$scratch/run/munge.sock" || fail "munged does not start"
  start slurmctld-out slurmctld -D -f "$SLURM_CONF"
  wait_until 20 scontrol ping || fail "slurmctld does not answer"
  start slurmd-out slurmd -D -f "$SLURM_CONF"
  wait_until 30 is_idle || fail "the node does not come up"
}

is_idle() { [[ $(sinfo --noheader --format=%T) == idle* ]]; }
is_all_over() { [[ -z $(squeue --noheader 2>/dev/null) ]]; }
is_over() { [[ -z $(squeue --noheader --jobs="$1" 2>/dev/null) ]]; }
row_count() { cat "$folder/results.1-of-2.jsonl" 2>/dev/null | wc -l; }
has_begun() { (($(row_count) >= 2)); }

submit() {
  sbatch --parsable --array=1-2 --cpus-per-task=1 --output="$scratch/task-%A_%a.log" \
    "$schedulers/cadmorph.sbatch" "$root/models/bore/base.step" "$root/models/bore/hex.vtu" \
    "$scratch/variants.csv" "$folder" --quiet
}

state_of() { scontrol show job "$1" | grep -oE 'JobState=[A-Z]+' | sort | uniq -c | xargs; }

folder=$scratch/out
write_manifest "$scratch/variants.csv" 48
set_up_slurm

job=$(submit)
wait_until 180 has_begun || fail "the first task finishes no variant"
scancel --signal=KILL --full "${job}_1"
wait_until 240 is_over "$job" || fail "the array does not end"
echo "first array: $(state_of "$job"), $(row_count) of 24 variants in the killed task"
(($(row_count) < 24)) || fail "the task was over before it was killed"
code=0
cadmorph batch --collect "$folder" 2>"$scratch/missing" || code=$?
[[ $code == 8 ]] || fail "collecting half a batch ends with $code"
missing=$(sed -nE 's/^  (v[0-9]{2})$/\1/p' "$scratch/missing" | head -1)
[[ -n $missing && ! -e $folder/$missing.vtu ]] || fail "no missing variant is named, but '$missing'"

job=$(submit)
wait_until 240 is_over "$job" || fail "the second array does not end"
echo "second array: $(state_of "$job")"
[[ $(state_of "$job") == '2 JobState=COMPLETED' ]] || fail "a task of the second array failed"
cadmorph batch --collect "$folder"

cadmorph batch "$root/models/bore/base.step" "$root/models/bore/hex.vtu" --quiet \
  --manifest "$scratch/variants.csv" -o "$scratch/expected"
require_same_results "$scratch/expected" "$folder"

enter_user_folder "$scratch/user"
cp "$scratch/variants.csv" .
cp "$root/models/bore/step20.step" variant.step
make_decomposed_case case
run_shown_commands docs/schedulers.md
wait_until 300 is_all_over || fail "the shown commands do not end"
require_same_results "$scratch/expected" out
[[ -f out/results.8-of-8.csv ]] || fail "not eight shares"

# Moved piece by piece or as a whole: the same bytes.
cadmorph apply case.cmf case -o whole_case --quiet
for piece in processor0 processor1 processor2; do
  cmp {whole,new}_case/$piece/constant/polyMesh/points || fail "$piece differs from the whole"
done
