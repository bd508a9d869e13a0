"""Squared error of path tracing times its seconds, of Fluxion and of Mitsuba's samplers."""
import os
import statistics
import time

import exr
import peers
import program

REFERENCES = True


def cells(run, where):
    return [[name, spp] for spp in run["spp"] for name in run["scenes"]]


def measure(cell, run, where, folder):
    """Means over the seeds; `best` is that of the best sampler."""
    name, spp = cell
    scene, (reference, floor) = where.scene(name), where.reference(name)
    expected, size = exr.rgb(reference), scene.width_and_height
    loaded = {sampler: peers.load("llvm_ad_rgb", scene.path, size, sampler) for sampler in run["samplers"]}
    for one in loaded.values():
        peers.render("llvm_ad_rgb", one, spp, 0)
    product = lambda image, seconds: (float(((image - expected) ** 2 / (expected ** 2 + 0.01)).mean()) - floor) * seconds
    found = {key: [] for key in ("fluxion", *run["samplers"])}
    for seed in range(1, run["seeds"] + 1):
        path = os.path.join(folder, "image.exr")
        stats = program.with_statistics("render", scene.path, "-o", path, "--size", scene.size, "--spp", spp, "--seed", seed, "--method", "primal")
        found["fluxion"].append(product(exr.rgb(path), stats["seconds"]["render"]))
        for sampler, one in loaded.items():
            start = time.monotonic()
            image = peers.render("llvm_ad_rgb", one, spp, seed)
            found[sampler].append(product(image, time.monotonic() - start))
    means = {key: statistics.fmean(values) for key, values in found.items()}
    return [{"scene": "%s, %d spp" % (name, spp), **means, "best": min(means[sampler] for sampler in run["samplers"]), "of_seeds": found}]
