"""The picture of the README: the same scene after the same time, by several programs, beside its reference."""
import os

import exr
import figure
import panels
from measures import bench

REFERENCES = True


def cells(run, where):
    return [[run["scene"]]]


def measure(cell, run, where, folder):
    runs = bench.measure(cell, run, where, folder)
    files = [bench.image(folder, run["scene"], method, run["times"][0]) for method in run["methods"]]
    images = [exr.rgb(file) for file in (*files, where.reference(run["scene"])[0])]
    crops = [panels.enlarged(panels.shown(crop(image, run["crop"]))) for image in images]
    exr.write(os.path.join(figure.RESULTS, run["file"]), panels.beside(crops), exr.EIGHT_BIT)
    return sorted(runs, key=lambda one: run["methods"].index(one["method"]))


def crop(image, window):
    x, y, width, height = window
    return image[y:y + height, x:x + width]
