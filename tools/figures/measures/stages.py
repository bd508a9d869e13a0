"""The picture of a method's stages, from the samples to the result, by its own notes."""
import os

import numpy as np

import exr
import figure
import panels
import program

REFERENCES = False
COLUMNS = 3
# Differences are small beside the colours.
DIFFERENCES = 4


def cells(run, where):
    return [[run["scene"]]]


def measure(cell, run, where, folder):
    scene = where.scene(*cell)
    at = lambda name: os.path.join(folder, name + ".exr")
    notes = os.path.join(folder, "notes")
    program.with_statistics("render", scene.path, "--size", scene.size, "--spp", run["spp"], "--method", run["method"], "-o", at("image"),
                            "--layers", at("layers"), "--notes", notes)
    layers = exr.everything(at("layers"))
    rgb = lambda prefix: np.stack([layers[prefix + channel] for channel in "RGB"], -1)
    note = lambda name: exr.rgb(os.path.join(notes, name + ".exr"))
    images = {
        "samples": rgb("") + rgb("direct."),
        "denoised": note("denoised"),
        "horizontal differences, four times": DIFFERENCES * np.abs(note("dx")),
        "result of the coarse level": panels.enlarged(note("level1_filtered")),
        "enhanced": note("level0_enhanced"),
        "result": exr.rgb(at("image")),
    }
    shown = [panels.shown(image) for image in images.values()]
    rows = [panels.beside(shown[k:k + COLUMNS]) for k in range(0, len(shown), COLUMNS)]
    exr.write(os.path.join(figure.RESULTS, run["file"]), panels.below(rows), exr.EIGHT_BIT)
    return [{"panel": str(k + 1), "content": content} for k, content in enumerate(images)]
