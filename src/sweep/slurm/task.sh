#!/bin/bash
# The job array of a sweep, made by `beadline sweep --slurm`. Send it with sbatch, look at it with `beadline sweep --status`.
# Each task computes a shard: the points whose index leaves its number by @ARRAY_SIZE@. One that is preempted, requeued or out
# of time goes on where it was.
@OPTIONS@
#SBATCH --output=slurm/%a-of-@ARRAY_SIZE@.out
#SBATCH --open-mode=append
# a task whose node fails, or that is preempted, begins again
#SBATCH --requeue
# 60 s before the end of its time a task is told, and begins again, too
#SBATCH --signal=B:USR1@60

shard=$SLURM_ARRAY_TASK_ID
# the first line of a journal is no row
lines() { cat "rows/$shard-of-@ARRAY_SIZE@.rows" 2>/dev/null | wc -l; }
trace() { echo "$(date +%s) $*" >>"slurm/$shard-of-@ARRAY_SIZE@.trace"; }

before=$(lines)
trace begun "$before" "$SLURMD_NODENAME"

@PROGRAM@ sweep @SWEEP@ --out . --shard "$shard/@ARRAY_SIZE@" \
    --jobs "${SLURM_CPUS_PER_TASK:-1}" --yes@RECORD@ &
program=$!

# SIGTERM, and then 30 s or what the site grants until SIGKILL, comes from Slurm to the program, too: it keeps the rows it has.
# Whoever cancels a task that is out of time does not want it again, and one that is preempted begins again by itself
heard=
out_of_time=
trap 'heard=yes; out_of_time=' TERM
trap 'heard=yes; out_of_time=yes; kill -TERM "$program"' USR1

# a signal ends the wait, and not the program
code=
while [ -z "$code" ] || [ "$heard" ]; do
    heard=
    wait "$program"
    code=$?
done
trace ended "$code"

# without a single row more it would be the same again
after=$(lines)
if [ "$out_of_time" ] && [ "$code" -eq 3 ] && [ "$after" -gt 1 ] && [ "$after" -gt "$before" ]; then
    trace requeued
    exec scontrol requeue "$SLURM_JOB_ID"
fi
exit "$code"
