"""Samples a second of Fluxion and of Mitsuba 3, which take turns."""
import os
import time

import peers
import program

REFERENCES = False


def cells(run, where):
    return [[name] for name in run["scenes"]]


def measure(cell, run, where, folder):
    name, spp = cell[0], run["spp"]
    scene = where.scene(name)
    size = tuple(2 * length for length in scene.width_and_height)
    count = size[0] * size[1] * spp
    loaded = {variant: peers.load(variant, scene.path, size) for variant in run["variants"]}
    for variant, one in loaded.items():
        peers.render(variant, one, 1, 0)
    runs = []
    for seed in range(run["rounds"]):
        rates = {}
        for key, method in (("path", "primal"), ("gradient", "l2")):
            stats = program.with_statistics("render", scene.path, "-o", os.path.join(folder, "image.exr"), "--size", "%dx%d" % size, "--spp",
                                            spp, "--seed", seed, "--method", method)
            rates[key] = stats["samples"] / stats["seconds"]["render"] / 1e6
        for variant, one in loaded.items():
            start = time.monotonic()
            peers.render(variant, one, spp, seed)
            rates[variant] = count / (time.monotonic() - start) / 1e6
        runs.append({"scene": name, "seed": seed, **rates})
    return runs
