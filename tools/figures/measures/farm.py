"""Processor time of a render in one go over that of its chunks with their merge."""
import os
import resource
import tempfile

import program
from scenes import ROOT

REFERENCES = False

SCENE = os.path.join(ROOT, "scenes", "cornell-box", "scene.xml")


def cells(run, where):
    return [[chunks, turn] for turn in range(run["rounds"]) for chunks in run["chunks"]]


def processor_time(work):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    work()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def measure(cell, run, where, folder):
    chunks, turn = cell
    options = ["--size", run["size"], "--method", "l2"]

    def in_chunks(job):
        program.call("job", "plan", SCENE, "--spp", run["spp"], "--chunks", chunks, "-o", job, "--", *options, "-q")
        for chunk in range(chunks):
            program.call("job", "run", job, chunk)
        program.call("job", "merge", job, "--no-image")

    def in_one(checkpoint):
        program.call("render", SCENE, "--spp", run["spp"], *options, "-q", "--checkpoint", checkpoint)

    with tempfile.TemporaryDirectory(dir=folder) as below:
        whole = processor_time(lambda: in_one(os.path.join(below, "one.ckpt")))
        parts = processor_time(lambda: in_chunks(os.path.join(below, "job")))
    return [{"chunks": chunks, "turn": turn, "whole": whole, "parts": parts}]
