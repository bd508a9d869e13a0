"""The picture of the README: the same scene after the same time, by several programs, beside its reference."""
import os

import numpy as np

import exr
import figure
from measures import bench

REFERENCES = True
GAP = 4


def cells(run, where):
    return [[run["scene"]]]


def measure(cell, run, where, folder):
    runs = bench.measure(cell, run, where, folder)
    files = [bench.image(folder, run["scene"], method, run["times"][0]) for method in run["methods"]]
    panels = [exr.rgb(file) for file in (*files, where.reference(run["scene"])[0])]
    exr.write(os.path.join(figure.RESULTS, run["file"]), joined([shown(crop(image, run["crop"])) for image in panels]), exr.EIGHT_BIT)
    return sorted(runs, key=lambda one: run["methods"].index(one["method"]))


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
