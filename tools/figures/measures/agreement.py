"""Radiance beside Mitsuba 3: ratios of means, and differences of pixels in standard errors."""
import os

import numpy as np

import exr
import peers
import program
import scenes
from scenes import ROOT

REFERENCES = False

# Their smaller sides keep Mitsuba's renders short.
BUNDLED_SIZE, SMALL_SIZE = "64x48", "32x24"


def cells(run, where):
    """Kind and name of every scene."""
    bundled = scenes.bundled()
    unit = os.path.join(ROOT, "scenes", "unit")
    bundled += ["unit/" + name for name in sorted(os.listdir(unit)) if os.path.exists(os.path.join(unit, name, "scene.xml"))]
    public = [scene.name for scene in where.scenes if where.public and scene.path.startswith(where.public)]
    return [["public", name] for name in public] + [["suite", name] for name in sorted(suite(where.public))] + [
        ["bundled", name] for name in bundled if name not in run["without"]]


def suite(public):
    """Scenes of Mitsuba's own test suite, with the reference and its variance of a sample that its authors keep with them."""
    found = {}
    for folder, _, files in os.walk(os.path.join(public, "mitsuba-tests")) if public else ():
        for file in (file for file in files if file.endswith("_ref_rgb.exr")):
            stem, above = file[:-len("_ref_rgb.exr")], os.path.dirname(folder)
            for scene in os.listdir(above):
                if scene in (stem + "_path.xml", stem + "_direct.xml"):
                    name = stem.removeprefix("test_") if stem != "scene" else os.path.basename(above)
                    found[name] = os.path.join(above, scene), os.path.join(folder, file)
    return found


def measure(cell, run, where, folder):
    kind, name = cell
    # Variances of a single sample are divided by ours; references of the suite have many more samples than that, and count as exact.
    of_sample = kind == "suite" and name not in run["rendered"]
    samples = run["samples"][kind]
    if kind == "suite":
        path, reference = suite(where.public)[name]
        expected, theirs = exr.rgb(reference), exr.rgb(reference[:-4] + "_var.exr")
        if not of_sample:
            expected, theirs = peers.mean_and_variance(path, expected.shape[1::-1], 512)
    elif kind == "public":
        path = where.scene(name).path
        expected, theirs = stored(where, name)
    else:
        path = os.path.join(ROOT, "scenes", name, "scene.xml")
        size = SMALL_SIZE if name == "unit/orthographic" else BUNDLED_SIZE
        expected, theirs = peers.mean_and_variance(path, tuple(map(int, size.split("x"))), samples // 8)
    image, layers = os.path.join(folder, "image.exr"), os.path.join(folder, "layers.exr")
    height, width, _ = expected.shape
    stats = program.with_statistics("render", path, "-o", image, "--layers", layers, "--size", f"{width}x{height}", "--spp", samples,
                                    "--method", "primal")
    channels = exr.everything(layers)
    rgb = lambda prefix: np.stack([channels[prefix + c] for c in "RGB"], -1)
    mean, ours = rgb("") + rgb("direct."), rgb("variance.") + rgb("direct_variance.")
    if of_sample:
        # Pixels that all samples of one program missed have no variance there; the floor is for rounding.
        ours, theirs = np.maximum(np.maximum(ours, theirs / samples), 1e-4 / samples), 0
    total = ours + theirs
    z = np.where(np.abs(mean - expected) <= 1e-5 * expected, 0.0, (mean - expected) / np.sqrt(total + 1e-12))
    whole = expected.sum((0, 1))
    return [{
        "scene": name, "kind": kind, "samples": samples,
        "ratio": list(mean.sum((0, 1)) / whole), "error": list(np.sqrt(total.sum((0, 1))) / whole),
        "z": float(np.sqrt((z * z).mean())), "beyond": float(100 * (np.abs(z) > 4).mean()),
        "load": stats["seconds"]["load"], "render": stats["seconds"]["render"], "megabytes": stats["peak_bytes"] / 1e6,
    }]


def stored(where, name):
    """Mitsuba's mean and variance of a public scene, rendered unless they are there."""
    path = os.path.join(where.mitsuba, name)
    if not os.path.exists(path + "_var.exr"):
        os.makedirs(where.mitsuba, exist_ok=True)
        scene = where.scene(name)
        mean, variance = peers.mean_and_variance(scene.path, scene.width_and_height, 256)
        exr.write(path + ".exr", mean)
        exr.write(path + "_var.exr", variance)
    mean, variance = exr.rgb(path + ".exr"), exr.rgb(path + "_var.exr")
    if mean.shape[1::-1] != where.scene(name).width_and_height:
        raise program.Failed("%s.exr has another size than figures/scenes.toml says: remove it" % path)
    return mean, variance
