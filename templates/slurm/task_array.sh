#!/bin/bash
# {{title}}
# One task of an array. Submit with the number of lines of the tasks file to skip: sbatch --array=0-9 SCRIPT 0
#SBATCH --nodes=1
#SBATCH --ntasks={{ranks}}
#SBATCH --cpus-per-task={{cpus}}
#SBATCH --mem={{memory}}M
#SBATCH --time={{time}}
#SBATCH --signal=B:USR1@{{lead}}
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --kill-on-invalid-dep=no
{{options}}

tasks={{tasks}}
logs={{logs}}
task=${SLURM_ARRAY_JOB_ID}_${SLURM_ARRAY_TASK_ID}

# The end of the wall time is near: the task is asked for its checkpoint. Bash runs this in the middle of its `wait`, which ends
# by that; `interrupted` tells it to wait again.
child= due= interrupted=
trap 'due=yes interrupted=yes; [ -z "$child" ] || kill -TERM "$child" 2>/dev/null' USR1
trap 'interrupted=yes; [ -z "$child" ] || kill -TERM "$child" 2>/dev/null' TERM INT

line=$(( ${1:?number of lines of the tasks file to skip} + SLURM_ARRAY_TASK_ID + 1 ))
key=$(sed -n "${line}p" "$tasks")
if [ -z "$key" ]; then
    echo "task $task: there is no line $line in $tasks" >&2
    exit 2
fi
echo "task $task: key $key on $(hostname), go $(( ${SLURM_RESTART_COUNT:-0} + 1 )), $(date '+%Y-%m-%d %H:%M:%S')"
ln -sfn "$task.log" "$logs/$key.log"

# The site's modules and lines.
{{site}}

{{command}} &
child=$!
# Asked before there was a task to hand it on to.
[ -z "$due" ] || kill -TERM "$child" 2>/dev/null

status=
while :; do
    interrupted=
    wait "$child"
    code=$?
    # It has ended between two waits, and its status is known.
    [ "$code" -eq 127 ] && [ -n "$status" ] && break
    status=$code
    [ -n "$interrupted" ] || break
done

# A checkpoint at the end of the wall time: the same task once more. Whoever waits for it goes on waiting.
if [ -n "$due" ] && [ "$status" -eq {{checkpoint}} ]; then
    echo "task $task: wall time over, checkpoint written, queued again"
    scontrol requeue "$task" || echo "task $task: it cannot be queued again; submit it anew" >&2
fi
exit "$status"
