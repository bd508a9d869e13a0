"""Seconds and memory of reconstructions, from layers in memory to the image in memory; methods take turns."""
import os

import program

REFERENCES = False


def cells(run, where):
    return [[method, turn] for turn in range(run["rounds"]) for method in run["methods"]]


def measure(cell, run, where, folder):
    method, turn = cell
    layers, image = os.path.join(folder, "layers.exr"), os.path.join(folder, "image.exr")
    if not os.path.exists(layers):
        program.with_statistics("render", where.scene(run["scene"]).path, "-o", image, "--layers", layers, "--size", run["size"], "--spp",
                                run["spp"], *run["options"])
    stats = program.with_statistics("reconstruct", layers, "-o", image, "--method", method)
    base = program.with_statistics("reconstruct", layers, "-o", image, "--method", "primal")
    return [{"method": method, "turn": turn, "seconds": stats["seconds"]["reconstruct"],
             "megabytes": max(0.0, stats["peak_bytes"] - base["peak_bytes"]) / 1e6}]
