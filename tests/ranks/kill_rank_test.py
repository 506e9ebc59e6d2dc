#!/usr/bin/python3
"""A rank that is killed (SIGKILL) at any moment of writing checkpoints ends the whole job promptly, and leaves a sound
newest checkpoint, whose content is that of its step.

usage: kill_rank_test.py CHECKPOINT_WRITER N_TIMES MPIRUN...
"""

import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time

N_RANKS = 3
PATIENCE = 30  # [s] until a job must have ended after one of its ranks was killed


def start(writer, mpirun, run, way):
    """Starts a job; returns it and the process of each of its ranks once the first checkpoints are there."""
    job = subprocess.Popen(mpirun + [str(N_RANKS), writer, run, way], stdout=subprocess.PIPE,
                           stderr=subprocess.DEVNULL, text=True)
    pids = {}
    while len(pids) < N_RANKS:
        line = job.stdout.readline()
        if not line:
            sys.exit("the job ended before it began to write")
        if found := re.match(r"rank (\d+) pid (\d+)", line):
            pids[int(found.group(1))] = int(found.group(2))
    threading.Thread(target=job.stdout.read, daemon=True).start()
    folder = os.path.join(run, "checkpoints")
    while len([name for name in os.listdir(folder) if re.fullmatch(r"checkpoint_\d+\.h5", name)]) < 2:
        if job.poll() is not None:
            sys.exit("the job ended before it was killed")
        time.sleep(0.005)
    return job, pids


def kill_one(writer, mpirun, way, choose):
    """Returns what is wrong, or None, and the newest step."""
    run = tempfile.mkdtemp(prefix="moraine-kill-")
    try:
        os.mkdir(os.path.join(run, "checkpoints"))
        job, pids = start(writer, mpirun, run, way)
        time.sleep(choose.uniform(0.0, 0.1))
        rank = choose.randrange(N_RANKS)
        os.kill(pids[rank], signal.SIGKILL)
        try:
            code = job.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            job.kill()
            return "rank %d was killed, and the job did not end" % rank, None
        if code == 0:
            return "the job ended with 0", None
        left = sorted(os.listdir(os.path.join(run, "checkpoints")))
        check = subprocess.run([writer, run, "check"], capture_output=True, text=True)
        if check.returncode != 0:
            return "rank %d was killed: %s%s, files %s" % (rank, check.stdout, check.stderr, left), None
        return None, int(check.stdout.split()[1])
    finally:
        shutil.rmtree(run, ignore_errors=True)


def main(writer, n_times, *mpirun):
    choose = random.Random(3)
    steps = []
    for i in range(int(n_times)):
        way = ("shared", "distributed")[i % 2]
        wrong, step = kill_one(writer, list(mpirun), way, choose)
        if wrong:
            print("%s, time %d: %s" % (way, i, wrong))
            return 1
        steps.append(step)
    print("%d ranks killed; the newest checkpoints were of steps %s" % (len(steps), steps))
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
