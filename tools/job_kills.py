#!/usr/bin/env python3
"""Kills the chunks of jobs at random moments until all are complete, and measures what chunks cost.

    tools/job_kills.py [--kills 50] [--seed 1]

A job has eight chunks. Two at a time run, chosen at random, twins of one chunk among them; they are killed (SIGKILL) or asked to stop
(SIGTERM) after random times, and run again. Every merged film must have the bits of chunks that nobody disturbed. Then prints the processor time
of one render over that of 2, 8 and 32 chunks with their merging. Needs only the built program.
"""
import argparse
import os
import pathlib
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time

from interrupt import PROGRAM, SCENES, statistics

CHUNKS = 8


def fluxion(*arguments):
    return subprocess.run([PROGRAM, *map(str, arguments)], check=True, capture_output=True, text=True).stdout


def plan(folder, spp, chunks, size, *options):
    fluxion("job", "plan", SCENES[0], "--spp", spp, "--chunks", chunks, "-o", folder, "--", "--size", size, "--method", "l2", "-q", *options)


def merged(folder):
    """The statistics of all samples."""
    fluxion("job", "merge", folder, "--no-image")
    return statistics(f"{folder}/cornell-box.ckpt")


def disturbed(chance, seconds):
    """Runs a job whose processes are killed; returns the number of kills."""
    plan("disturbed", 512, CHUNKS, "96x72", "--checkpoint-every", "0.05s")
    kills, running = 0, []
    while True:
        left = fluxion("job", "status", "disturbed", "--missing").strip()
        if not left and not running:
            return kills
        while left and len(running) < 2:
            chunk = chance.randrange(CHUNKS)
            running.append((subprocess.Popen([PROGRAM, "job", "run", "disturbed", str(chunk)], stderr=subprocess.DEVNULL),
                            time.monotonic() + chance.uniform(0.02, 1.5 * seconds)))
        for process, end in list(running):
            if process.poll() is None and time.monotonic() > end:
                process.send_signal(chance.choice((signal.SIGKILL, signal.SIGTERM)))
                process.wait()
                kills += 1
            if process.poll() is not None:
                running.remove((process, end))
                # 143 where the request came before anyone listened, and 1 where a twin was at work.
                if process.returncode not in (0, 1, 75, -signal.SIGKILL, -signal.SIGTERM):
                    sys.exit(f"exit code {process.returncode}")
        time.sleep(0.005)


def processor_time(work):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    work()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def in_chunks(chunks):
    plan("costs", 2048, chunks, "256x192")
    for chunk in range(chunks):
        fluxion("job", "run", "costs", chunk)
    fluxion("job", "merge", "costs", "--no-image")
    shutil.rmtree("costs")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    chance, kills, jobs = random.Random(args.seed), 0, 0
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        plan("whole", 512, CHUNKS, "96x72")
        start = time.monotonic()
        for chunk in range(CHUNKS):
            fluxion("job", "run", "whole", chunk)
        seconds, expected = (time.monotonic() - start) / CHUNKS, merged("whole")
        while kills < args.kills:
            kills, jobs = kills + disturbed(chance, seconds), jobs + 1
            if merged("disturbed") != expected:
                sys.exit("the film of disturbed chunks differs")
            shutil.rmtree("disturbed")
            print(f"{jobs} jobs, {kills} kills, all films equal", flush=True)
        one = processor_time(lambda: fluxion("render", SCENES[0], "--spp", 2048, "--size", "256x192", "--method", "l2", "-q", "--checkpoint",
                                             "one.ckpt"))
        for chunks in (2, 8, 32):
            print("%2d chunks: %.3f of one render's efficiency" % (chunks, one / processor_time(lambda: in_chunks(chunks))), flush=True)


if __name__ == "__main__":
    sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
    main()
