"""Squared error of path tracing times its seconds, of Fluxion and of Mitsuba's samplers."""
import os
import time

import exr
import peers
import program


def cells(run, where):
    return [[name, spp] for spp in run["spp"] for name in run["scenes"] if any(scene.name == name for scene in where.scenes)]


def measure(cell, run, where, folder):
    name, spp = cell
    scene, (reference, floor) = where.scene(name), where.reference(name)
    expected, size = exr.rgb(reference), scene.width_and_height
    loaded = {sampler: peers.load("llvm_ad_rgb", scene.path, size, sampler) for sampler in run["samplers"]}
    for one in loaded.values():
        peers.render("llvm_ad_rgb", one, spp, 0)
    product = lambda image, seconds: program.floored(float(((image - expected) ** 2 / (expected ** 2 + 0.01)).mean()), floor) * seconds
    runs = []
    for seed in range(1, run["seeds"] + 1):
        path = os.path.join(folder, "image.exr")
        stats = program.with_statistics("render", scene.path, "-o", path, "--size", scene.size, "--spp", spp, "--seed", seed, "--method", "primal")
        found = {"fluxion": product(exr.rgb(path), stats["seconds"]["render"])}
        for sampler, one in loaded.items():
            start = time.monotonic()
            image = peers.render("llvm_ad_rgb", one, spp, seed)
            found[sampler] = product(image, time.monotonic() - start)
        runs.append({"scene": "%s, %d spp" % (name, spp), "seed": seed, "best": min(found[sampler] for sampler in run["samplers"]), **found})
    return runs
