"""Errors of several methods from the same samples: every scene is rendered once a seed and count, and reconstructed by all."""
import os

import program

REFERENCES = True


def cells(run, where):
    """Scenes, seeds, samples per pixel, and labels of variants of the render."""
    wanted = [scene.name for scene in where.scenes if scene.name not in run.get("without", [])]
    return [[scene, seed, spp, variant["label"]] for seed in range(1, run["seeds"] + 1) for scene in wanted for spp in run["spp"]
            for variant in run["variants"]]


def measure(cell, run, where, folder):
    name, seed, spp, label = cell
    scene, (reference, floor) = where.scene(name), where.reference(name)
    variant = next(variant for variant in run["variants"] if variant["label"] == label)
    layers, image = os.path.join(folder, "layers.exr"), os.path.join(folder, "image.exr")
    rendered = program.with_statistics("render", scene.path, "-o", image, "--layers", layers, "--size", scene.size, "--spp", spp, "--seed",
                                       seed, *variant["options"])
    runs = []
    for method in run["methods"]:
        stats = program.with_statistics("reconstruct", layers, "-o", image, "--method", method)
        runs.append({"scene": name, "method": method, "variant": label, "budget": "%dspp" % spp, "seed": seed, "spp": rendered["spp"],
                     **program.errors(image, reference, floor), "seconds": rendered["seconds"]["render"] + stats["seconds"]["reconstruct"]})
    return runs
