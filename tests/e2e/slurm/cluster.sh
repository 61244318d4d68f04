#!/bin/sh
# A Slurm of three nodes on this machine's loopback, for tests: no account, no system service and
# no file outside its folder is touched. Needs slurm-wlm and munge.
#
#   cluster.sh start DIR      starts it; then `. DIR/environment` and use sbatch, squeue, scancel
#   cluster.sh node DIR N     starts the slurmd of node N (1 to 3) again
#   cluster.sh control DIR    starts slurmctld again, with the state that it had
#   cluster.sh stop DIR       ends everything, jobs included
#
# DIR/pid holds slurmctld, munged, node1, node2, node3: kill what a test wants to lose.
set -eu

nodes='1 2 3'
fail() {
    printf '%s\n' "cluster.sh: $*" >&2
    exit 1
}
[ $# -ge 2 ] || fail "usage: cluster.sh start|node|control|stop DIR [N]"
command=$1
mkdir -p "$2"
dir=$(CDPATH='' cd -- "$2" && pwd -P)
PATH=$PATH:/usr/sbin
port=$((20000 + $(printf '%s' "$dir" | cksum | cut -d' ' -f1) % 9000))

configure() {
    mkdir -p "$dir/pid" "$dir/log" "$dir/state" "$dir/munge"
    chmod 700 "$dir/munge"
    dd if=/dev/urandom of="$dir/munge/key" bs=128 count=1 2>/dev/null
    chmod 600 "$dir/munge/key"
    {
        cat <<TEXT
ClusterName=loopback
SlurmctldHost=$(hostname -s)(127.0.0.1)
SlurmctldPort=$port
SlurmUser=$(id -un)
SlurmdUser=$(id -un)
AuthType=auth/munge
AuthInfo=socket=$dir/munge/socket,cred_expire=5
CommunicationParameters=NoInAddrAny
StateSaveLocation=$dir/state
SlurmdSpoolDir=$dir/state/%n
SlurmctldPidFile=$dir/pid/slurmctld
SlurmdPidFile=$dir/pid/%n
SlurmctldLogFile=$dir/log/slurmctld
SlurmdLogFile=$dir/log/%n
MpiDefault=none
SwitchType=switch/none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerType=sched/backfill
SchedulerParameters=sched_min_interval=100000
ReturnToService=2
JobRequeue=1
SlurmdTimeout=10
SlurmctldTimeout=10
MinJobAge=30
KillWait=2
TEXT
        for n in $nodes; do
            echo "NodeName=node$n NodeHostname=$(hostname -s) NodeAddr=127.0.0.1 Port=$((port + n))" \
                "CPUs=2 RealMemory=1000 State=UNKNOWN"
        done
        echo "PartitionName=test Nodes=node[1-3] Default=YES MaxTime=60 State=UP OverSubscribe=NO"
    } >"$dir/slurm.conf"
    cat >"$dir/environment" <<TEXT
export SLURM_CONF='$dir/slurm.conf'
export PATH="\$PATH:/usr/sbin"
TEXT
}

start_control() { SLURM_CONF=$dir/slurm.conf slurmctld -f "$dir/slurm.conf"; }
start_node() {
    mkdir -p "$dir/state/node$1"
    SLURM_CONF=$dir/slurm.conf slurmd -f "$dir/slurm.conf" -N "node$1"
}

wait_ready() {
    tries=0
    until [ "$(SLURM_CONF=$dir/slurm.conf sinfo -h -N -o '%T' 2>/dev/null | grep -c idle)" -eq 3 ]; do
        tries=$((tries + 1))
        [ $tries -lt 100 ] || fail "the nodes are not idle after 20 s; see $dir/log"
        sleep 0.2
    done
}

# Ends the daemons named: asks all, waits up to 5 s, then kills.
end() {
    for name in "$@"; do
        [ ! -e "$dir/pid/$name" ] || kill "$(cat "$dir/pid/$name")" 2>/dev/null || true
    done
    for name in "$@"; do
        [ -e "$dir/pid/$name" ] || continue
        pid=$(cat "$dir/pid/$name")
        tries=0
        while kill -0 "$pid" 2>/dev/null && [ $tries -lt 25 ]; do
            tries=$((tries + 1))
            sleep 0.2
        done
        kill -KILL "$pid" 2>/dev/null || true
        rm -f "$dir/pid/$name"
    done
}

case $command in
start)
    configure
    munged --key-file="$dir/munge/key" --socket="$dir/munge/socket" \
        --pid-file="$dir/pid/munged" --log-file="$dir/log/munged" \
        --seed-file="$dir/munge/seed" --force
    start_control
    for n in $nodes; do
        start_node "$n"
    done
    wait_ready
    ;;
node) start_node "${3:?which node}" ;;
control) start_control ;;
stop)
    if [ -e "$dir/slurm.conf" ]; then
        SLURM_CONF=$dir/slurm.conf timeout 5 scancel --me 2>/dev/null || true
        end node1 node2 node3 slurmctld munged
    fi
    ;;
*) fail "unknown command $command" ;;
esac
