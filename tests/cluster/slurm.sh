#!/usr/bin/env bash
# A bake in shards on a real Slurm: an array job, a merge that depends on it, a task that is killed, one that is run twice, and a node that
# dies.
# Slurm runs on this machine alone, unpacked into a temporary folder without installation, root or munge. Needs Debian or Ubuntu
# (apt-get download), and the program.
#
#   cargo build --release && bash tests/cluster/slurm.sh [PROGRAM]
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
program=$(realpath "${1:-$here/../../target/release/haptize}")
root=$(mktemp -d)
# By a path of its own, so that its tasks are told from other processes.
cp "$program" "$root/haptize"
program=$root/haptize
pids=()
node=

finish() {
    local code=$?
    kill "${pids[@]}" $node 2>/dev/null || true
    wait "${pids[@]}" $node 2>/dev/null || true
    if [ $code -ne 0 ]; then tail -n 20 "$root"/*.log "$root"/folder/*.out 2>/dev/null || true; fi
    rm -rf "$root"
    exit $code
}
trap finish EXIT

cd "$root"
echo '== unpack'
slurm=$(apt-cache depends slurmctld | sed -n 's/.*Depends: \(libslurm[0-9][0-9t]*\)$/\1/p' | head -n 1)
apt-get download slurmctld slurmd slurm-client slurm-wlm-basic-plugins "${slurm:-libslurm38}" libmunge2 munge libhwloc15 libjson-c5 \
    >/dev/null
for package in *.deb; do dpkg -x "$package" slurm; done
library=$root/slurm/usr/lib/$(uname -m)-linux-gnu
export LD_LIBRARY_PATH=$library:$library/slurm-wlm SLURM_CONF=$root/slurm.conf PATH=$root/slurm/usr/bin:$PATH
mkdir state spool folder
cores=$(nproc)
cat >slurm.conf <<CONF
ClusterName=one
SlurmctldHost=$(hostname)(127.0.0.1)
SlurmUser=$(id -un)
SlurmdUser=$(id -un)
SlurmctldPort=36817
SlurmdPort=36818
AuthType=auth/none
CredType=cred/none
ProctrackType=proctrack/pgid
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SwitchType=switch/none
MpiDefault=none
PluginDir=$library/slurm-wlm
StateSaveLocation=$root/state
SlurmdSpoolDir=$root/spool
SlurmctldPidFile=$root/slurmctld.pid
SlurmdPidFile=$root/slurmd.pid
ReturnToService=2
NodeName=$(hostname) NodeAddr=127.0.0.1 CPUs=$cores
PartitionName=all Nodes=ALL Default=YES State=UP
CONF
sbin=$root/slurm/usr/sbin
(exec -a slurmctld "$sbin/slurmctld-wlm" -D -c >slurmctld.log 2>&1) &
pids+=($!)
# In a process group of its own, with all that it starts: what a node's death takes along.
node() {
    setsid "$sbin/slurmd-wlm" -D -d "$sbin/slurmstepd-wlm" >>"$root/slurmd.log" 2>&1 &
    node=$!
}
node
for _ in $(seq 60); do sinfo -h -o %T 2>/dev/null | grep -q idle && break; sleep 1; done
sinfo
# The shell's own commands, where the packages give them other names.
sbatch --version

cd folder
cp "$here/../scenes/sphere.toml" scene.toml
count=8
bake="$program bake scene.toml --shard auto/$count --backend cpu -o parts"

echo '== one bake, and its time'
time "$program" bake scene.toml --backend cpu -o one.haptize

echo '== an array whose task 5 is killed'
id=$(sbatch --parsable --array=0-$((count - 1)) --cpus-per-task=1 --wrap "[ \$SLURM_ARRAY_TASK_ID = 5 ] && { $bake & kill -9 \$!; exit 1; }; $bake")
while [ -n "$(squeue -h -j "$id" 2>/dev/null)" ]; do sleep 0.5; done
if "$program" merge parts -o merged.haptize --json >lacking.json; then echo 'merged without shard 5'; exit 1; fi
missing=$(sed -n 's/.*"missing": "\(.*\)".*/\1/p' lacking.json)
echo "missing: $missing"
[ "$missing" = 5 ]

echo '== the missing one, and one a second time, then the merge'
id=$(sbatch --parsable --array="$missing,2" --cpus-per-task=1 --wrap "$bake")
merge=$(sbatch --parsable --dependency="afterok:$id" --wrap "$program merge parts -o merged.haptize")
while [ -n "$(squeue -h -j "$merge" 2>/dev/null)" ]; do sleep 0.5; done
cat "slurm-$merge.out"

echo '== a node that dies in the middle of a shard, and comes back'
sed 's/count = 14/stop = -1.62, count = 56/' scene.toml >fine.toml
"$program" bake fine.toml --backend cpu -o fine-one.haptize 2>/dev/null
id=$(sbatch --parsable --requeue --array=0-1 --cpus-per-task=1 --wrap "exec $program bake fine.toml --shard auto/2 --backend cpu -o fine-parts")
until [ -n "$(find fine-parts -name '*.part' -size +64k 2>/dev/null)" ]; do sleep 0.05; done
# Everything on the node at once: its daemon and Slurm's steps first, so that none reports the end of a task.
of() { for exe in /proc/[0-9]*/exe; do [ "$(readlink "$exe")" = "$1" ] && basename "${exe%/exe}"; done 2>/dev/null || true; }
kill -9 "$node" $(of "$sbin/slurmd-wlm") $(of "$sbin/slurmstepd-wlm") $(of "$program") 2>/dev/null || true
wait "$node" 2>/dev/null || true
ls fine-parts
# What an administrator does, or Slurm itself after a time: its tasks are queued again.
scontrol update "NodeName=$(hostname)" State=DOWN Reason=died
# A node that starts anew knows of no tasks.
rm -rf "$root"/spool/job*
node
sleep 2
# Otherwise Slurm waits two minutes before it begins them anew.
for job in $(squeue -h -r -o %A -j "$id"); do scontrol update "JobId=$job" StartTime=now || true; done
while [ -n "$(squeue -h -j "$id" 2>/dev/null)" ]; do sleep 1; done
"$program" merge fine-parts -o fine.haptize 2>/dev/null
grep -h 'of an earlier run' slurm-"${id}"_*.out

# The data behind the headers, which hold the date.
data() { python3 -c 'import sys; b = open(sys.argv[1], "rb").read(); sys.stdout.buffer.write(b[8 + int.from_bytes(b[:8], "little"):])' "$1"; }
cmp <(data one.haptize) <(data merged.haptize)
cmp <(data fine-one.haptize) <(data fine.haptize)
echo 'the merged datasets have the bits of one bake'
