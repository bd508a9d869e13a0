"""The picture of the README: the same scene after the same time, by several programs."""
import os

import numpy as np

import exr
import figure
import program

GAP = 4


def cells(run, where):
    return [[label] for label in run["methods"]]


def measure(cell, run, where, folder):
    """The panel of a method; the last one puts the picture together, with the reference."""
    label = cell[0]
    scene, (reference, floor) = where.scene(run["scene"]), where.reference(run["scene"])
    path = lambda name: os.path.join(folder, name + ".exr")
    stats = program.with_statistics("render", scene.path, "-o", path(label), "--size", scene.size, "--method", run["methods"][label],
                                    *(["--time", run["time"]]), *run["options"].get(label, []))
    if label == list(run["methods"])[-1]:
        panels = [exr.rgb(path(name)) for name in run["methods"]] + [exr.rgb(reference)]
        exr.write(os.path.join(figure.RESULTS, run["file"]), joined([shown(crop(image, run["crop"])) for image in panels]), exr.EIGHT_BIT)
    return [{"image": label, "method": run["methods"][label], "spp": stats["spp"], **program.errors(path(label), reference, floor)}]


def crop(image, window):
    x, y, width, height = window
    return image[y:y + height, x:x + width]


def shown(image):
    """Values in [0, 1] by sRGB's curve, each pixel twice as wide and high."""
    image = np.clip(image, 0, 1)
    encoded = np.where(image <= 0.0031308, 12.92 * image, 1.055 * image ** (1 / 2.4) - 0.055)
    return encoded.repeat(2, 0).repeat(2, 1)


def joined(panels):
    gap = np.ones((panels[0].shape[0], GAP, 3))
    return np.concatenate([part for panel in panels for part in (panel, gap)][:-1], 1)
